"""What the message kinds of ArduPilot measure, in the names of the contract.

Heights of GPS, POS, AHR2 and SIM are above mean sea level; velocities and local positions are
north, east, down; attitude is roll, pitch, yaw of a body forward, right, down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.epochs import GPS_EPOCH_S, NANO, WEEK_S, gps_to_utc
from syncline_design.logs.readers.stream import Frame, Nature
from syncline_design.machine.quick_dataclass import dataclass

Values = Mapping[str, NDArray[Any]]
Made = dict[str, NDArray[Any]]

# units as UNIT messages name them -> suffix of a column
LABELS = {
    **{"m": "m", "cm": "cm", "mm": "mm", "deg": "deg", "rad": "rad", "m/s": "mps", "s": "s"},
    **{"deg/s": "degps", "rad/s": "radps", "ms": "ms", "us": "us", "\xb5s": "us", "Pa": "Pa"},
    **{"degheading": "deg", "deglatitude": "deg", "deglongitude": "deg", "m/s/s": "mps2"},
    **{"cm/s": "cmps", "degC": "degC", "V": "V", "A": "A", "Hz": "hz"},
}
FUSED = (
    "fused by the autopilot with its GNSS: no independent reference for these positions, nor they "
    "for it"
)
SEA_LEVEL = "height above mean sea level; the log does not say by how much the ellipsoid differs"
ARRIVAL = "TimeUS is when the autopilot logged the fix; the receiver's own time is clock_gps_ns"


@dataclass(frozen=True, slots=True)
class KindMeaning:
    """Quantities of a kind, its frame, which fields became columns, and how."""

    quantity: tuple[str, ...] = ()
    frame: Frame = "unknown"
    body: bool = False
    notes: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    made: Callable[[Values], Made] | None = None
    taken: frozenset[str] = frozenset()
    nature: Nature = "unknown"

    def columns(self, values: Values) -> Made:
        own = {new: values[old].astype(float) for old, new in self.renamed.items()}
        return own if self.made is None else {**own, **self.made(values)}


PLACE = {"Lat": "latitude_deg", "Lng": "longitude_deg", "Alt": "height_msl_m"}
TURN = {"Roll": "roll_deg", "Pitch": "pitch_deg", "Yaw": "yaw_deg"}
SPEED = {
    "VN": "velocity_north_mps",
    "VE": "velocity_east_mps",
    "VD": "velocity_down_mps",
}
LOCAL = {"PN": "position_x_m", "PE": "position_y_m", "PD": "position_z_m"}
GYRO = {f"Gyr{a}": f"rate_{a.lower()}_radps" for a in "XYZ"}
ACCEL = {f"Acc{a}": f"acceleration_{a.lower()}_mps2" for a in "XYZ"}
QUANTITIES: tuple[tuple[str, Mapping[str, str]], ...] = (
    ("position", PLACE),
    ("attitude", TURN),
    ("velocity", SPEED),
    ("position", LOCAL),
    ("rate", GYRO),
    ("acceleration", ACCEL),
)
# kinds (without a number at their end) -> what to say of them
KINDS: dict[str, tuple[str, ...]] = {
    "GPS": (SEA_LEVEL, ARRIVAL),
    "POS": (FUSED, SEA_LEVEL),
    "AHR": (FUSED, SEA_LEVEL),
    "NKF": (FUSED, "local positions count from the filter's own origin (ORGN)"),
    "XKF": (FUSED, "local positions count from the filter's own origin (ORGN)"),
    "SIM": ("the truth of a simulation", SEA_LEVEL),
    "ATT": (),
    "IMU": (),
    "RFND": (),
}
NATURES: dict[str, Nature] = {
    **dict.fromkeys(("POS", "AHR", "NKF", "XKF", "ATT"), "fused"),
    "SIM": "truth",
}
NOT_THESE = frozenset({"NKF2", "NKF3", "NKF4", "NKF5", "NKF7", "NKF8", "NKF9"})


def meaning_of(name: str, fields: tuple[str, ...]) -> KindMeaning:
    """What a kind measures, told by its name and the fields that it has."""
    notes = KINDS.get(name.rstrip("0123456789"))
    if notes is None or name in NOT_THESE:
        return KindMeaning()
    here = set(fields)
    found = [(what, names) for what, names in QUANTITIES if set(names) <= here]
    renamed = {old: new for _, names in found for old, new in names.items()}
    quantity = [what for what, _ in found]
    made: Callable[[Values], Made] | None = None
    if name.startswith("GPS") and {"Spd", "GCrs", "VZ"} <= here:
        made = _ground_velocity
        quantity.append("velocity")
        here_taken = {"Spd", "GCrs", "VZ"}
    else:
        here_taken = set()
    if name.startswith("RFND"):
        first = next((f for f in ("Dist", "Dist1") if f in here), None)
        if first is not None:
            renamed[first] = "range_m"
            quantity.append("ranging")
    if {"GWk", "GMS"} <= here:
        quantity.append("clock")
    if not quantity:
        return KindMeaning()
    frame: Frame = "wgs84" if PLACE.keys() <= here else "ned"
    shown = tuple(n for n in notes if "clock_gps_ns" not in n or "GMS" in here)
    return KindMeaning(
        tuple(dict.fromkeys(quantity)),
        frame if quantity != ["ranging"] else "unknown",
        bool({"attitude", "rate", "acceleration"} & set(quantity)),
        shown,
        renamed,
        made,
        frozenset(renamed) | here_taken,
        NATURES.get(name.rstrip("0123456789"), "measured"),
    )


def _ground_velocity(values: Values) -> Made:
    """North and east from speed over ground [m/s] and course [deg]; VZ is down [m/s]."""
    speed = values["Spd"].astype(float)
    course = np.radians(values["GCrs"].astype(float))
    return {
        "velocity_north_mps": speed * np.cos(course),
        "velocity_east_mps": speed * np.sin(course),
        "velocity_down_mps": values["VZ"].astype(float),
    }


def gps_clocks(week: NDArray[Any], milliseconds: NDArray[Any]) -> Made:
    """The receiver's own time as `gps` and as `utc` count; 0 where it has no week yet."""
    seconds = GPS_EPOCH_S + week.astype(np.int64) * WEEK_S
    gps = np.where(week > 0, seconds * NANO + milliseconds.astype(np.int64) * 1_000_000, 0)
    return {"clock_gps_ns": gps, "clock_utc_ns": np.where(gps > 0, gps_to_utc(gps), 0)}
