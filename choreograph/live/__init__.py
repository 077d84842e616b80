"""Dances that are sent to other programs while their song plays."""
