"""Whether what is named is one value wherever the vehicle goes, or the word for a neighbour.

A range that is 2 cm too long is so at every range; what grows with the range is a scale.  With s
the shape that an effect has in the error, and c_k what the vehicle does (speed, turn rate, heading,
range, azimuth; of mean 0 and variance 1 where s is), in
    e = s (1 + v_k c_k) + slow courses + w
every v_k has to be nothing: it is the share of itself by which the effect changes over a standard
deviation of c_k.  Scatter of stamps has to have no mean that goes with any of them: s c_k over its
size.  Judged beside the slow states, so noise that is larger or slower than the spec's refutes
nothing.  Time is not among the c_k: what changes with time is still that effect, and said to vary.

Ranges that hardly vary leave a scale little to change by: with a mean m and a deviation d of the
range, what is proportional to it has v = d / m.  v m / d is the part of the effect that is gone
where the covariate is nothing, and of one value none of it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.fitting import Model
from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.regimes import covariates
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.slow_states import INSIDE, States, fitted_of
from syncline_design.diagnosis.spans import span_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

# log p of the clearest change of all that were looked for.  Real effects change a little with the
# motion (a laser scanner's delay with the range, 1e-5), names of neighbours with 1e-11 and less.
REFUTED = math.log(1e-8)
CHANGES = 0.25  # share of itself, from which a change is not the effect's own small print
# log p, and the part of an effect that goes with a covariate to nothing, from which it is mostly
# no constant: a scale that is called a bias has 1e-6 where ranges vary by an eighth of themselves.
PROPORTIONAL, MOSTLY = math.log(1e-4), 0.5
STILL = 1e-9  # of a covariate's standard deviation, below which it tells nothing
Inside = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Uneven:
    """With what an effect changes, and by what share of itself over a standard deviation."""

    covariate: str
    share: float


def uneven_effects(states: States, model: Model) -> dict[Label, Uneven]:
    """Effects of a model that go with what the vehicle does, as none of their own does."""
    found = {}
    for label, inside, shape, size in _shapes(states, model):
        own = states if inside.all() else states.within(inside, INSIDE)
        clearest = _clearest(own, model, shape, size)
        if clearest is not None:
            found[label] = clearest
    return found


def _shapes(states: States, model: Model) -> Iterator[tuple[Label, Inside, Array, float]]:
    """Label, rows, shape (n, 3, k) and size of all that moves the mean or scatters with motion."""
    view, everywhere = states.data.view, np.ones(len(states.data.view), dtype=bool)
    scattering = {one.candidate.label: one.directed for one in model.opened if one.directed >= 0}
    for one in model.acting:
        if one.label not in scattering:
            span = span_of(one.effect)
            inside = everywhere if span is None else span.mask(view.log.time_s) > 0.0
            shape = np.nan_to_num(slopes(view, (one,))) @ fitted_of(one)
            yield one.label, inside, shape[:, :, None], 1.0
    for label, at in scattering.items():
        direction = states.data.structure.directed[at].direction
        yield label, everywhere, np.nan_to_num(direction), model.level.size[at]


def _clearest(states: States, model: Model, shape: Array, size: float) -> Uneven | None:
    """The change that is least likely by chance, if it is there and matters."""
    asked = list(_standardised(states.data.view, np.sum(shape**2, axis=(1, 2))))
    if not asked or not size > 0.0:
        return None
    judged = states.judged(model, [shape * one.values[:, None, None] for one in asked])
    changed, best = min(zip(asked, judged, strict=True), key=lambda pair: pair[1].log_p)
    share = float(np.linalg.norm(best.values)) / size
    chance = best.log_p + math.log(len(asked))
    grows = shape.shape[2] == 1 and float(best.values[0]) * changed.at_nothing > MOSTLY * size
    if (chance < REFUTED and share > CHANGES) or (chance < PROPORTIONAL and grows):
        return Uneven(changed.name, share)
    return None


@dataclass(frozen=True, slots=True)
class _Standardised:
    """A covariate of mean 0 and variance 1 by a weight of the rows.

    at_nothing: standard deviations from where the covariate is 0 to its mean; 0 of an angle, which
    has no such place.
    """

    name: str
    values: Array
    at_nothing: float


def _standardised(view: Scene, weight: Array) -> Iterator[_Standardised]:
    """Covariates but time; angles as two."""
    share = weight / max(float(np.sum(weight)), 1e-300)
    for one in covariates(view):
        if one.unit == "s":
            continue
        angle, turns = np.radians(one.values), one.unit == "deg"
        for values in (np.sin(angle), np.cos(angle)) if turns else (one.values,):
            mean = float(np.sum(share * values))
            spread = math.sqrt(float(np.sum(share * (values - mean) ** 2)))
            if spread > STILL * (1.0 + float(np.max(np.abs(values)))):
                yield _Standardised(
                    one.name, (values - mean) / spread, 0.0 if turns else mean / spread
                )
