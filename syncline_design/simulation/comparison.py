"""The paper's comparison: worst case against the Syncline over a grid of tau."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from syncline_design.model.figure_text import percent, rounded, to_places
from syncline_design.model.system import System
from syncline_design.simulation.bounds import StageBound, chain_bounds
from syncline_design.simulation.results import ComparisonRow, WorstCase
from syncline_design.simulation.settings import demand_simulable
from syncline_design.simulation.worst_case import worst_cases

DEFAULT_GRID_S = tuple(rounded(tau, 6) for tau in np.logspace(-6, 0, 25))
CLOSE = 0.02  # a ratio this near to 1 needs no reason
WORTH_SAYING = 0.005  # parts of the Syncline below this are left out of a reason
CAUSES = {
    "lever_arm": "lever arms swing with the turn, which the Syncline leaves out",
    "chord": "a turn moves the object along a chord, shorter than the Syncline's arc",
    "range_noise": "range noise acts along the line of sight, angular errors across it, so that "
    "they do not add up as in the Syncline",
    "tilt": "on a tilted vehicle the noises of roll and yaw turn about axes no longer square",
}


def comparison(
    system: System, taus_s: Sequence[float] = DEFAULT_GRID_S, *, seed: int
) -> tuple[ComparisonRow, ...]:
    """The worst case of the nonlinear chain against the Syncline at every tau [s].

    With the fixed wing and with small SV plus AUV these are the paper's figures
    [fig:syncline-sim-compare-direct-georef, fig:syncline-sim-compare-survey] as data.
    """
    demand_simulable(system)
    found = worst_cases(system, np.asarray(taus_s, dtype=np.float64), seed)
    return tuple(_row(system, one) for one in found)


def _row(system: System, found: WorstCase) -> ComparisonRow:
    return ComparisonRow(
        found.tau_s,
        found.value_m,
        found.syncline_m,
        found.ratio_to_syncline,
        found.bound_m,
        found.certificate.gap,
        *reason(system, found),
    )


def reason(system: System, found: WorstCase) -> tuple[str, tuple[str, ...]]:
    """(words, causes): where the worst case leaves the Syncline and why."""
    ratio = found.ratio_to_syncline
    if abs(ratio - 1.0) <= CLOSE:
        return f"within {percent(CLOSE, 6)} of the Syncline", ()
    parts = sorted(_parts(system, found), reverse=True)
    told = [(cause, text) for share, cause, text in parts if share > WORTH_SAYING]
    side = "above" if ratio > 1.0 else "below"
    words = f"{to_places(100 * abs(ratio - 1.0), 1)} % {side} the Syncline"
    if told:
        words += f": {'; '.join(text for _, text in told)}"
    return words, tuple(cause for cause, _ in told)


def _parts(system: System, found: WorstCase) -> list[tuple[float, str, str]]:
    """(share of the Syncline, cause, sentence) of everything that makes the two differ."""
    bounds = chain_bounds(system, found.tau_s)
    whole = found.syncline_m if found.syncline_m > 0.0 else 1.0
    lever = math.fsum(part.lever_arm_m for part in bounds) / whole
    bent = math.fsum(part.arc_m - part.chord_m for part in bounds) / whole
    lost = math.fsum(_lost_range(part) for part in bounds) / whole
    leaning = math.fsum(part.tilt_m for part in bounds) / whole
    turn = max(stage.platform.omega_max_radps for stage in system.stages) * found.tau_s
    return [
        (lever, "lever_arm", f"{CAUSES['lever_arm']} (up to {to_places(100 * lever, 1)} %)"),
        (
            bent,
            "chord",
            f"{CAUSES['chord']} (a turn of {to_places(math.degrees(turn), 0)} deg, "
            f"{to_places(100 * bent, 1)} %)",
        ),
        (lost, "range_noise", f"{CAUSES['range_noise']} ({to_places(100 * lost, 1)} %)"),
        (leaning, "tilt", f"{CAUSES['tilt']} (up to {to_places(100 * leaning, 1)} %)"),
    ]


def _lost_range(part: StageBound) -> float:
    """What the sum of errors across and along the line of sight exceeds their length by [m]."""
    return part.across_m + part.range_m - math.hypot(part.across_m, part.range_m)
