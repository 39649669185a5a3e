"""Noise that an effect borrows from the columns that it is computed of.

The slope of a delay is the logged velocity, that of a longer arm the logged attitude: what they
scatter goes into the error that the effect leaves, or, where an arm is made shorter and the
attitude's noise with it, out of it (errors in variables).  A likelihood takes the first for a bad
fit and the second for a good one, though neither says whether the effect is there.  How much it
counts is seen by adding as much noise again to the columns (simulation as in SIMEX, Cook and
Stefanski, J. Am. Stat. Assoc. 89 (1994)): with d the change of the error,
    borrowed = E[d' C^-1 d with the effects - d' C^-1 d without] / 2   [nat].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.scatter import scatter, unforetold
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.logs.log import Log, LogTrack, StageLog
from syncline_design.logs.stamps import groups
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage

DRAWS = 2
SURE = 2.0  # standard deviations


@dataclass(frozen=True, slots=True)
class Noisier:
    """A scene with as much noise again in the columns of motion, and what that makes of its error.

    added (n, 3) [m]: change of the error without any effects.
    """

    view: Scene
    added: Array


def borrowed_nats(
    noisier: Sequence[Noisier], acting: Sequence[Acting], error: Array, known: Precision
) -> float:
    """What noise of the columns costs effects that leave an error (n, 3) [nat]; negative: saves."""
    if not acting or not noisier:
        return 0.0
    costs = [
        _squares(known, np.nan_to_num(one.view.error(acting)) - error) - _squares(known, one.added)
        for one in noisier
    ]
    return 0.5 * sum(costs) / len(costs)


def doubt_nats(first: float, second: float) -> float:
    """By how much noise that two models borrow may have chosen between them [nat].

    With added noise d the likelihood changes by d' C^-1 d / 2 and by d' C^-1 e, whose standard
    deviation is the root of twice the former.
    """
    return SURE * math.sqrt(2.0 * (abs(first) + abs(second)))


def _squares(known: Precision, error: Array) -> float:
    return float(known.squares(error[:, :, None])[0])


def noisier_scenes(view: Scene, rng: np.random.Generator) -> tuple[Noisier, ...]:
    """DRAWS of the scene with noisier attitudes, velocities and rates."""
    found, error = [], np.nan_to_num(view.error())
    for _ in range(DRAWS):
        pairs = zip(view.system.stages, view.log.stages, strict=True)
        stages = tuple(_noisier(view.log, stage, own, rng) for stage, own in pairs)
        other = scene(view.system, replace(view.log, stages=stages), view.known)
        found.append(Noisier(other, np.nan_to_num(other.error()) - error))
    return tuple(found)


def _noisier(log: Log, stage: Stage, own: StageLog, rng: np.random.Generator) -> StageLog:
    """A stage's columns with as much noise again; rows of a stamp share it.

    A velocity that was derived of the places follows theirs, so that both have the same.
    """
    if stage.attitude is not None and log.kind != "position":
        euler_rad = np.unwrap(own.euler_rad, axis=0)
        added = _unforetold_again(log.time_s, euler_rad, stage.attitude.sigma, rng)
        own = replace(own, euler_rad=own.euler_rad + added)
    rate = own.rate_track or LogTrack(log.time_s, own.rate_radps)
    if own.follows_position and stage.position is not None and own.antenna_m is not None:
        added = _unforetold_again(log.time_s, own.antenna_m, stage.position.sigma, rng)
        place_m = own.antenna_m + added
        velocity_mps = derived_velocity(log.time_s, place_m)
        own = replace(own, antenna_m=place_m, velocity_mps=velocity_mps)
    else:
        velocity = own.velocity_track or LogTrack(log.time_s, own.velocity_mps)
        faster = _scattered(velocity, rng)
        velocity_mps = own.velocity_mps + _at(log.time_s, faster, velocity)
        own = replace(own, velocity_track=faster, velocity_mps=velocity_mps)
    turned = _scattered(rate, rng)
    rate_radps = own.rate_radps + _at(log.time_s, turned, rate)
    return replace(own, rate_track=turned, rate_radps=rate_radps)


def _unforetold_again(
    time_s: Array, column: Array, sigma: Sequence[float], rng: np.random.Generator
) -> Array:
    """Noise of a column (n, 3) once more: what its rows do not foretell, the spec's at most."""
    group = groups(time_s)
    sizes = [min(most, unforetold(time_s, column[:, k : k + 1])) for k, most in enumerate(sigma)]
    drawn: Array = rng.standard_normal((int(group[-1]) + 1, 3))[group] * np.array(sizes)
    return drawn


def _scattered(track: LogTrack, rng: np.random.Generator) -> LogTrack:
    group = groups(track.time_s)
    size = scatter(track.time_s, track.value)
    drawn = rng.standard_normal((int(group[-1]) + 1, track.value.shape[1]))[group]
    return replace(track, value=track.value + size * drawn)


def _at(time_s: Array, noisier: LogTrack, track: LogTrack) -> Array:
    """What was added to a track, at the stamps of the log."""
    added = noisier.value - track.value
    return np.stack([np.interp(time_s, track.time_s, added[:, k]) for k in range(3)], axis=1)
