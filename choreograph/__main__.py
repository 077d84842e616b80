"""`python -m choreograph`."""

from choreograph.cli import main

main(prog_name="choreograph")
