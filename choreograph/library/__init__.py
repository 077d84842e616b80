"""Repertoires: their file, motion words and motifs, the build, and the built-in repertoire."""
