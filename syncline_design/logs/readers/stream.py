"""What a reader of logs gives: streams with their stamps as the file says them, samples in pieces.

A reader mends nothing.  Stamps are whole nanoseconds in the order of the file; columns of samples
carry their unit in their names, in the frame that the stream names:

position       latitude_deg, longitude_deg, height_m (above the ellipsoid) or height_msl_m with
               separation_m where the file knows it; position_{x,y,z}_m in the stream's frame (of
               enu and utm x is east and z up, of ned x is north and z down)
attitude       quaternion_{w,x,y,z}: turns a vector of the body into the stream's frame; or
               roll_deg, pitch_deg, yaw_deg (yaw, then pitch, then roll; yaw from true north,
               clockwise, of a body forward, right, down), each also as _rad; heading_deg alone
velocity       velocity_{north,east,down}_mps, else velocity_{x,y,z}_mps in the stream's frame, or
               velocity_body_{x,y,z}_mps in its body
rate           rate_{x,y,z}_radps (or _degps) of the body against inertial space
acceleration   acceleration_{x,y,z}_mps2 of the body
ranging        range_m, azimuth_deg, elevation_deg (or _rad) of the sensor, target_id
target         target_{north,east,down}_m, or target_latitude_deg, target_longitude_deg,
               target_height_m, target_id
points         point_{x,y,z}_m of a cloud, in the stream's frame
clock          one more time of the message, as NAME_ns

Other columns (quality, week, ...) have names of their own, unit last.

From where the stamps of a timeline count is said in `epochs.py`: those of `utc`, `gps` and `tai` as
their calendars read since 1970.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from syncline_design.machine.quick_dataclass import dataclass

Timeline = Literal["utc", "gps", "tai", "boot", "unknown"]
Frame = Literal["wgs84", "enu", "ned", "utm", "unknown"]
Body = Literal["flu", "frd", "unknown"]  # forward, left, up; forward, right, down
# one sensor's own; an estimate from several, so no reference for them; the truth of a simulation
Nature = Literal["measured", "fused", "truth", "unknown"]

Nanoseconds = NDArray[np.int64]
UNSET = int(np.iinfo(np.int64).min)  # a message without the stamp that its stream has otherwise


@dataclass(frozen=True, slots=True, eq=False)
class Stamps:
    """The times of every message of a stream [ns], in the order of the file.

    primary: what the message says of itself (`header.stamp`), or the recorder's time where it says
    nothing.  secondary: when it arrived (`log time`), None where the file tells one time only.
    primary_factor: the file's figures, in the unit that it names, are so many times primary_ns;
    not 1 where 64 bits of nanoseconds do not hold them (milliseconds since 1970 as seconds).
    """

    primary: str
    secondary: str | None
    primary_ns: Nanoseconds
    secondary_ns: Nanoseconds | None = None
    primary_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class PointTimes:
    """When the points of a cloud were measured, against its stamp [s]: medians of some clouds."""

    first_s: float
    last_s: float
    clouds: int


@dataclass(frozen=True, slots=True)
class StaticPose:
    """A frame that stands still in another: its place [m] and axes (x, y, z, w) there, forward,
    left, up."""

    child: str
    parent: str
    place_m: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """One topic, message kind or file; all that is known without looking at what it measures.

    name: as the file calls it.  quantity: of the list above, what `samples` tells.  stamps: None
    where the format has no times.  partial: cut or damaged, so that messages are missing.  columns:
    of `samples`.  notes: for people, what is peculiar, among them every conversion of the reader.
    """

    name: str
    quantity: tuple[str, ...]
    messages: int
    stamps: Stamps | None
    frame: Frame = "unknown"
    timeline: Timeline = "unknown"
    partial: bool = False
    notes: tuple[str, ...] = ()
    body: Body = "unknown"
    kind: str = ""  # what the format calls it: `sensor_msgs/msg/Imu`
    columns: tuple[str, ...] = ()
    points: PointTimes | None = None
    static: tuple[StaticPose, ...] = ()  # what its first message says of the vehicle's frames
    nature: Nature = "unknown"
    unread: str = ""  # why its messages cannot be read, only counted

    @property
    def has_attitude(self) -> bool:
        return "attitude" in self.quantity


@dataclass(frozen=True, slots=True)
class Incomplete:
    """Why a file could not be read to its end, and how many messages came before."""

    reason: str
    messages: int


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Some consecutive messages of a stream; several rows of one message share its stamps."""

    primary_ns: Nanoseconds
    secondary_ns: Nanoseconds | None
    columns: Mapping[str, NDArray[Any]]


class Recording(Protocol):
    """An opened file.  Opening refuses what is no file of the format (`refusals.refuse`)."""

    path: Path
    format: str  # for people: `ROS 1 bag`

    def streams(self) -> tuple[Stream, ...]:
        """Every stream, sorted by name, in one pass: 16 bytes a message are held, and no more."""
        ...

    @property
    def incomplete(self) -> Incomplete | None:
        """Where reading ended early; known after `streams`."""
        ...

    def samples(self, name: str) -> Iterator[Piece]:
        """What a stream measured, in pieces of bounded size."""
        ...


class StampColumn:
    """A growing column of nanoseconds, 8 bytes each."""

    def __init__(self) -> None:
        self._held = array("q")

    def __len__(self) -> int:
        return len(self._held)

    def append(self, nanoseconds: int) -> None:
        """Add one; what 64 bits do not hold is `UNSET`."""
        self._held.append(nanoseconds if -(2**63) <= nanoseconds < 2**63 else UNSET)

    def extend(self, nanoseconds: Nanoseconds) -> None:
        self._held.frombytes(np.ascontiguousarray(nanoseconds, dtype=np.int64).tobytes())

    def values(self) -> Nanoseconds:
        """All of them, read only."""
        values: Nanoseconds = np.frombuffer(self._held.tobytes(), dtype=np.int64)
        return values
