"""Which of north, east and down a log compares at all.

A planar robot, a rail or a one-component reference leaves axes whose error is not known, or is the
same number in every row.  Such an axis has no noise: its zeros must not be pooled with the others'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.noise import Structure, White
from syncline_design.diagnosis.scene import scene
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.model.system import System

NED = ("north", "east", "down")
STILL = 1e-4  # of the spec's standard deviation: an axis that varies by less does not vary
ROUNDING_M = 1e-9

Axes = tuple[int, ...]


def varying_axes(error: Array, structure: Structure) -> Axes:
    """Axes whose error is known and varies; error (n, 3) [m] of the spec as it is, NaN unknown.

    Where none varies, all that are known: the log is free of noise.
    """
    expected = _expected_std(structure)
    known = tuple(k for k in range(3) if np.all(np.isfinite(error[:, k])))
    return tuple(k for k in known if not _still(error[:, k], expected[k])) or known


def without_still_axes(
    system: System, log: Log, known: Sequence[Acting], structure: Structure
) -> Log:
    """The log with axes that never vary taken as not known, where the spec's noise covers them.

    An axis that is still but far off keeps its say: something holds it there.
    """
    error = scene(system, log, known).error()
    varying, expected = varying_axes(error, structure), _expected_std(structure)
    truth = log.truth_m.copy()
    hidden = []
    for k in range(3):
        still = k not in varying and bool(np.all(np.isfinite(truth[:, k])))
        if still and abs(float(error[0, k])) <= expected[k]:
            truth[:, k] = np.nan
            hidden.append(NED[k])
    if not hidden:
        return log
    note = f"{' and '.join(hidden)}: the same error in every row, so not compared"
    return replace(log, truth_m=truth, notes=(*log.notes, note))


def still_axes_apart(structure: Structure, axes: Axes) -> Structure:
    """The structure with the noise of axes that never vary fixed and each for itself.

    Such an axis is off by a constant, which effects have to explain as well as the spec's noise
    lets them; that it does not scatter says nothing about how large the noise of the others is.
    """
    still = np.array([k not in axes for k in range(3)])
    if not np.any(still):
        return structure
    moving = (~still)[:, None].astype(float)
    total = sum(np.einsum("nii->ni", w.covariance) for w in structure.white)
    if structure.stamped is not None:
        total = total + np.sum(structure.stamped**2, axis=2)
    fixed = structure.fixed * (moving * moving.T)
    kept = np.einsum("nii->ni", structure.fixed)
    fixed = fixed + ((kept + total) * still)[:, :, None] * np.eye(3)
    return replace(
        structure,
        white=tuple(_on(part, moving) for part in structure.white),
        slow=tuple(replace(part, loading=part.loading * moving) for part in structure.slow),
        directed=tuple(replace(d, direction=d.direction * moving) for d in structure.directed),
        stamped=None if structure.stamped is None else structure.stamped * moving,
        fixed=fixed,
    )


def _on(part: White, moving: Array) -> White:
    """White noise on some of the axes, moving (3, 1) 1 on them and 0 on the others."""
    loading = None if part.loading is None else part.loading * moving
    return White(part.sensor, part.covariance * (moving * moving.T), loading)


def _expected_std(structure: Structure) -> Array:
    """Standard deviation [m] of every axis in the median row, by the spec; (3,)."""
    variance = np.einsum("nii->ni", structure.fixed)
    for part in structure.white:
        variance = variance + np.einsum("nii->ni", part.covariance)
    expected: Array = np.sqrt(np.median(variance, axis=0))
    return expected


def _still(values: Array, expected_m: float) -> bool:
    return float(np.ptp(values)) <= max(STILL * expected_m, ROUNDING_M)
