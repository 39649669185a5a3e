"""Pulses and messages of receivers against the clock: gpsd's JSON (PPS, TOFF) and ppstest.

gpsd gives the clock's reading and the true time of the same instant; ppstest the clock's reading
of a pulse, which comes at a whole second.
"""

from __future__ import annotations

import json
import re
from typing import Final

from syncline_design.clocks.series import Row, SourceKind

_PPSTEST: Final = re.compile(
    r"source (\d+) - (assert|clear)\s+(\d{9,10}\.\d{1,12}), sequence:\s*(\d+)"
)


def gpsd_row(line: str) -> tuple[SourceKind, Row, str] | None:
    """A PPS or TOFF object of gpsd: clock minus real time."""
    if '"PPS"' not in line and '"TOFF"' not in line:
        return None
    try:
        found = json.loads(line)
        kind, device = found["class"], str(found.get("device", ""))
        whole = int(found["clock_sec"]) - int(found["real_sec"])
        offset = whole + 1e-9 * (int(found["clock_nsec"]) - int(found["real_nsec"]))
        time_s = int(found["real_sec"]) + 1e-9 * int(found["real_nsec"])
    except (ValueError, KeyError, TypeError, RecursionError, AttributeError, OverflowError):
        return None
    if kind not in ("PPS", "TOFF"):
        return None
    rank = 1 if kind == "PPS" else 9
    source = SourceKind(f"gpsd {kind} {device}".strip(), "gpsd", rank, "unknown", "utc", kind)
    return source, Row(time_s, offset), ""


def ppstest_row(line: str) -> tuple[SourceKind, Row, str] | None:
    """`source 0 - assert 1187869512.999943123, sequence: 364 - ...`: 57 us early."""
    found = _PPSTEST.search(line)
    if found is None or int(found[4]) == 0:
        return None
    whole, _, part = found[3].partition(".")
    fraction = int(part.ljust(12, "0")) * 1e-12
    offset = fraction if fraction <= 0.5 else -(10**12 - int(part.ljust(12, "0"))) * 1e-12
    source = SourceKind(f"ppstest source {found[1]} {found[2]}", "ppstest",
                        1 if found[2] == "assert" else 2, "unknown", "utc")  # fmt: skip
    return source, Row(int(whole) + fraction, offset), ""
