"""Whether a log that leaves out elevations, or roll and pitch, is of a vehicle that was level.

A 2-D log leaves out what is zero.  One of a drone that leaves out its elevations leaves out what no
zero stands for: with the heights of places and targets, the beam of row i misses its target by
    a_i = asin(min(|down_i| / r_i, 1)),   down_i what is left of the row downwards by zeros,
which is noise where the vehicle and its beams were level.  What a log does not hold cannot be held
against a sensor, so that it is refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.diagnosis.scene import scene
from syncline_design.effects.acting import Acting
from syncline_design.logs.log import Log
from syncline_design.logs.refusals import refuse
from syncline_design.model.figure_text import rounded, to_digits
from syncline_design.model.system import System

LEVEL_RAD: Final = math.radians(3.0)  # that a level vehicle and its beams keep to, in the median
OF_BEAMS: Final = ("elevation", "roll", "pitch")


def demand_level(path: Path, system: System, log: Log, known: Sequence[Acting]) -> None:
    """Raises BadInput where angles that were taken as zero were not."""
    lacking = [name for name in log.level if any(angle in name for angle in OF_BEAMS)]
    down_m = log.truth_m[:, 2] if log.hidden_down_m is None else log.hidden_down_m
    range_m = log.stages[-1].range_m
    if log.kind != "georeference" or not lacking or range_m is None:
        return
    truth_m = np.column_stack([log.truth_m[:, :2], down_m])
    off_m = np.abs(scene(system, replace(log, truth_m=truth_m), known).error()[:, 2])
    seen = np.isfinite(off_m) & (range_m > 0.0)
    if not np.any(seen):
        return
    angle = np.arcsin(np.minimum(off_m[seen] / range_m[seen], 1.0))
    usual_rad = float(np.median(angle))
    if usual_rad <= LEVEL_RAD:
        return
    usual_deg = to_digits(rounded(math.degrees(usual_rad), 2))
    plural = "columns are" if len(lacking) > 1 else "column is"
    raise refuse(
        path,
        f"{plural} missing: {', '.join(lacking)}",
        line=1,
        column=1,
        expected="angles, or a 2-D log: what it leaves out is taken as zero",
        found=f"heights of places and targets by which a level beam misses its target by "
        f"{usual_deg} deg in the median row",
        hint="log the angles; what a log does not hold is held against no sensor",
    )
