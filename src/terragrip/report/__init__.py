"""Reports: figures and one self-contained page from estimates, with or without a reference or a truth."""
