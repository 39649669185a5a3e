"""What `once` gives out: made by one process, the same in all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import once

MAKER = """\
import os, sys
sys.path.insert(0, sys.argv[1])
from once import once
@once
def made():
    with open("made.txt", "a") as file: file.write("x")
    return {"by": os.getpid()}
assert made() is made()
print(made()["by"])
"""


def _asked(folder: Path, count: int) -> list[str]:
    """What as many processes at a time are given."""
    command = [sys.executable, "-c", MAKER, str(Path(once.__file__).parent)]
    environment = {**os.environ, once.SHARED: str(folder)}
    started = [
        subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(count)
    ]
    return [one.communicate(timeout=60)[0] for one in started]


def test_processes_that_ask_at_once_share_what_one_of_them_made(tmp_path: Path) -> None:
    given = _asked(tmp_path, 4)
    assert len(set(given)) == 1
    assert given[0].strip().isdigit()
    assert (tmp_path / "made.txt").read_text() == "x"


def test_another_run_makes_its_own(tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    assert _asked(tmp_path / "one", 1) != _asked(tmp_path / "other", 1)
