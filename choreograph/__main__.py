"""`python -m choreograph`."""

from choreograph.cli import run

run()
