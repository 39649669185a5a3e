"""Helper processes end with the one that started them, whatever ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(sys.executable).parent / "syncline-design"
STUDY = """\
study: 1
name: many long cases
base: uav.yaml
check: {monte_carlo: true}
grid: {"requirements[ACC-1].limit": {low: 40 cm, high: 90 cm, count: 40}}
"""

pytestmark = [
    pytest.mark.skipif(not COMMAND.exists(), reason="the package is not installed here"),
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux /proc"),
]


def descendants(pid: int) -> set[int]:
    """Every process below a process, by its parents in /proc."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = folder.joinpath("stat").read_text().rpartition(")")[2].split()
            except (OSError, IndexError):
                continue
            if stat[0] != "Z":
                parents[int(folder.name)] = int(stat[1])
    found, left = set[int](), [pid]
    while left:
        children = [child for child, parent in parents.items() if parent == left[0]]
        found.update(children)
        left = left[1:] + children
    return found


def alive(pids: set[int]) -> set[int]:
    states = {}
    for pid in pids:
        try:
            text = Path(f"/proc/{pid}/stat").read_text()
        except OSError:
            continue
        states[pid] = text.rpartition(")")[2].split()[0]
    return {pid for pid, state in states.items() if state != "Z"}


def within(seconds: float, holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if holds():
            return True
        time.sleep(0.02)
    return holds()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    spec = (ROOT / "specs" / "uav_corridor.yaml").read_text()
    samples = "monte_carlo: {samples: 2000000}"
    (tmp_path / "uav.yaml").write_text(f"{spec}\n{samples}\n")
    (tmp_path / "study.yaml").write_text(STUDY)
    return tmp_path


SIMULATE = ("simulate", "uav.yaml", "--samples", "900000000", "--workers", "2")
SWEEP = ("study", "study.yaml", "--workers", "2")


def heard() -> None:
    """Hear a hang-up, which tests that run under `nohup` would hand on as ignored."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.parametrize("arguments", [SIMULATE, SWEEP], ids=lambda a: a[0])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_no_helper_outlives_its_parent(
    folder: Path, arguments: tuple[str, ...], number: signal.Signals
) -> None:
    process = subprocess.Popen(
        [str(COMMAND), *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=heard,
    )  # fmt: skip
    helpers: set[int] = set()
    try:
        assert within(30, lambda: len(descendants(process.pid)) >= 2)
        time.sleep(0.5)  # into the work
        helpers = descendants(process.pid)
        process.send_signal(number)
        process.wait(timeout=10)
        assert process.returncode == (-number if number == signal.SIGKILL else 128 + number)
        assert within(5, lambda: not alive(helpers)), f"{len(alive(helpers))} go on"
    finally:
        process.kill()
        process.wait()
        for pid in alive(helpers):
            os.kill(pid, signal.SIGKILL)
    assert process.stderr is not None
    assert b"Traceback" not in process.stderr.read()
