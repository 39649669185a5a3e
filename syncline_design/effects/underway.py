"""The way of sound and what is interpolated between samples, as effects that no spec lists.

Source: `model/underway.py`, whose terms the budget charges; here how the measurement departs.
"""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import (
    NOTHING,
    ActsOn,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Rng,
    StageRows,
    Values,
)
from syncline_design.model.system import Stage
from syncline_design.model.underway import UnderwayCause


def _travelled(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """Position and attitude are those of 2 r / c after the measurement."""
    later = values["share"] * rows.range_m
    return Departures(position_shift_s=later, attitude_shift_s=later)


def _travels(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """Both shifts are 2 d / c at most."""
    return Contribution(shift_s=values["share"] * basis.distance_m)


def _relayed(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """A fix of what carries the next stage is 2 r / c older than its stamp.

    All three sensors are shifted alike, which leaves the stage's own pairs as they are: only the
    ranging's stamp is handed on.
    """
    later = -values["share"] * rows.range_m
    return Departures(position_shift_s=later, attitude_shift_s=later, ranging_shift_s=later)


def _relays(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """The next stage's position is late by 2 d / c at most."""
    return Contribution(relayed_s=values["share"] * basis.distance_m)


def _bend(rng: np.random.Generator, count: int) -> Array:
    """4 u (1 - u), u uniform in the time between two samples: t (T - t) over its largest value.

    Its distribution function is 1 - sqrt(1 - x), so that 1 - (1 - share)^2 has it.
    """
    left: Array = 1.0 - rng.uniform(0.0, 1.0, count)
    return 1.0 - left * left


def _direction(given: Array | None, rng: np.random.Generator, count: int) -> Array:
    """Unit vectors (n, 3): those given, else isotropic."""
    if given is not None:
        return given
    drawn = rng.standard_normal((count, 3))
    length: Array = np.linalg.norm(drawn, axis=1)[:, None]
    return np.asarray(drawn / np.where(length > 0.0, length, 1.0))


def _bent(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """The chord of the path between two fixes instead of the path, NED [m]."""
    if rng is None:
        return NOTHING
    along = _direction(rows.pull, rng, len(rows))
    off = values["size"] * _bend(rng, len(rows))
    return Departures(position_m=rotate(rows.rotation, along) * off[:, None])


def _bends(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """a_max T^2 / 8."""
    return Contribution(systematic_m=values["size"])


def _turned(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """An even turn between two attitudes instead of the one there was [rad]."""
    if rng is None:
        return NOTHING
    about = _direction(rows.twist, rng, len(rows))
    return Departures(
        attitude_rotation_rad=about * (values["size"] * _bend(rng, len(rows)))[:, None]
    )


def _turns(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """alpha_max T^2 / 8."""
    return Contribution(turn_rad=values["size"])


_SOURCE = "linear interpolation errs by h^2 / 8 max |f''| (NIST DLMF 3.3.4)"

OF_CAUSE: dict[UnderwayCause, Effect] = {
    "travel": Effect(
        name="sound under way",
        sensors=("ranging",),
        kind="deterministic",
        parameters=(),
        sentence="{sensor} data are of the time before their sound went to the object and back",
        confused_with="echo_delay",
        separated_by="the same motion over near and far targets",
        source="the echo is back after 2 r / c",
        depart=_travelled,
        sensitivity=None,
        contribute=_travels,
        implied=True,
    ),
    "object": Effect(
        name="sound under way to what moves",
        sensors=("ranging",),
        kind="deterministic",
        parameters=(),
        sentence="fixes by {sensor} are of the time before their sound went there and back",
        confused_with="latency of the fixes",
        separated_by="the same motion of the vehicle near and far",
        source="the echo is back after 2 r / c",
        depart=_relayed,
        sensitivity=None,
        contribute=_relays,
        implied=True,
    ),
    "path": Effect(
        name="interpolation",
        sensors=("position",),
        kind="stochastic",
        parameters=(),
        sentence="positions between two fixes are interpolated",
        confused_with="noise of the position",
        separated_by="more fixes in the same time",
        source=_SOURCE,
        depart=_bent,
        sensitivity=None,
        contribute=_bends,
        transponder=True,
        implied=True,
    ),
    "turn": Effect(
        name="interpolation",
        sensors=("attitude",),
        kind="stochastic",
        parameters=(),
        sentence="attitudes between two samples are interpolated",
        confused_with="noise of the attitude",
        separated_by="more samples in the same time",
        source=_SOURCE,
        depart=_turned,
        sensitivity=None,
        contribute=_turns,
        implied=True,
    ),
}
