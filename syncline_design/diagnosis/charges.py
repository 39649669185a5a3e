"""What an effect is charged beside the likelihood when a class of effects competes.

Its figures, each as half of log N (Schwarz 1978), of all subsets of them the cheapest, charged for
having been chosen (Chen and Chen, Biometrika 95 (2008)): an arm of which only the height is seen
has one figure, as has a height of the target.  The place from which a step acts is one of n rows
and known to w of them, which costs log(n / w) (Smith, Biometrika 62 (1975)): with C the noise and
s_j what the step makes of row j, moving it over rows j costs the sum of s_j' C^-1 s_j / 2, and w is
the sum over all rows k of exp(-what acting from there on costs).  Less the noise that it borrows
from the columns of motion, which is known up to its own chance.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.borrowed import doubt_nats
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, slopes
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.identity import Label, effect_of
from syncline_design.diagnosis.trials import freedom_of
from syncline_design.diagnosis.unusual import UNUSUAL_NATS, unusual_nats
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

USUAL_ARM = 3.0  # longest arm or baseline of a stage, beyond which an error of an arm is not usual


@dataclass(frozen=True, slots=True)
class Charge:
    """count: of its figures; figures: what they cost [nat]; borrowed: noise of columns [nat].

    prior: what values are charged that are beyond what such an effect usually has [nat].
    """

    count: int
    figures: float
    borrowed: float
    prior: float

    @property
    def nats(self) -> float:
        """What is charged before values are looked at."""
        return self.figures - self.borrowed

    @property
    def unusual(self) -> bool:
        """Whether its values are hardly what such an effect has."""
        return self.prior > AS_GOOD_NATS

    def doubt(self, other: Charge) -> float:
        """By how much the noise of columns may have chosen between two effects [nat]."""
        return doubt_nats(self.borrowed, other.borrowed)


def charge(data: Data, model: Model, label: Label, named: Model) -> Charge:
    """What one effect of a model is charged, at the covariance of the named one's."""
    borrowed = data.borrowed_nats(model, named.precision)
    count = freedom_of(effect_of(model, label))
    return Charge(count, _figures(data, model, label), borrowed, _prior(data, model, label))


def _figures(data: Data, model: Model, label: Label) -> float:
    each = 0.5 * math.log(max(len(data.view) * len(data.axes), 2))
    effect = effect_of(model, label)
    places = sum(p.located for p in effect.parameters)
    whole = each * (freedom_of(effect) - places) + place_nats(data, model, label) * places
    values, covariance = _fitted(model, label)
    size, cheapest = len(values), whole
    for count in range(1, size):
        for left in itertools.combinations(range(size), size - count):
            lost = 0.5 * _square(values[list(left)], covariance[np.ix_(left, left)])
            paid = whole - each * len(left) + math.log(math.comb(size, count))
            cheapest = min(cheapest, paid + lost)
    return cheapest


def place_nats(data: Data, model: Model, label: Label) -> float:
    """What the place of a step costs [nat], log(n / w); nothing for what has none.

    C is white: over the few rows that a place is known to, slow noise is a constant.
    """
    one = next((a for a in model.acting if a.label == label), None)
    names = [] if one is None else [p.name for p in one.effect.parameters if p.located]
    if one is None or not names:
        return 0.0
    always = replace(one, values={**one.values, names[0]: -math.inf})
    values = np.array([float(one.values[p.name]) for p in one.effect.slopes()])
    shape = np.nan_to_num(slopes(data.view, (always,))) @ values
    lost = 0.5 * np.einsum("ni,nij,nj->n", shape, model.precision.white_inverse, shape)
    since = data.view.log.time_s - data.view.log.time_s[0]
    moved = np.concatenate([[0.0], np.cumsum(lost)])  # over all rows before each one
    at = moved[np.searchsorted(since, float(one.values[names[0]]))]
    known_to = float(np.sum(np.exp(-np.abs(moved[:-1] - at))))
    return math.log(max(len(data.view) / max(known_to, 1.0), 1.0))


def told_nats(model: Model, label: Label) -> float:
    """What setting all figures of an effect to zero costs, by their covariance [nat]."""
    return 0.5 * _square(*_fitted(model, label))


def _fitted(model: Model, label: Label) -> tuple[Array, Array]:
    """Values and covariance of the figures of one effect that move the mean."""
    at = 0
    for one in model.acting:
        names = [p.name for p in one.effect.slopes()]
        if one.label == label:
            part = slice(at, at + len(names))
            return np.array([float(one.values[n]) for n in names]), model.covariance[part, part]
        at += len(names)
    return np.zeros(0), np.zeros((0, 0))


def fitted_figures(model: Model, label: Label) -> tuple[dict[str, float], dict[str, float]]:
    """Figures of one effect that move the mean, and their standard uncertainties, by name, SI."""
    names = [p.name for one in model.acting if one.label == label for p in one.effect.slopes()]
    values, covariance = _fitted(model, label)
    spreads = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return (
        dict(zip(names, map(float, values), strict=True)),
        dict(zip(names, map(float, spreads), strict=True)),
    )


def _square(values: Array, covariance: Array) -> float:
    """x' C^-1 x: what setting figures to zero costs in squares, the others fitted again."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    seen = scale > 0.0
    if not np.any(seen):
        return 0.0
    unit = values[seen] / scale[seen]
    correlation = covariance[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])
    return float(unit @ np.linalg.pinv(correlation, rcond=1e-10, hermitian=True) @ unit)


def _prior(data: Data, model: Model, label: Label) -> float:
    values, covariance = _fitted(model, label)
    if _is_unusual_arm(data, model, label):
        return UNUSUAL_NATS
    spreads = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return unusual_nats(effect_of(model, label), values, spreads)


def _is_unusual_arm(data: Data, model: Model, label: Label) -> bool:
    """An arm that is off by more than some of the longest arm or baseline that the spec knows."""
    if effect_of(model, label).breaks != "lever_arm":
        return False
    stage, rows = data.view.system.stages[label[2]], data.view.rows[label[2]]
    arms = [float(np.linalg.norm(arm, axis=-1).max()) for arm in (rows.antenna_m, rows.ranging_m)]
    longest = max(stage.platform.baseline_m, *arms)
    values, _ = _fitted(model, label)
    return bool(float(np.linalg.norm(values)) > USUAL_ARM * longest > 0.0)
