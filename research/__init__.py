"""Reproduces the papers' tables. Not installed."""
