"""When the points of a cloud were measured, against the cloud's stamp.

Drivers name and scale the time of a point differently: seconds or nanoseconds after the stamp, or
absolute seconds.  What is meant is told by type and size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.stream import PointTimes
from syncline_design.machine.quick_dataclass import dataclass

NAMES: Final = ("t", "time", "timestamp", "time_stamp", "offset_time", "timeOffset", "ts")
# PointField datatypes of sensor_msgs
TYPES: Final = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8", 9: "i8", 10: "u8",
}  # fmt: skip
LONGEST_SCAN_S: Final = 2.0
ABSOLUTE_S: Final = 1e6  # a figure above is a time of its own, not after the stamp
UNITS_S: Final = (1.0, 1e-3, 1e-6, 1e-9)
SHORTEST_S: Final = 1e-3  # of a scan in whole units, by which nanoseconds and microseconds differ


@dataclass(frozen=True, slots=True)
class CloudTimes:
    """First and last point of one cloud after its stamp [s]."""

    first_s: float
    last_s: float

    @staticmethod
    def median_of(clouds: Sequence[CloudTimes]) -> PointTimes:
        first, last = np.median([(c.first_s, c.last_s) for c in clouds], axis=0)
        return PointTimes(float(first), float(last), len(clouds))


def cloud_times(message: Any) -> CloudTimes | None:
    """Of a PointCloud2, a LaserScan or Livox's own message; None where points have no times."""
    try:
        return None if message is None else _times_of(message)
    except (AttributeError, TypeError, ValueError, IndexError, OverflowError):
        return None  # a type of that name with other fields


def _times_of(message: Any) -> CloudTimes | None:
    if hasattr(message, "point_step"):
        return _of_cloud(message)
    if hasattr(message, "time_increment"):
        last = float(message.time_increment) * max(len(message.ranges) - 1, 0)
        return CloudTimes(min(0.0, last), max(0.0, last)) if last else None
    if hasattr(message, "timebase"):
        stamp_s = _stamp_s(message)
        offsets = np.array([p.offset_time for p in message.points], dtype=float) * 1e-9
        begun = float(message.timebase) * 1e-9 - stamp_s
        if not offsets.shape[0] or abs(begun) > LONGEST_SCAN_S:
            return None
        return CloudTimes(begun + float(offsets.min()), begun + float(offsets.max()))
    return None


def _stamp_s(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _of_cloud(message: Any) -> CloudTimes | None:
    field = next((f for f in message.fields if f.name in NAMES and f.datatype in TYPES), None)
    count, step = int(message.width) * int(message.height), int(message.point_step)
    if field is None or step <= 0 or count <= 0:
        return None
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(order + TYPES[field.datatype])
    data = np.asarray(message.data, dtype=np.uint8)
    if data.shape[0] < count * step or int(field.offset) + kind.itemsize > step:
        return None
    table = data[: count * step].reshape(count, step)
    raw = table[:, int(field.offset) : int(field.offset) + kind.itemsize]
    values = np.ascontiguousarray(raw).view(kind)[:, 0]
    return _after_stamp(values, _stamp_s(message))


def _after_stamp(values: NDArray[Any], stamp_s: float) -> CloudTimes | None:
    """By size: the first unit in which all points lie within a scan's length of the stamp."""
    figures = values.astype(float)
    figures = figures[np.isfinite(figures)]
    if not figures.shape[0] or float(np.ptp(figures)) == 0.0:
        return None
    whole = values.dtype.kind != "f"
    units, least = (UNITS_S[::-1], SHORTEST_S) if whole else (UNITS_S, 1e-6)
    for unit in units:
        scaled = figures * unit
        low, high = float(scaled.min()), float(scaled.max())
        if abs(stamp_s) > ABSOLUTE_S and low > ABSOLUTE_S:
            low, high = low - stamp_s, high - stamp_s
        if max(abs(low), abs(high)) <= LONGEST_SCAN_S and high - low > least:
            return CloudTimes(low, high)
    return None
