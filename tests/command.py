"""Run `syncline-design` in a process of its own, forked from one that has imported it already.

For tests of what a command says, writes and ends with.  Where the start of the process is what is
tested (its environment, what it imports, closed streams, signals), start a real one.
"""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parent.parent


def run(
    *arguments: str, cwd: Path = ROOT, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """What `syncline-design ARGUMENTS` prints and ends with; environment: what differs from ours.

    SYNCLINE_DEBUG is unset unless given.
    """
    given = {name: value for name, value in os.environ.items() if name != "SYNCLINE_DEBUG"}
    with tempfile.TemporaryDirectory() as folder:
        out, err = Path(folder, "out"), Path(folder, "err")
        out.touch()
        err.touch()
        request = {
            "arguments": arguments, "cwd": str(cwd), "streams": [os.devnull, str(out), str(err)],
            "environment": {**given, **(environment or {})},
        }  # fmt: skip
        code = _ask(json.dumps(request))
        return subprocess.CompletedProcess(
            ["syncline-design", *arguments], code, out.read_text("utf-8"), err.read_text("utf-8")
        )


def _ask(request: str) -> int:
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdin.write(request + "\n")
    server.stdin.flush()
    answer = server.stdout.readline()
    assert answer, "the command server ended"
    return int(answer)


@functools.cache
def _server() -> subprocess.Popen[str]:
    server = subprocess.Popen(
        [sys.executable, str(Path(__file__).parent / "command_server.py")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    atexit.register(_end, server)
    return server


def _end(server: subprocess.Popen[str]) -> None:
    assert server.stdin is not None
    server.stdin.close()
    server.wait()
