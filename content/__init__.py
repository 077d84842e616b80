"""Generates the built-in takes and songs, and trains the shipped networks. Not installed."""
