"""Broken and hostile logs in flat formats: refused, or read up to their damage and told.

The files are made by the writers of the other tests; the named ones end as said.  Whatever seeded
damage does to any of them, nothing but a refusal is raised, and what is read is whole.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.logs.readers import open_recording
from syncline_design.spec.load import BadInput
from tests.test_diagnose_recordings import spec
from tests.test_log_clouds import capture, cloud, legacy, patched, udp
from tests.test_log_dataflash import ATT, fmt, message
from tests.test_log_dataflash import flight as dataflash
from tests.test_log_receivers import pvt, sentence
from tests.test_log_trajectories import HEIGHTS, REST, TITLE
from tests.test_log_trajectories import flight as sbet

AT = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
EPOCHS = "".join(
    f"2023/07/11 06:04:{k:02d}.000 35.1653 136.8814 41.4 {REST} 0 0 0\n" for k in range(40)
)
SOLUTION = (HEIGHTS + TITLE + EPOCHS).encode()
LOST = SOLUTION[:-1].rpartition(b"\n")[0] + b"\n2023/07/11 06:04:59 35 136 41 1 19 1 1 1\n"
TUM = "".join(f"{1.5e9 + k:.6f} 1 2 3 0 0 0 1\n" for k in range(40)).encode()
EUROC = "".join(f"{1403636580838555648 + k},1,2,3,1,0,0,0\n" for k in range(40)).encode()
KITTI = ("1 0 0 4 0 1 0 5 0 0 1 6\n" * 40).encode()
CSV = b"stamp_s,receive_s\n" + b"".join(b"%d.5,%d.6\n" % (k, k) for k in range(40))
GPSD = b"".join(
    b'{"class":"TPV","mode":3,"time":"2026-05-04T10:00:%02dZ","lat":47.5,"lon":8.5}\n' % k
    for k in range(40)
)
NMEA = b"".join(sentence(f"GPHDT,{k}.0,T") for k in range(40))
UBX = pvt(AT) * 40
SBET = sbet(40).astype("<f8").tobytes()


def las(folder: Path) -> Path:
    return cloud(folder / "made.las", np.arange(40.0))


def laz(folder: Path) -> Path:
    return cloud(folder / "made.laz", np.arange(40.0))


def packets(folder: Path) -> Path:
    frames = [(Decimal(k), udp(legacy(5 * 10**9 + k, 97_656, 9, 0), 7502)) for k in range(5)]
    return capture(folder / "made.pcap", frames)


def parquet(folder: Path) -> Path:
    import polars as pl

    rows = np.arange(40.0)
    pl.DataFrame({"stamp_s": rows, "receive_s": rows + 0.1}).write_parquet(folder / "made.parquet")
    return folder / "made.parquet"


def swapped(content: bytes, old: bytes, new: bytes, count: int = 1) -> bytes:
    assert old in content
    return content.replace(old, new, count)


# name -> the content, and messages that are read of it or words of the refusal
CASES: dict[str, tuple[bytes | Callable[[Path], Path], int | str]] = {
    "dataflash/cut.bin": (dataflash(4)[:-7], 35),
    "dataflash/formats-alone.bin": (fmt(ATT)[:-1], "no message"),
    "dataflash/not-its-magic.bin": (b"\x00" + dataflash(4)[3:], "no log that can be read"),
    "dataflash/hole.bin": (dataflash(2) + bytes(range(1, 90)) + message(ATT, 9, 1, 2, 3, 4), 27),
    "dataflash/kind-unknown.bin": (dataflash(1) + b"\xa3\x95\xc8" + b"\x55" * 30, 21),
    "nmea/cut.log": (NMEA[:-6], 39),
    "nmea/all-checksums-wrong.log": (NMEA.replace(b"GPHDT", b"GPHDX"), "no log that can be read"),
    "nmea/line-without-end.log": (NMEA + b"$" + b"A" * 3000, 40),
    "nmea/binary-between.log": (NMEA[:200] + bytes(range(128, 256)) + NMEA[200:], 39),
    "nmea/time-of-25-hours.log": (NMEA + sentence("GPGGA,256060.00,,,,,0,,,,,,,"), 41),
    "gpsd/cut.json": (GPSD[:-9], 39),
    "gpsd/hour-25.json": (swapped(GPSD, b"T10:00:07", b"T25:00:07"), 39),
    "gpsd/nul.json": (swapped(GPSD, b"T10:00:07", b"\0" * 9), 39),
    "gpsd/nested-deep.json": (GPSD + b'{"class":"TPV","a":' + b"[" * 60_000 + b"\n", 40),
    "gpsd/long-figure.json": (GPSD + b'{"class":"TPV","a":' + b"9" * 60_000 + b"}\n", 40),
    "gpsd/no-report.json": (b'{"class":"TPV"\n' * 40, "no report"),
    "parquet/cut.parquet": (lambda f: _cut(parquet(f), 9), "no readable Parquet"),
    "parquet/footer-of-4-GB.parquet": (lambda f: _footer(parquet(f)), "no readable Parquet"),
    "parquet/magic-alone.parquet": (b"PAR1" * 20, "no readable Parquet"),
    "ubx/cut.ubx": (UBX[:-20], 39),
    "ubx/length-of-64-kB.ubx": (UBX + b"\xb5b\x01\x07\xff\xff" + UBX, 80),
    "ubx/checksum.ubx": (UBX[:130] + b"\x99" + UBX[131:], 39),
    "ubx/heads-alone.ubx": (b"\xb5b" * 500, "no log that can be read"),
    "ubx/payload-too-short.ubx": (UBX + b"\xb5b\x01\x07\x02\x00\x00\x00\x0a\x31", 41),
    "pos/cut.pos": (SOLUTION[:-60], 39),
    "pos/column-lost.pos": (LOST, 39),
    "pos/month-13.pos": (swapped(SOLUTION, b"07/11 06:04:09", b"13/11 06:04:09"), 39),
    "pos/year-1.pos": (SOLUTION.replace(b"2023/07", b"0001/07"), 40),
    "pos/year-9999.pos": (SOLUTION.replace(b"2023/07", b"9999/07"), 40),
    "pos/beyond-the-pole.pos": (swapped(SOLUTION, b"35.1653", b"95.1653"), 39),
    "pos/header-alone.pos": ((HEIGHTS + TITLE).encode(), "no epoch in the solution"),
    "pos/a-line-of-1-MB.pos": (SOLUTION + b"1 " * 2**19, 40),
    "trajectory/cut.txt": (TUM[:-8], 39),
    "trajectory/seven-cells.txt": (swapped(TUM, b" 1 2 3 0 0 0 1", b" 1 2 3 0 0 1"), 39),
    "trajectory/a-word.txt": (swapped(TUM, b" 1 2 3", b" 1 two 3"), 39),
    "trajectory/no-rotations.txt": (KITTI.replace(b"1 0 0 4", b"2 0 0 4"), "no log that can"),
    "trajectory/euroc-cut.csv": (EUROC[:-9], 39),
    "trajectory/nul.txt": (TUM[:600] + b"\0" + TUM[600:], 39),
    "sbet/cut.out": (SBET[:-1], 39),
    "sbet/beyond-the-pole.out": (SBET[: 136 * 30] + b"\xff" * 136 + SBET[136 * 31 :], 39),
    "sbet/zeros.out": (bytes(136 * 40), "no log that can be read"),
    "las/cut.las": (lambda f: _cut(las(f), 20), 39),
    "las/header-cut.las": (lambda f: _cut_to(las(f), 200), "header is cut"),
    "las/record-past-the-end.las": (lambda f: patched(las(f), 100, "<I", 2), "cannot be"),
    "las/points-claimed.las": (lambda f: patched(las(f), 247, "<Q", 2**60), 40),
    "las/packed-but-not.las": (lambda f: patched(las(f), 104, "<B", 6 | 128), "LASzip"),
    "las/cut.laz": (lambda f: _cut(laz(f), 40), "no point"),
    "las/bomb.laz": (lambda f: patched(laz(f), 247, "<Q", 2**40), "unpacks to too much"),
    "las/layers-of-4-GB.laz": (lambda f: _layers(laz(f)), "no point"),
    "las/chunks-of-4-billion.laz": (lambda f: _chunks(laz(f)), 40),
    "pcap/cut.pcap": (lambda f: _cut(packets(f), 100), 4),
    "pcap/packet-of-4-GB.pcap": (lambda f: patched(packets(f), 32, "<I", 2**32 - 1), "no packet"),
    "pcap/no-ethernet.pcap": (lambda f: patched(packets(f), 20, "<I", 147), "no packet"),
    "pcap/head-alone.pcap": (lambda f: _cut_to(packets(f), 24), "no packet"),
    "csv/cut.csv": (CSV[:-6], 39),
    "csv/one-column.csv": (b"stamp_s\n1\n2\n", "no log that can be read"),
    "csv/mixed-units.csv": (b"stamp_s,stamp_ms,receive_s\n1,1,2\n", "two columns of stamps"),
    "csv/words.csv": (swapped(CSV, b"7.5", b"seven"), 39),
    "csv/ragged.csv": (swapped(CSV, b"7.5,7.6", b"7.5,7.6,7.7"), 39),
    "csv/quote-open.csv": (swapped(CSV, b"7.5", b'"7.5'), 39),
    "csv/not-utf-8.csv": (swapped(CSV, b"7.5", b"7\xff5"), 39),
    "csv/header-alone.csv": (b"stamp_s,receive_s\n", "no rows"),
}  # fmt: skip


def _footer(path: Path) -> Path:
    """A description at the end that claims 4 GB."""
    content = path.read_bytes()
    path.write_bytes(content[:-8] + struct.pack("<I", 2**32 - 1) + content[-4:])
    return path


def _cut(path: Path, lost: int) -> Path:
    return _cut_to(path, path.stat().st_size - lost)


def _cut_to(path: Path, size: int) -> Path:
    path.write_bytes(path.read_bytes()[:size])
    return path


def _first_point(path: Path) -> int:
    return int(struct.unpack_from("<I", path.read_bytes(), 96)[0]) + 8


def _layers(path: Path) -> Path:
    """Sizes of layers that no file has; the library would make room for them."""
    return patched(path, _first_point(path) + 30 + 4, "<I", 2**32 - 1)


def _chunks(path: Path) -> Path:
    """A table of chunks with an absurd count; the points are there all the same."""
    table = struct.unpack_from("<q", path.read_bytes(), _first_point(path) - 8)[0]
    return patched(path, table + 4, "<I", 2**32 - 1)


@pytest.mark.parametrize("name", CASES)
def test_a_broken_file_ends_as_said(tmp_path: Path, name: str) -> None:
    made, outcome = CASES[name]
    path = tmp_path / name.replace("/", "-")
    if isinstance(made, bytes):
        path.write_bytes(made)
    else:
        path = made(tmp_path)
    if isinstance(outcome, str):
        with pytest.raises(BadInput, match=outcome):
            open_recording(path).streams()
        return
    recording = open_recording(path)
    streams = recording.streams()
    assert sum(s.messages for s in streams if s.name != "fix") == outcome
    whole = name in ("nmea/time-of-25-hours.log", "ubx/payload-too-short.ubx",
                     "las/chunks-of-4-billion.laz", "pos/year-1.pos",
                     "pos/year-9999.pos")  # fmt: skip
    assert (recording.incomplete is None) == whole
    assert all(stream.partial != whole for stream in streams)


@pytest.mark.parametrize("name", [name for name, (_, end) in CASES.items() if end == str(end)])
def test_a_refused_file_writes_nothing(tmp_path: Path, name: str) -> None:
    made, _ = CASES[name]
    path = tmp_path / name.replace("/", "-")
    if isinstance(made, bytes):
        path.write_bytes(made)
    else:
        path = made(tmp_path)
    rover, mapped = spec(tmp_path), tmp_path / "mapped.yaml"
    for command in (
        ["log", "inspect", str(path), "--spec", str(rover), "--write-spec", str(mapped)],
        ["audit", str(path), "--spec", str(rover), "--write-spec", str(mapped)],
    ):
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 2, done.output
        assert "Traceback" not in done.output
    assert not mapped.exists()


def _damaged(raw: bytes, rng: random.Random) -> bytes:
    kind, at = rng.randrange(5), rng.randrange(len(raw))
    if kind == 0:
        return raw[: max(at, 1)]
    if kind == 1:
        return raw[:at] + rng.randbytes(rng.randrange(1, 9)) + raw[at + 4 :]
    if kind == 2:
        return raw[:at] + rng.randbytes(rng.randrange(1, 99)) + raw[at:]
    if kind == 3:
        return raw[:at] + raw[at + rng.randrange(1, 99) :]
    near = rng.randrange(min(len(raw), 400))
    return raw[:near] + b"\xff\xff\xff\x7f" + raw[near + 4 :]


@pytest.mark.parametrize("seed", range(12))
def test_seeded_damage_is_refused_or_read(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    whole = [dataflash(6), NMEA, UBX, SOLUTION, TUM, EUROC, KITTI, SBET, CSV]
    whole += [made(tmp_path).read_bytes() for made in (las, laz, packets)]
    for raw in whole:
        path = tmp_path / "damaged"
        path.write_bytes(_damaged(raw, rng) or b"x")
        try:
            recording = open_recording(path)
            streams = recording.streams()
        except BadInput:
            continue
        for stream in streams:
            assert stream.stamps is None or len(stream.stamps.primary_ns) == stream.messages
        try:
            read = {
                s.name: [p.primary_ns.shape[0] for p in recording.samples(s.name)] for s in streams
            }
        except BadInput:  # of a column, which only samples look at
            continue
        assert {name: sum(rows) for name, rows in read.items()} == {
            s.name: s.messages for s in streams
        }
