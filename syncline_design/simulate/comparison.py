"""The paper's comparison: worst case against the Syncline over a grid of tau."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from syncline_design.model.system import System
from syncline_design.simulate.bounds import StageBound, chain_bounds
from syncline_design.simulate.results import ComparisonRow
from syncline_design.simulate.settings import demand_simulable
from syncline_design.simulate.worst_case import WorstCase, worst_cases

DEFAULT_GRID_S = tuple(float(f"{tau:.6g}") for tau in np.logspace(-6, 0, 25))
CLOSE = 0.02  # a ratio this near to 1 needs no reason
WORTH_SAYING = 0.005  # parts of the Syncline below this are left out of a reason


def comparison(
    system: System, taus_s: Sequence[float] = DEFAULT_GRID_S, seed: int = 0
) -> tuple[ComparisonRow, ...]:
    """The worst case of the nonlinear chain against the Syncline at every tau [s].

    With the fixed wing and with small SV plus AUV these are the paper's figures
    [fig:syncline-sim-compare-direct-georef, fig:syncline-sim-compare-survey] as data.
    """
    demand_simulable(system)
    found = worst_cases(system, np.asarray(taus_s, dtype=np.float64), seed)
    return tuple(ComparisonRow(row, reason(system, row)) for row in found)


def reason(system: System, found: WorstCase) -> str:
    """In words: where the worst case leaves the Syncline and why."""
    if abs(found.ratio - 1.0) <= CLOSE:
        return f"within {100 * CLOSE:g} % of the Syncline"
    parts = _parts(system, found)
    told = [text for share, text in sorted(parts, reverse=True) if share > WORTH_SAYING]
    side = "above" if found.ratio > 1.0 else "below"
    size = f"{100 * abs(found.ratio - 1.0):.1f} % {side} the Syncline"
    return f"{size}: {'; '.join(told)}" if told else size


def _parts(system: System, found: WorstCase) -> list[tuple[float, str]]:
    """(share of the Syncline, sentence) of everything that makes the two differ."""
    bounds = chain_bounds(system, found.tau_s)
    whole = found.syncline_m if found.syncline_m > 0.0 else 1.0
    lever = math.fsum(part.lever_arm_m for part in bounds) / whole
    bent = math.fsum(part.arc_m - part.chord_m for part in bounds) / whole
    lost = math.fsum(_lost_range(part) for part in bounds) / whole
    turn = max(stage.platform.omega_max_radps for stage in system.stages) * found.tau_s
    return [
        (lever, f"lever arms swing with the turn and add up to {100 * lever:.1f} %"),
        (
            bent,
            f"a turn by {math.degrees(turn):.0f} deg moves the object along a chord, shorter than "
            f"its arc by {100 * bent:.1f} %",
        ),
        (
            lost,
            "range noise acts along the line of sight, angular errors across it, so they do not "
            f"add up, which takes {100 * lost:.1f} %",
        ),
    ]


def _lost_range(part: StageBound) -> float:
    """What the sum of errors across and along the line of sight exceeds their length by [m]."""
    return part.across_m + part.range_m - math.hypot(part.across_m, part.range_m)
