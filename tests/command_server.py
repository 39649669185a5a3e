"""A process that has imported the package and forks a fresh command for every request.

What a command does after its imports is what `syncline-design` does: its own process, working
folder, environment, standard streams and exit code.  Importing anew each time would cost a second
of processor time a command.  Started by `command.run`; one request a line, JSON.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import pkgutil
import sys
from typing import Any


def _import_all() -> None:
    package = importlib.import_module("syncline_design")
    for found in pkgutil.walk_packages(package.__path__, "syncline_design."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)


def _become(request: dict[str, Any]) -> None:
    """Be the command: never returns."""
    code: object = 0
    try:
        os.chdir(request["cwd"])
        os.environ.clear()
        os.environ.update(request["environment"])
        for stream, path in enumerate(request["streams"]):
            flags = os.O_RDONLY if stream == 0 else os.O_WRONLY | os.O_APPEND
            os.dup2(os.open(path, flags), stream)
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", buffering=1, closefd=False)  # noqa: SIM115
        sys.argv = ["syncline-design", *request["arguments"]]
        from syncline_design.cli import main

        main()
    except SystemExit as end:
        code = end.code
    except BaseException:
        import traceback

        traceback.print_exc()
        code = 1
    if isinstance(code, str):
        print(code, file=sys.stderr)
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.flush()
    os._exit(code if isinstance(code, int) else 0 if code is None else 1)


def serve() -> None:
    _import_all()
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        request = json.loads(line)
        child = os.fork()
        if child == 0:
            _become(request)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        answers.write(f"{status}\n")
        answers.flush()


if __name__ == "__main__":
    serve()
