"""The studio: local web pages that show and compute drives (FastAPI; the front end's sources are in web/)."""
