"""`python -m choreograph`."""

from choreograph.cli.main import run

run()
