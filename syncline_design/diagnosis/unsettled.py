"""What the log's beginning leaves in an effect with a memory: the past that nobody logged.

A low pass of constant T starts from a state that comes from before the log.  It is taken as what
the first turn would have made of it; what that is off by decays as exp(-(t - t0) / T) in every
stretch of the log and is found from the error itself, held to what unlogged acceleration can have
done: T^2 times the log's own (ridge).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from syncline_design.diagnosis.past import LoggedPast
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array, StageRows
from syncline_design.model.system import Stage, System

GONE = 1e-3  # share of the first state that no longer counts
LEAST = 1e-9  # of the noise: a state that is smaller has no size of its own


def without_unlogged_past(
    system: System, rows: Sequence[StageRows], error: Array, acting: Sequence[Acting]
) -> Array:
    """The error (n, 3) [m] less what the states before the log leave in it."""
    for one in acting:
        past = rows[one.stage].lagged
        constant_s = float(one.values[one.effect.memory]) if one.effect.memory else 0.0
        if constant_s > 0.0 and isinstance(past, LoggedPast) and not past.from_positions:
            stage = system.stages[one.stage]
            error = _less(error, stage, rows[one.stage], constant_s, past)
    return error


def _less(
    error: Array, stage: Stage, rows: StageRows, constant_s: float, past: LoggedPast
) -> Array:
    left = error.copy()
    noise_m = max(stage.position.sigma) if stage.position is not None else 0.0
    pulled = np.sqrt(np.mean(np.sum(rows.acceleration_mps2**2, axis=1)))
    size_m = constant_s**2 * float(pulled)
    if size_m <= LEAST * noise_m:  # nothing moves, so nothing is remembered
        return error
    for begun_s, a, b in _stretches(past):
        share = np.exp(-(past.at_s[a:b] - begun_s) / constant_s)
        b = a + int(np.count_nonzero(share > GONE))
        share = share[: b - a]
        state = share @ left[a:b] / (share @ share + (noise_m / size_m) ** 2)
        left[a:b] -= share[:, None] * state
    return left


def _stretches(past: LoggedPast) -> Iterator[tuple[float, int, int]]:
    """Where each stretch of the motion begins [s], and which rows (a, b) are in it."""
    starts = past.stretch_starts_s()
    bounds = [0, *np.searchsorted(past.at_s, starts[1:]).tolist(), past.at_s.shape[0]]
    for begun_s, (a, b) in zip(starts.tolist(), pairwise(bounds), strict=True):
        if b > a:
            yield begun_s, a, b
