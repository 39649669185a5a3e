"""A long log takes the memory of the rows that are kept of it, not of all its rows."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from syncline_design.auditing.stream import examined
from syncline_design.logs.readers.stream import Stamps, Stream

COLUMNS = [f"{what}_{axis}_m" for what in ("position", "reference") for axis in
           ("north", "east", "down")]  # fmt: skip
COLUMNS += ["velocity_north_mps", "velocity_east_mps", "velocity_down_mps"]
COLUMNS += ["roll_deg", "pitch_deg", "yaw_deg"]
PEAK = """
import resource, sys
from pathlib import Path
from syncline_design.logs import tables
from syncline_design.logs.row_choice import thinned
tables.thinned = lambda files: thinned(files, 20_000)
for name in sys.argv[1:]:
    (table,) = tables.read_tables([Path(name)], {}, ("car",))
    print(table.rows, len(table), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def written(path: Path, rows: int) -> Path:
    time_s = 0.01 * np.arange(rows)
    courses = {name: np.sin(1e-3 * (k + 1) * time_s).round(4) for k, name in enumerate(COLUMNS)}
    pl.DataFrame({"time_s": time_s, **courses}).write_csv(path)
    return path


def test_rows_that_are_not_kept_take_little_memory(tmp_path: Path) -> None:
    """Four times the rows, as many kept: less than half of what the others' figures would take."""
    short, long = 100_000, 400_000
    files = [written(tmp_path / f"{rows}.csv", rows) for rows in (short, long)]
    done = subprocess.run(
        [sys.executable, "-P", "-c", PEAK, *map(str, files)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    read = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert read[:, 0].tolist() == [short, long]
    assert np.all(np.abs(read[:, 1] - 20_000) < 500)
    whole_kb = (long - short) * (len(COLUMNS) + 1) * 8 / 1024
    assert read[1, 2] - read[0, 2] < 0.5 * whole_kb


AUDITED = """
import sys
from pathlib import Path
from syncline_design.auditing.run import audit
found = audit([Path(sys.argv[1])])
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(peak.split()[1], found.evidence[0].sha256)
"""


def pictures(path: Path, count: int) -> Path:
    """Messages of 1 MB at 10 Hz, in chunks that are not packed."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4_000_000, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("picture", "jsonschema", b"{}")
        topic = writer.register_channel("/picture", "json", schema)
        for k in range(count):
            at = 1_787_654_321_000_000_000 + k * 100_000_000
            writer.add_message(topic, log_time=at + 3_000_000, data=b"{}" * 500_000,
                               publish_time=at)  # fmt: skip
        writer.finish()
    return path


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux for the peak")
def test_an_audit_holds_as_much_of_a_large_file_as_of_a_small_one(tmp_path: Path) -> None:
    """180 MB more of pictures; its evidence is the digest that hashlib makes of the whole file."""
    peaks = []
    for count in (60, 240):
        path = pictures(tmp_path / f"{count}.mcap", count)
        done = subprocess.run(
            [sys.executable, "-P", "-c", AUDITED, str(path)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        peak, digest = done.stdout.split()
        peaks.append(int(peak))
        assert digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert peaks[1] - peaks[0] < 20_000  # kB


def test_an_audit_holds_some_numbers_a_message(tmp_path: Path) -> None:
    """200 000 messages: far fewer than the hundred neighbours by which each is looked at."""
    rng = np.random.default_rng(7)
    stamp = 1_787_654_321_000_000_000 + 1_000_000 * np.arange(200_000)
    receive = np.maximum.accumulate(stamp + (1e6 * rng.gamma(2.0, 1.0, stamp.size)).astype(int))
    told = Stream("imu", (), stamp.size, Stamps("stamp", "receive time", stamp, receive))
    tracemalloc.start()
    found = examined(told)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert not found.faults
    assert peak < 400 * stamp.size
