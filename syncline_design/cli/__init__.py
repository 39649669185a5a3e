"""The command line: parse, call, print, exit."""

from __future__ import annotations

import contextlib
import sys

__all__ = ["main"]

INTERRUPTED = 130


def main() -> None:
    """Entry point of the `syncline-design` command; Ctrl-C may come while it still imports.

    One that comes while the arguments are read ends in the parser's wordless exit of the same code.
    """
    try:
        from syncline_design.cli.app import main as run

        run()
    except KeyboardInterrupt:
        _say_interrupted()
        raise SystemExit(INTERRUPTED) from None
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            _say_interrupted()
        raise


def _say_interrupted() -> None:
    with contextlib.suppress(OSError):
        sys.stderr.write("syncline-design: interrupted\n")
