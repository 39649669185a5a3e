"""What a LAS header claims, checked before a library believes it.

LAS 1.4 R15 (ASPRS), public header block: offsets as of version 1.0 to 1.4.
"""

from __future__ import annotations

import struct
from pathlib import Path

from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

MAGIC = b"LASF"
HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}  # by minor version, least
TIMED = frozenset({1, 3, 4, 5, 6, 7, 8, 9, 10})  # point formats with GPS time
LEAST_RECORD = {
    **{0: 20, 1: 28, 2: 26, 3: 34, 4: 57, 5: 63},
    **{6: 30, 7: 36, 8: 38, 9: 59, 10: 67},
}
VLR_HEAD = 54
COMPRESSED = 0x80  # bit of the point format that LAZ sets
COPC = 0x40
RATIO, FREE_BYTES = 200, 1 << 30  # points may unpack to so many times the file, and this much


@dataclass(frozen=True, slots=True)
class LasClaims:
    """What matters of a header: sizes, the kind of times, whether points are packed."""

    version: str
    point_format: int
    record: int  # bytes of a point
    points: int
    offset: int  # of the first point
    standard_time: bool  # global encoding bit 0: adjusted standard GPS time
    packed: bool


def claims_of(path: Path, start: bytes, size: int) -> LasClaims:
    """Read and check; refuses what no file of this size can hold."""
    major, minor = start[24], start[25]
    least = HEADER_BYTES.get(minor, 0) if major == 1 else 0
    if not least:
        raise refuse(path, "LAS of a version that is not known", found=f"{major}.{minor}")
    if len(start) < least:
        raise refuse(path, "the LAS header is cut", expected=f"{least} bytes", found=str(size))
    (encoding,) = struct.unpack_from("<H", start, 6)
    head, offset, vlrs, kind, record, points = struct.unpack_from("<HIIBHI", start, 94)
    if minor == 4:
        (wide,) = struct.unpack_from("<Q", start, 247)
        points = wide or points
    packed, form = bool(kind & COMPRESSED), kind & ~(COMPRESSED | COPC)
    if form not in LEAST_RECORD:
        raise refuse(path, "a point format that is not known", found=str(form))
    faults = (
        (head < least, "header size", f"at least {least}", head),
        (offset > size or offset < head, "offset to points", f"{head} to {size}", offset),
        (vlrs * VLR_HEAD > max(offset - head, 0), "number of records", "what the file holds", vlrs),
        (record < LEAST_RECORD[form], "length of a point", f"{LEAST_RECORD[form]} or more", record),
    )
    for wrong, what, expected, found in faults:
        if wrong:
            message = f"the LAS header's {what} cannot be"
            raise refuse(path, message, expected=expected, found=str(found))
    _demand_fitting_records(path, head, vlrs, offset)
    if packed and points * record > FREE_BYTES + RATIO * size:
        most = f"{RATIO} times the file's size and 1 GiB"
        raise refuse(
            path, "unpacks to too much", expected=f"at most {most}", found=f"{points} points"
        )
    timed = bool(encoding & 1)
    return LasClaims(f"{major}.{minor}", form, record, points, offset, timed, packed)


def _demand_fitting_records(path: Path, at: int, count: int, end: int) -> None:
    """Variable length records one behind the other, each within the bytes that are there.

    Those behind the points are not read: a file that was cut has lost them first.
    """
    with path.open("rb") as file:
        for number in range(count):
            file.seek(at)
            raw = file.read(VLR_HEAD)
            length = struct.unpack_from("<H", raw, 20)[0] if len(raw) == VLR_HEAD else end
            at += VLR_HEAD + length
            if at > end:
                raise refuse(
                    path,
                    f"record {number + 1} of the LAS header goes past its end",
                    expected=f"at most {end} bytes",
                    found=f"{length} bytes",
                )
