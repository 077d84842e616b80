"""Builds a repertoire file from takes and their songs."""
