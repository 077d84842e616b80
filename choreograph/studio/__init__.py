"""The studio: a local web server that makes dances, changes parts of them and keeps every step."""
