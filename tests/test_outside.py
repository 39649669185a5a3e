"""Processes of their own for what damaged files bring down; damaged Parquet by the commands."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from syncline_design.machine.deadline import Deadline, OutOfTime, within
from syncline_design.machine.outside import MOST_MEMORY, MOST_PIECE_S, Outside

ROOT = Path(__file__).resolve().parents[1]
FIRST_PAGE = range(12, 17)  # bytes behind its head: the lengths and the packed figures
ALL_FLIPS = """
import sys
from pathlib import Path
from typer.testing import CliRunner
from syncline_design.cli.app import app
whole = Path(sys.argv[1]).read_bytes()
for at in map(int, sys.argv[2:]):
    for bit in range(8):
        path = Path(sys.argv[1]).with_name(f"{at}-{bit}.parquet")
        changed = bytearray(whole)
        changed[at] ^= 1 << bit
        path.write_bytes(changed)
        page = path.with_suffix(".json")
        done = CliRunner().invoke(app, ["audit", str(path), "--output", f"json:{page}"])
        print(at, bit, done.exit_code, page.exists(), done.stderr.strip(), sep="|", flush=True)
"""


def answered(request: bytes) -> Iterator[bytes]:
    """What a test asks of the process: a word, and how it ends."""
    yield request
    print("what a library prints")
    os.write(1, b"and what it writes by itself")
    if request == b"abort":
        os.abort()
    if request == b"error":
        raise ValueError(request)
    if request == b"memory":
        yield bytes(MOST_MEMORY + 2**20)[:1]
    if request == b"sleep":
        time.sleep(600)
    if request == b"bounds":
        import resource

        yield str(resource.getrlimit(resource.RLIMIT_CPU)[0]).encode()
    yield str(os.getpid()).encode()


def outside() -> Outside:
    return Outside("tests.test_outside:answered")


def test_one_process_answers_one_request_after_another() -> None:
    child = outside()
    first, second = list(child.pieces(b"")), list(child.pieces(b"b" * 10**6))
    assert first[0] == b""
    assert second[0] == b"b" * 10**6
    assert first[1] == second[1] != str(os.getpid()).encode()
    assert not child.gone


@pytest.mark.parametrize(("end", "died"), [("abort", True), ("error", False), ("memory", False)])
def test_what_came_before_the_end_is_kept(
    end: str, died: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    child = outside()
    assert list(child.pieces(end.encode())) == [end.encode()]
    assert (child.gone, child.died) == (True, died)
    assert capfd.readouterr() == ("", "")


def test_processor_time_is_bounded_piece_by_piece() -> None:
    _, bound, _ = outside().pieces(b"bounds")
    assert 0 < int(bound) - MOST_PIECE_S < 60


def test_a_passed_deadline_ends_the_process() -> None:
    child = outside()
    with within(Deadline(0.0)), pytest.raises(OutOfTime):
        list(child.pieces(b"sleep"))
    assert child.gone


def test_it_ends_with_the_one_that_started_it() -> None:
    code = (
        "from syncline_design.machine.outside import Outside\n"
        "child = Outside('tests.test_outside:answered')\n"
        "print(list(child.pieces(b''))[1].decode(), flush=True)\n"
        "list(child.pieces(b'sleep'))\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE) as one:
        assert one.stdout is not None
        number = int(one.stdout.readline())
        time.sleep(0.3)
        assert _runs(number)
        one.send_signal(signal.SIGKILL)
    end = time.monotonic() + 30
    while _runs(number) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _runs(number)


def _runs(number: int) -> bool:
    try:
        os.kill(number, 0)
        return "Z" not in Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False


def test_changed_bits_of_parquet_are_refused_in_one_line(tmp_path: Path) -> None:
    """Bit 0 of byte 14 asked polars for 2^61 bytes, which ended the command (SIGABRT)."""
    import polars as pl

    rows, path = np.arange(40.0), tmp_path / "whole.parquet"
    table = pl.DataFrame({"stamp_s": rows, "receive_s": rows + 0.1})
    table.write_parquet(path, compression="snappy")
    command = [sys.executable, "-c", ALL_FLIPS, str(path), *map(str, FIRST_PAGE)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    lines = [line.split("|") for line in done.stdout.splitlines()]
    assert len(lines) == 8 * len(FIRST_PAGE)  # and so none of what was said had a second line
    for at, bit, code, page, said in lines:
        assert code in ("0", "1", "2")
        assert page == str(code != "2")
        assert not said if code != "2" else f"{at}-{bit}.parquet" in said
    assert {code for _, _, code, _, _ in lines} >= {"2"}
    assert any("crashes there" in said for *_, said in lines)
    assert not any("unwrap" in said or "panic" in said.lower() for *_, said in lines)
