"""Column names to SI: `roll_deg` and `range_mm` are what `roll_rad` and `range_m` stand for."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping

from syncline_design.model.quantity import UNITS, si_name, suffix_unit
from syncline_design.spec.spec import split_column

NED = ("north", "east", "down")
TIME = "time_s"
ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
RANGING = ("range_m", "azimuth_rad", "elevation_rad")
POSITION = tuple(f"position_{axis}_m" for axis in NED)
VELOCITY = tuple(f"velocity_{axis}_mps" for axis in NED)
RATE = tuple(f"rate_{axis}_radps" for axis in "xyz")
TARGET = tuple(f"target_{axis}_m" for axis in NED)
REFERENCE = tuple(f"reference_{axis}_m" for axis in NED)
REFERENCE_ATTITUDE = tuple(f"reference_{name}" for name in ATTITUDE)
GEODETIC = ("latitude_rad", "longitude_rad", "height_m")
PER_STAGE = (*POSITION, *ATTITUDE, *VELOCITY, *RATE, *RANGING, *GEODETIC)
COMMON = (
    TIME,
    *TARGET,
    *REFERENCE,
    *REFERENCE_ATTITUDE,
    *(f"{p}_{g}" for p in ("target", "reference") for g in GEODETIC),
)
TARGET_ID = "target_id"
ISO_TIMES = ("time", "time_utc", "time_iso")  # columns of ISO 8601 times; no unit in the name
HEADING, YAW = "heading_rad", "yaw_rad"


def known_names(stages: Iterable[str]) -> frozenset[str]:
    """Every SI column name that a log of these stages may hold."""
    names = [*COMMON, TARGET_ID, *PER_STAGE, HEADING]
    names += [f"{stage}_{name}" for stage in stages for name in (*PER_STAGE, HEADING)]
    return frozenset(names)


def si_columns(
    present: Iterable[str], mapping: Mapping[str, str], wanted: frozenset[str]
) -> dict[str, tuple[str, float]]:
    """SI name -> (column of the file, factor to SI) for everything the diagnosis can use.

    A name of the mapping wins over the column's own; `their.name [unit]` brings its own unit,
    whether or not the file's own name ends in it, and without brackets the canonical name's suffix
    is the unit.  The factor is NaN for a time column whose name has no unit.  A heading is a yaw.
    """
    names = dict.fromkeys(present)
    found: dict[str, tuple[str, float]] = {}
    for name in names:
        si = TARGET_ID if name == TARGET_ID else si_name(name)
        if si in wanted and si not in found:
            found[si] = (name, 1.0 if name == TARGET_ID else suffix_unit(name)[0])
    for canonical, theirs in mapping.items():
        column, unit = named_column(theirs, names)
        if column in names:
            factor = float(UNITS[unit][1]) if unit else suffix_unit(canonical)[0]
            found[si_name(canonical)] = (column, factor)
    for name in ISO_TIMES:
        own = found.pop(name, (name, math.nan) if name in names else None)
        if own is not None and TIME not in found:
            found[TIME] = (own[0], math.nan)
    for si in [s for s in found if s.endswith(HEADING)]:
        heading = found.pop(si)
        found.setdefault(si.removesuffix(HEADING) + YAW, heading)
    return found


def named_column(theirs: str, present: Container[str]) -> tuple[str, str]:
    """The column that a mapping means, and the unit it brings (empty: none)."""
    column, unit = split_column(theirs)
    return (theirs if theirs in present else column), unit


def passed_over(
    header: Iterable[str], found: Mapping[str, tuple[str, float]], mapping: Mapping[str, str]
) -> tuple[str, ...]:
    """What to say of columns that give what another one is read for: `yaw_rad` beside `yaw_deg`."""
    return tuple(
        f"{name} was not read, as {found[si][0]} is there too"
        for name, si in rivals(header, found, mapping)
    )


def rivals(
    header: Iterable[str], found: Mapping[str, tuple[str, float]], mapping: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """(column, SI name) of columns that give what another one is read for.

    A column that the spec maps is meant, and has none.
    """
    meant = {_as_found(name) for name in mapping}
    named = [(name, _as_found(name)) for name in header]
    return tuple(
        (name, si) for name, si in named if si in found and found[si][0] != name and si not in meant
    )


def _as_found(name: str) -> str:
    """The SI name under which a column would be found."""
    si = TIME if name in ISO_TIMES else si_name(name)
    return si.removesuffix(HEADING) + YAW if si.endswith(HEADING) else si


def headings(found: Mapping[str, tuple[str, float]]) -> tuple[str, ...]:
    """What to say of headings that stand in for yaw."""
    return tuple(
        f"{name} was read as yaw"
        for si, (name, _) in sorted(found.items())
        if si.endswith(YAW) and si_name(name).endswith(HEADING)
    )


def shown(si: str) -> str:
    """How people write an SI name in a log: `roll_rad` as `roll_deg`."""
    return si.replace("_radps", "_degps").replace("_rad", "_deg")
