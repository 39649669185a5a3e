"""Every stamp of a sensor is off by an independent random time."""

from __future__ import annotations

from syncline_design.effects.kinematics import shift_slope, shifted
from syncline_design.effects.record import (
    ActsOn,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Values,
)
from syncline_design.model.system import Stage


def _depart(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """mu normal with standard deviation std_s, anew in every row."""
    if rng is None:
        return Departures()
    return shifted(sensor, values["std_s"] * rng.standard_normal(len(rows)))


def _spread(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """Cov += std^2 V V' or W W' [m2]: rank one along the motion."""
    return (values["std_s"] * shift_slope(rows, sensor))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau grows by k std, k the coverage factor of every normal timing error's bound."""
    return Contribution(tau_s=basis.coverage_factor * abs(values["std_s"]))


EFFECT = Effect(
    name="timestamp_jitter",
    sensors=("position", "attitude", "ranging"),
    kind="stochastic",
    parameters=(Parameter("std_s", 1e-5, 0.5, "s", signed=False),),
    sentence="the {sensor} stamps scatter by {std_s} (standard deviation)",
    confused_with="noise_understated",
    separated_by="speed: jitter grows with it, noise does not",
    source="ITU-T G.810, jitter; first order of the paper's eq. state_space_y",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    spread=_spread,
    rarity=130,
    opens="size",
    bounded_by_k=True,
    breaks="timing",
    comes_with="stamps",
)
