"""`python -m syncline_design` is the command."""

from syncline_design.cli import main

main()
