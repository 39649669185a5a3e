"""Logs of vehicles that know no height: what is left out is level, and down is not compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.columns import (
    ATTITUDE,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    TARGET,
    TIME,
    VELOCITY,
    shown,
)
from syncline_design.logs.log import LogKind

DOWN, ELEVATION = 2, 2
HIDDEN_DOWN = "target down, not compared"  # column of what targets are told where it is left out


def filled(
    columns: dict[str, Array], prefixes: Sequence[str], kind: LogKind
) -> tuple[list[str], tuple[str, ...]]:
    """Add the level columns that a 2-D log leaves out; notes for people, and which were added.

    Each of these may be missing if what belongs to it is there: down (beside north and east), roll
    and pitch together (beside yaw), elevation (beside range and azimuth).  Down is compared only
    where positions, targets and elevations all tell it; what targets are told stays as HIDDEN_DOWN.
    """
    level: list[str] = []
    flat = _fill(columns, [prefixes[0] + n for n in POSITION], (DOWN,), level)
    for prefix in prefixes:
        if _fill(columns, [prefix + n for n in ATTITUDE], (0, 1), level):
            _fill(columns, [prefix + n for n in RATE], (0, 1), level)
        if flat:
            _fill(columns, [prefix + n for n in VELOCITY], (DOWN,), level)
        if kind == "georeference":
            flat |= _fill(columns, [prefix + n for n in RANGING], (ELEVATION,), level)
    truth = TARGET if kind == "georeference" else REFERENCE
    known = truth[DOWN] in columns
    if kind == "georeference":
        flat |= _fill(columns, truth, (DOWN,), [])
    if flat:
        if known and level:
            columns[HIDDEN_DOWN] = columns[truth[DOWN]]
        columns[truth[DOWN]] = np.full(columns[TIME].shape, np.nan)
    notes = [f"not in the log, taken as zero: {', '.join(map(shown, level))}"] if level else []
    if flat and (known or kind == "georeference"):
        notes.append("down is not compared: the log does not hold all that tells it")
    return notes, tuple(map(shown, level))


def _fill(
    columns: dict[str, Array], names: Sequence[str], may_lack: Sequence[int], level: list[str]
) -> bool:
    """Zeros for components that are left out together, where all others are there."""
    lacking = [k for k, name in enumerate(names) if name not in columns]
    if lacking != list(may_lack):
        return False
    for k in lacking:
        columns[names[k]] = np.zeros(columns[TIME].shape)
        level.append(names[k])
    return True
