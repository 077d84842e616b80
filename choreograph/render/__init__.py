"""A plan to its motion: runs of takes, transitions, assembly."""
