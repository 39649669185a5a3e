"""The command line: parse, call, print, exit."""

from __future__ import annotations

import sys

__all__ = ["main"]

INTERRUPTED = 130


def main() -> None:
    """Entry point of the `syncline-design` command; Ctrl-C may come while it still imports."""
    try:
        from syncline_design.cli.app import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("syncline-design: interrupted\n")
        raise SystemExit(INTERRUPTED) from None
