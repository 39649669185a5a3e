"""A measured log in SI units and canonical frames: what the rest of the diagnosis works on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.frame_fit import Turns
from syncline_design.logs.stamps import usual_step_s
from syncline_design.machine.quick_dataclass import dataclass

GAP_FACTOR = 5.0  # rows further apart than this times the median interval are a gap
LogKind = Literal["georeference", "position", "pose"]
Rows = NDArray[np.signedinteger[Any]] | NDArray[np.bool_] | slice


@dataclass(frozen=True, slots=True)
class LogTrack:
    """Motion at its own, often higher rate: stamps (m,) [s] and vectors (m, 3)."""

    time_s: Array
    value: Array


@dataclass(frozen=True, slots=True)
class StageLog:
    """What one stage measured at every stamp.

    antenna_m (n, 3) NED, None from the second stage on; euler_rad (n, 3) roll, pitch, yaw;
    velocity_mps (n, 3) NED, reference point; rate_radps (n, 3) body; range_m, azimuth_rad,
    elevation_rad (n,), None in a position log.  velocity_track, rate_track: where the motion was
    logged at a rate of its own.  follows_position, follows_reference: the velocity was derived from
    antenna_m, from the better system's places.  velocity_of_reference: the better system logged it,
    of its own reference point and with its own stamps.  velocity_of_position, rate_of_attitude:
    these carry the stamps of the places, of the attitudes, and are as late.
    """

    name: str
    antenna_m: Array | None
    euler_rad: Array
    velocity_mps: Array
    rate_radps: Array
    range_m: Array | None = None
    azimuth_rad: Array | None = None
    elevation_rad: Array | None = None
    velocity_track: LogTrack | None = None
    rate_track: LogTrack | None = None
    follows_position: bool = False
    follows_reference: bool = False
    velocity_of_reference: bool = False
    velocity_of_position: bool = False
    rate_of_attitude: bool = False

    def rows(self, index: Rows) -> StageLog:
        """Some of the rows."""
        cut = {
            name: value[index]
            for name in ("antenna_m", "range_m", "azimuth_rad", "elevation_rad")
            if (value := getattr(self, name)) is not None
        }
        return replace(
            self,
            euler_rad=self.euler_rad[index],
            velocity_mps=self.velocity_mps[index],
            rate_radps=self.rate_radps[index],
            **cut,
        )


@dataclass(frozen=True, slots=True)
class Log:
    """A log, rows in rising time; rows of several targets may share a stamp.

    truth_m (n, 3) NED: surveyed target (georeference), the better system's reference point
    (position), or a point at a lever on its body (pose), which the tested pose has to meet: range
    and bearing are that lever's, exact; NaN components are not known and count for nothing.
    rejected: rows dropped, by reason.  notes: what was derived or cut, for people.
    rows_read: before any was dropped.
    thinned: rows of a very long log that are not in the windows kept of it.
    laid: the turns (beside a shift) by which the truth was laid onto what was measured, where
    nothing relates their frames: what is constant between the two is then no witness of anything.
    since_s: what the stamps count from [s since 1970] where they were calendar times, else 0.
    level: columns that a 2-D log leaves out, taken as zero.  hidden_down_m: (n,) how far down its
    targets are told to be, where that is not compared.
    """

    kind: LogKind
    time_s: Array
    stages: tuple[StageLog, ...]
    truth_m: Array
    target_id: Array | None
    rows_read: int
    rejected: Mapping[str, int]
    notes: tuple[str, ...] = ()
    thinned: int = 0
    laid: Turns | None = None
    since_s: float = 0.0
    level: tuple[str, ...] = ()
    hidden_down_m: Array | None = None

    def __len__(self) -> int:
        return int(self.time_s.shape[0])

    def rows(self, index: Rows) -> Log:
        """Some of the rows."""
        return replace(
            self,
            time_s=self.time_s[index],
            stages=tuple(stage.rows(index) for stage in self.stages),
            truth_m=self.truth_m[index],
            target_id=None if self.target_id is None else self.target_id[index],
            hidden_down_m=None if self.hidden_down_m is None else self.hidden_down_m[index],
        )

    @property
    def interval_s(self) -> float:
        """Median time between stamps [s]."""
        return usual_step_s(self.time_s)

    @property
    def ends_s(self) -> tuple[float, float]:
        """Stamps of the first and the last row [s]."""
        return float(self.time_s[0]), float(self.time_s[-1])

    @property
    def duration_s(self) -> float:
        """First to last row [s]."""
        return float(self.time_s[-1] - self.time_s[0])
