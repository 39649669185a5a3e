"""The command line: parse, call, print, exit."""

from syncline_design.cli.app import main

__all__ = ["main"]
