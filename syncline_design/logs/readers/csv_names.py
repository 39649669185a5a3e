"""Names of CSV columns to the contract's: `Latitude (deg)` is latitude_deg, `East Velocity (m/s)`
velocity_east_mps.  Units may stand behind the name in any way people write them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from syncline_design.logs.columns import ISO_TIMES
from syncline_design.logs.readers.stream import Frame
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import si_name, suffix_unit
from syncline_design.model.unit_table import DEG, SPELLINGS, SUFFIXES

UNIT = re.compile(r"^(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]$")
WRITTEN = {unit: suffix for suffix, unit in SUFFIXES.items()} | {"m/s2": "_mps2", "m/s^2": "_mps2"}
TIME_UNITS = ("s", "ms", "us", "ns")
STAMP, RECEIVE = "stamp", "receive"
TIMES = (STAMP, "time", "timestamp", "t", "time_utc", "utc", "time_gps", "gps_time", "time_boot")
WEEK = ("gps_week", "week")
TOW = ("gps_tow", "tow", "gps_time_of_week", "time_of_week")

# name with its SI suffix -> the contract's name, and the sign between the two
SAME: dict[str, tuple[str, float]] = {
    **dict.fromkeys(("latitude_rad", "lat_rad"), ("latitude_rad", 1.0)),
    **dict.fromkeys(("longitude_rad", "lon_rad", "lng_rad"), ("longitude_rad", 1.0)),
    **dict.fromkeys(("height_m", "ellipsoid_height_m", "ellipsoidal_height_m"), ("height_m", 1.0)),
    **dict.fromkeys(("height_msl_m", "altitude_msl_m", "msl_m"), ("height_msl_m", 1.0)),
    **{f"position_{a}_m": (f"position_{b}_m", 1.0) for a, b in (("north", "x"), ("east", "y"))},
    "position_down_m": ("position_z_m", 1.0),
    **{f"position_{a}_m": (f"position_{a}_m", 1.0) for a in "xyz"},
    **{f"velocity_{a}_mps": (f"velocity_{a}_mps", 1.0) for a in ("north", "east", "down")},
    **{f"{a}_velocity_mps": (f"velocity_{a}_mps", 1.0) for a in ("north", "east", "down")},
    **dict.fromkeys(("up_velocity_mps", "velocity_up_mps"), ("velocity_down_mps", -1.0)),
    **{f"{n}_rad": (f"{n}_rad", 1.0) for n in ("roll", "pitch", "yaw", "heading")},
    **{f"quaternion_{a}": (f"quaternion_{a}", 1.0) for a in "wxyz"},
    **{f"rate_{a}_radps": (f"rate_{a}_radps", 1.0) for a in "xyz"},
    **{f"acceleration_{a}_mps2": (f"acceleration_{a}_mps2", 1.0) for a in "xyz"},
    **{n: (n, 1.0) for n in ("range_m", "azimuth_rad", "elevation_rad")},
    **{f"target_{a}_m": (f"target_{a}_m", 1.0) for a in ("north", "east", "down", "height")},
    **{f"target_{a}_rad": (f"target_{a}_rad", 1.0) for a in ("latitude", "longitude")},
}
NED = frozenset(f"position_{a}_m" for a in ("north", "east", "down"))
QUANTITIES: tuple[tuple[str, tuple[frozenset[str], ...]], ...] = (
    ("position", (frozenset({"latitude_deg", "longitude_deg"}),)),
    ("position", (frozenset({"position_x_m", "position_y_m"}),)),
    ("attitude", (frozenset({"roll_deg", "pitch_deg"}), frozenset({"heading_deg"}))),
    ("attitude", (frozenset(f"quaternion_{a}" for a in "wxyz"),)),
    ("velocity", (frozenset({"velocity_north_mps", "velocity_east_mps"}),)),
    ("rate", (frozenset(f"rate_{a}_radps" for a in "xyz"),)),
    ("acceleration", (frozenset(f"acceleration_{a}_mps2" for a in "xyz"),)),
    ("ranging", (frozenset({"range_m"}),)),
    ("target", (frozenset({"target_north_m", "target_east_m"}),)),
    ("target", (frozenset({"target_latitude_deg", "target_longitude_deg"}),)),
)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of figures: its place in the file, the contract's name, and the factor to it."""

    place: int
    name: str
    factor: float
    known: bool  # so that it has to hold figures


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """A column of times; unit empty where they are calendar times."""

    place: int
    name: str
    unit: str


@dataclass(frozen=True, slots=True)
class Layout:
    """What the columns of a file are."""

    primary: TimeColumn | None
    secondary: TimeColumn | None
    week: int | None
    columns: tuple[Column, ...]
    quantity: tuple[str, ...]
    frame: Frame


def plain_name(name: str) -> str:
    """`East Velocity (m/s)` as `east_velocity_mps`; a unit that is not known stays in the name."""
    found = UNIT.match(name.strip())
    stem, unit = (found[1], found[2]) if found else (name, "")
    unit = SPELLINGS.get(unit, SPELLINGS.get(unit.lower(), unit))
    suffix = WRITTEN.get(unit, f"_{unit}" if unit else "")
    plain = re.sub(r"[^0-9a-zA-Z_]+", "_", stem.strip()).strip("_").lower()
    plain = re.sub(r"_+", "_", plain)
    return plain if plain.endswith(suffix) else plain + re.sub(r"[^0-9a-zA-Z_]+", "_", suffix)


def time_columns(header: Sequence[str], stem: str) -> list[TimeColumn]:
    """Columns named `STEM_<unit>`, or `STEM` alone."""
    found = []
    for place, name in enumerate(header):
        plain = plain_name(name)
        base, _, unit = plain.rpartition("_")
        if base == stem and unit in TIME_UNITS:
            found.append(TimeColumn(place, name, unit))
        elif plain == stem:
            found.append(TimeColumn(place, name, ""))
    return found


def layout_of(header: Sequence[str]) -> Layout:
    """Times and columns of a file by its header."""
    primary, secondary, week = _times(header)
    used = {c.place for c in (primary, secondary) if c is not None} | {week}
    columns = _columns(header, used)
    names = {column.name.replace("_rad", "_deg").replace("_degps", "_radps") for column in columns}
    quantity = [what for what, some in QUANTITIES if any(set(one) <= names for one in some)]
    plain = {plain_name(name) for name in header}
    frame: Frame = "unknown"
    if {"latitude_deg", "longitude_deg"} <= names:
        frame = "wgs84"
    elif any(si_name(name) in NED for name in plain):
        frame = "ned"
    if "position" not in quantity and {"velocity", "attitude"} & set(quantity):
        frame = "ned"
    return Layout(primary, secondary, week, columns, tuple(dict.fromkeys(quantity)), frame)


def _times(
    header: Sequence[str],
) -> tuple[TimeColumn | None, TimeColumn | None, int | None]:
    """Stamp and receipt, or the one time of a file; and where its GPS week is."""
    secondary = next(iter(time_columns(header, RECEIVE)), None)
    stems = (*TIMES, *TOW, *ISO_TIMES)
    primary = next((c for stem in stems for c in time_columns(header, stem)), None)
    if primary is None:  # only when it arrived is known
        return secondary, None, None
    plain = [plain_name(name) for name in header]
    week = next((plain.index(name) for name in WEEK if name in plain), None)
    of_week = any(c.place == primary.place for stem in TOW for c in time_columns(header, stem))
    return primary, secondary, week if of_week else None


def _columns(header: Sequence[str], used: set[int | None]) -> tuple[Column, ...]:
    """Columns that are no times; a name that comes twice keeps its own."""
    found: list[Column] = []
    taken: set[str] = set()
    si = {si_name(plain_name(name)) for name in header}
    turns = {"roll_rad", "pitch_rad"} <= si and "yaw_rad" not in si
    for place, name in enumerate(header):
        if place in used or not name.strip():
            continue
        plain = plain_name(name)
        theirs = SAME.get(si_name(plain))
        own, factor = (plain, 1.0) if theirs is None else (theirs[0], suffix_unit(plain)[0])
        if theirs is not None:
            factor *= theirs[1]
            if plain.endswith("_deg"):  # angles stay in degrees where the file has them
                own, factor = own.replace("_rad", "_deg"), theirs[1]
            elif own.endswith(("latitude_rad", "longitude_rad")):
                own, factor = own.replace("_rad", "_deg"), factor / float(DEG)
        if own.startswith("heading_") and turns:
            own = own.replace("heading", "yaw")
        if own not in taken:
            taken.add(own)
            found.append(Column(place, own, factor, theirs is not None))
    return tuple(found)
