"""Renders a plan to motion: runs of takes, transitions, assembly."""
