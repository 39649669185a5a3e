"""What a log would have shown: the smallest effect it would name, and where it is blind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, Signature, hidden_by_noise, zero_values
from syncline_design.diagnosis.consequence import SpecPromise, blind_spots
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.positive import pseudo_inverse
from syncline_design.diagnosis.result import BlindSpot, Informative, Smallest
from syncline_design.diagnosis.search import Search, SearchResult
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit, fisher_limit, student_limit
from syncline_design.model.known import EffectEntry
from syncline_design.model.normal import NEARLY_ALL


@dataclass(frozen=True, slots=True)
class DetectionLimit:
    """The smallest value of one parameter that is seen in half of such logs, and the one that is
    in nearly all of them, at most `most`; entry: all at zero; within: what this log leaves open."""

    entry: EffectEntry
    parameter: str
    smallest: float
    most: float
    sure: float = math.inf
    within: float = math.inf

    @property
    def record(self) -> Smallest:
        """As it is written; no value where even the largest would not be seen."""
        e, value = self.entry, self.smallest if self.smallest <= self.most else None
        sure = self.sure if self.sure <= self.most else None
        within = self.within if self.within <= self.most else None
        return Smallest(e.effect, e.sensor, e.stage, self.parameter, value, sure, within)


def smallest_seen(search: Search, result: SearchResult) -> tuple[DetectionLimit, ...]:
    """Of every effect that moves the mean, is not named and no other name's double, by parameter.

    Half of the logs with a true value v beat the threshold T of the statistic v^2 / V where
    v^2 = T V; V is the parameter's variance with the effect's others at zero.
    """
    model = result.model
    doubles = {
        one.candidate.label
        for compared in result.final.classes.values()
        for one in (*compared.aliases, *compared.lookalikes)
    }
    free = [
        s
        for s in search.proposals.free_signatures(model)
        if s.plain and s.candidate.label not in doubles
    ]
    judged = search.states.judged(model, [s.columns for s in free]) if free else []
    log_p = search.proposals.chance(len({s.candidate.label for s in search.signatures}))
    found: list[DetectionLimit] = []
    for s, one in zip(free, judged, strict=True):
        found += _of(search, s, one, log_p)
    hidden = hidden_by_noise(search.data.view, search.settings.exclude_effects)
    return (*found, *(blind for one in hidden for blind in _blind(search, one)))


def _entry(search: Search, one: Candidate) -> EffectEntry:
    stage = search.data.view.system.stages[one.stage]
    values = tuple(zero_values(one.effect).items())
    return EffectEntry(one.effect.name, one.sensor, stage.name, values)


def _blind(search: Search, one: Candidate) -> Iterator[DetectionLimit]:
    """No size of what follows values that are noise in this log shows in it."""
    for p in one.effect.slopes():
        yield DetectionLimit(_entry(search, one), p.name, math.inf, p.high)


def _of(search: Search, s: Signature, one: Judged, log_p: float) -> list[DetectionLimit]:
    effect, entry = s.candidate.effect, _entry(search, s.candidate)
    sizes = [_both(one.model, log_p)]
    sizes += [_both(covariance, log_p, count) for covariance, count in one.jackknives]
    size = np.max(sizes, axis=0)
    seen = np.diag(one.model) > 0.0
    values = [[float(v) if ok else math.inf for v, ok in zip(row, seen, strict=True)]
              for row in size]  # fmt: skip
    return [
        DetectionLimit(entry, p.name, half, p.high, sure, float(within))
        for p, half, sure, within in zip(effect.slopes(), *values, left_within(one), strict=True)
    ]


def left_within(one: Judged) -> Array:
    """Of every parameter the size |b| + t s that is not excluded at 19 of 20, (p,).

    s: its standard uncertainty, the effect's others free; t: of as many parts as it was found from.
    A departure as large as T, of either sign, leaves less than T in one log of 20: that is the
    test of equivalence (Schuirmann, J. Pharmacokinet. Biopharm. 15 (1987)).
    """
    counts = [count for _, count in one.jackknives]
    times = student_limit(0.05, min(counts) - 1) if counts else NEARLY_ALL
    found: Array = np.abs(one.values) + times * one.spread
    return np.where(one.spread > 0.0, found, math.inf)


def alone(covariance: Array, log_p: float, count: int = 0) -> Array:
    """Value of each parameter alone at which the statistic is at its threshold."""
    found: Array = _both(covariance, log_p, count)[0]
    return found


def _both(covariance: Array, log_p: float, count: int = 0) -> Array:
    """Value of each parameter alone at which the statistic is at its threshold T, and the one at
    which it is beyond it in 19 of 20 logs, (2, p).

    The statistic's root is normal of unit variance (of several degrees of freedom it is larger):
    sqrt(v^2 / V) = sqrt(T) + 1.645.
    """
    freedom = max(int(np.sum(np.diag(covariance) > 0.0)), 1)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    inverse = pseudo_inverse(covariance / scale[:, None] / scale, 1e-10)
    alone = np.diag(inverse) / scale**2
    chance = math.exp(log_p)
    if count:
        own = count - freedom
        limit = fisher_limit(chance, freedom, own) * freedom * (count - 1) / own
    else:
        limit = float(chi_square_limit(chance, freedom))
    roots = np.array([[math.sqrt(limit)], [math.sqrt(limit) + NEARLY_ALL]])
    sizes: Array = roots / np.sqrt(np.maximum(alone, 1e-300))
    return sizes


def informative(promise: SpecPromise | None, shown: Sequence[DetectionLimit]) -> Informative:
    """Whether every effect that would turn a requirement would have been seen."""
    asked = [(one.entry, one.parameter, one.smallest, one.most) for one in shown]
    most = {(one.entry, one.parameter): one.most for one in shown}
    blind = tuple(
        BlindSpot(
            e.effect, e.sensor, e.stage, name, smallest if smallest <= most[e, name] else None, at
        )
        for e, name, smallest, at in blind_spots(promise, asked)
    )
    return Informative(not blind, blind)
