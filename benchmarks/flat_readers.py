"""Time and memory of the readers of flat formats on long logs: `python benchmarks/flat_readers.py`.

Each log is the simulated flight of the tests, repeated to about MEGABYTES; each is read in a
process of its own, once for its stamps (`streams`) and once more for what one stream measured
(`samples`).  Beside it, where the format has a library that reads it whole, that library's own pass
over the same file.  Seconds are of the processor; memory is the peak with all libraries loaded.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

MEGABYTES = 100
FORMATS = ("dataflash", "nmea", "ubx", "pos", "tum", "sbet", "las", "laz", "pcap", "csv")
STREAMS = {"dataflash": "GPS", "nmea": "fix", "ubx": "NAV-PVT", "pcap": "udp 7502 lidar"}


def repeated(path: Path, megabytes: int, head: int = 0) -> Path:
    """The file with all behind its head once and again."""
    raw = path.read_bytes()
    body = raw[head:]
    with path.open("wb") as file:
        file.write(raw[:head])
        for _ in range(max(1, round(megabytes * 1e6 / len(body)))):
            file.write(body)
    return path


def make(name: str, folder: Path, megabytes: int) -> Path:
    """A log of about this size."""
    import numpy as np

    from tests import flat_flight_logs as made
    from tests.flight_logs import flight
    from tests.test_log_clouds import capture, cloud, legacy, udp

    path = folder / f"flight.{name}"
    if name in ("las", "laz"):
        points = round(megabytes * 1e6 / 30)
        return cloud(path, np.sort(np.random.default_rng(1).uniform(0, 6e5, points)))
    if name == "pcap":
        frames = [
            (Decimal(k), udp(legacy(10**9 + k, 97_656, 9, 16 * (k % 64)), 7502)) for k in range(200)
        ]
        return repeated(capture(path, frames), megabytes, 24)
    flown = flight(60.0)
    if name == "dataflash":
        made.write_dataflash(path, flown, flown)
        return repeated(path, megabytes, 4 * 89)
    writers: dict[str, Callable[..., Path]] = {
        "nmea": made.write_nmea, "ubx": made.write_ubx, "pos": made.write_pos,
        "tum": made.write_tum, "sbet": made.write_sbet, "csv": made.write_german_csv,
    }  # fmt: skip
    writers[name](path, flown)
    heads = {"pos": 2, "tum": 1, "csv": 2}
    raw = path.read_bytes()
    head = sum(len(line) for line in raw.splitlines(keepends=True)[: heads.get(name, 0)])
    return repeated(path, megabytes, head)


def read(path: Path, what: str) -> tuple[int, float]:
    """Messages and seconds of one pass."""
    from syncline_design.logs.readers import open_recording

    start = time.process_time()
    recording = open_recording(path)
    name = path.suffix[1:]
    if what == "streams":
        messages = sum(stream.messages for stream in recording.streams())
    else:
        wanted = STREAMS.get(name, "flight")
        messages = sum(piece.primary_ns.shape[0] for piece in recording.samples(wanted))
    return messages, time.process_time() - start


def library(path: Path) -> tuple[int, float] | None:
    """The same by the format's own library, where there is one that reads all of it."""
    name, start, count = path.suffix[1:], time.process_time(), 0
    if name == "dataflash":
        from pymavlink.DFReader import DFReader_binary

        reader = DFReader_binary(str(path))
        while reader.recv_msg() is not None:
            count += 1
    elif name in ("nmea", "ubx"):
        from pyubx2 import UBXReader

        with path.open("rb") as file:
            count = sum(1 for _ in UBXReader(file, protfilter=3))
    elif name in ("las", "laz"):
        import laspy

        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
            count = sum(len(points) for points in reader.chunk_iterator(50_000))
    elif name == "pcap":
        import dpkt

        with path.open("rb") as file:
            for _, frame in dpkt.pcap.Reader(file):
                count += len(dpkt.ethernet.Ethernet(frame).data.data.data) > 0
    else:
        return None
    return count, time.process_time() - start


def one(path: Path, what: str) -> None:
    """In a process of its own: messages, seconds, peak memory [MB]."""
    found = library(path) if what == "library" else read(path, what)
    status = Path("/proc/self/status").read_text()  # of this process alone, not of what made it
    peak = float(status.partition("VmHWM:")[2].split()[0]) / 1024
    print(*((f"{found[0]} {found[1]:.2f}" if found else "- -"), f"{peak:.0f}"))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("formats", nargs="*", default=list(FORMATS))
    parser.add_argument("--megabytes", type=int, default=MEGABYTES)
    parser.add_argument("--one", nargs=2)
    options = parser.parse_args()
    if options.one:
        one(Path(options.one[0]), options.one[1])
        return
    print("| format | MB | messages | stamps [s] | MB held | samples [s] | MB held | library [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.formats:
        with tempfile.TemporaryDirectory() as folder:
            path = make(name, Path(folder), options.megabytes)
            rows = [
                subprocess.run(
                    [sys.executable, __file__, "--one", str(path), what],
                    capture_output=True, text=True, check=True,
                ).stdout.split()
                for what in ("streams", "samples", "library")
            ]  # fmt: skip
            size = path.stat().st_size / 1e6
            cells = [name, f"{size:.0f}", rows[0][0], *rows[0][1:], *rows[1][1:], rows[2][1]]
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
