"""The studio: a local web page where an engineer looks (FastAPI; the front end's sources are in web/)."""
