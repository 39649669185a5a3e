"""`python -m syncline_design.cli` is the command."""

from syncline_design.cli import main

main()
