"""Some positions or ranges are far off: Student's t instead of normal noise, or outliers."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.record import (
    OUTLIER_FACTOR,
    ActsOn,
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
    """Noise times sqrt(nu / chi2_nu) per row; a share of the rows are outliers instead.

    Of a ranging sensor it is the range's: echoes of something else, edges, rain; bearings have
    none of it.

    An outlier is normal with ten times the spec's standard deviation: Student's tails and outliers
    are two parts of a mixture, no row is struck by both.
    """
    if rng is None:
        return Departures()
    freedom = values["degrees_of_freedom"]
    factor = np.sqrt(freedom / rng.chisquare(freedom, len(rows)))
    struck = rng.random(len(rows)) < values["outlier_rate"]
    extra = np.where(struck, OUTLIER_FACTOR, factor) - 1.0
    if sensor == "position":
        return Departures(position_noise=extra)
    return Departures(range_noise=extra)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """What the standard deviation of the mixture grows by, times sigma_p or the range's sigma.

    Var = (1 - rate) nu / (nu - 2) + rate 100, over the spec's variance; infinite up to nu = 2.
    """
    part = stage.position if sensor == "position" else stage.ranging
    if part is None:
        return Contribution()
    if _unbudgeted(values):
        return Contribution(systematic_m=math.inf)
    freedom, rate = values["degrees_of_freedom"], values["outlier_rate"]
    tails = (1.0 - rate) * freedom / (freedom - 2.0) if rate < 1.0 else 0.0
    variance = tails + rate * OUTLIER_FACTOR**2
    growth = math.sqrt(variance) - 1.0
    sigma_m = math.hypot(*part.sigma) if sensor == "position" else part.sigma[0]
    return Contribution(systematic_m=growth * sigma_m)


def _unbudgeted(values: Values) -> str:
    """Student's t has no variance up to two degrees of freedom."""
    if values["degrees_of_freedom"] > 2.0 or values["outlier_rate"] >= 1.0:
        return ""
    return (
        "Student's t of 2 or fewer degrees of freedom has no standard deviation that a budget "
        "could add; give more than 2, with the rows far out as outlier_rate, or the growth of the "
        "standard deviation that your data show as noise_understated"
    )


EFFECT = Effect(
    name="heavy_tails",
    sensors=("position", "ranging"),
    kind="stochastic",
    parameters=(
        Parameter("degrees_of_freedom", 1.0, 30.0, signed=False, above=0.0),
        Parameter("outlier_rate", 0.0, 0.3, signed=False, most=1.0),
    ),
    sentence="{sensor} data have heavy tails: {degrees_of_freedom} degrees of freedom, a share of "
    "{outlier_rate} outliers",
    confused_with="timestamp_jitter, noise_understated",
    separated_by="speed: tails are not linked to it",
    source="Student's t as normal over chi-square (Lange, Little, Taylor, JASA 84, 1989)",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    unbudgeted=_unbudgeted,
    opens="tails",
    brief=("heavy tails ({degrees_of_freedom} degrees of freedom)", "{outlier_rate} outliers"),
    comes_with="sensor",
)
