"""Which effect differs from run to run beyond noise and beyond any one change (`changes`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.parts import EffectPart
from syncline_design.campaign.pool import inverted
from syncline_design.campaign.run_records import Differing, SameSize
from syncline_design.campaign.scatter import RunScatter
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

SCATTERED: Final = 3.0  # standard deviations of Q beyond which runs clearly differ
MOSTLY: Final = 0.8  # of what one differs by that another would explain in its place
MOST_OTHERS: Final = 3
MOST_SCATTERED: Final = 2  # effects that are freed in every run
MOST_FREED: Final = 4  # of them and their single parameters
MOST_TRIED: Final = 12  # parts that differ most clearly, of which the likeliest is looked for


def may_be_freed(one: Differing, freed: Sequence[Differing]) -> bool:
    """Whether one more is freed in every run beside those that are."""
    labels = {each.term.label for each in (*freed, one)}
    return len(labels) <= MOST_SCATTERED and len(freed) < MOST_FREED


def clearly_differing(
    parts: Sequence[EffectPart],
    groups: Sequence[SameSize],
    normal: Array,
    scatters: Sequence[RunScatter],
    most: Sequence[RunScatter],
    likelier: Callable[[Sequence[EffectPart]], Array],
) -> Differing | None:
    """The effect, or the one parameter of it, that differs most likely of those that clearly differ
    from run to run; None where noise would do.  One change of it is none, of any course that the
    scatters know.

    normal (look, P, P): information of the runs; scatters: by group.  most: before any change was
    taken off, by which they differ at most.  likelier: log of how much likelier the runs are where
    some parts differ so than where none does, and of the odds of it.
    """
    if not parts:
        return None
    found = _scatter_of(len(parts), groups, scatters, most)
    clear = [int(k) for k in np.argsort(-found.clear)[:MOST_TRIED] if found.clear[k] > SCATTERED]
    if not clear:
        return None
    own = dict(zip(clear, likelier([parts[k] for k in clear]), strict=True))
    best = max(clear, key=lambda k: own[k])
    alike = [k for k in clear if own[k] >= own[best] - AS_GOOD_NATS]
    named = min(alike, key=lambda k: (commonness(parts[k].term.label), -own[k]))
    most_of_it = MOSTLY * float(found.beyond.max())
    near = [int(k) for k in np.argsort(-found.beyond) if found.beyond[k] >= most_of_it]
    others = {parts[k].term.label: parts[k].term for k in near}
    others.pop(parts[named].term.label, None)
    usual = normal.mean(axis=0)
    return Differing(
        parts[best].term,
        _covariance(usual, parts[best], float(found.excess[best])),
        parts[named].term,
        _covariance(usual, parts[named], float(found.excess[named])),
        float(found.log_p[named]) + math.log(len(parts)),
        tuple(others.values())[:MOST_OTHERS],
    )


@dataclass(frozen=True, slots=True)
class _Scatter:
    """Of every part: Q over what it is by chance and the same in its standard deviations, its
    variance beyond noise, and log of the chance of it, (U,) each."""

    beyond: Array
    clear: Array
    excess: Array
    log_p: Array


def _scatter_of(
    count: int,
    groups: Sequence[SameSize],
    scatters: Sequence[RunScatter],
    most: Sequence[RunScatter],
) -> _Scatter:
    beyond, clear, excess, log_p = (np.zeros(count) for _ in range(4))
    for g, scatter, alone in zip(groups, scatters, most, strict=True):
        least, free = scatter.square.min(axis=0), scatter.free.min(axis=0)
        beyond[g.terms] = np.where(free > 0.0, least - free, 0.0)
        clear[g.terms] = (least - free) / np.sqrt(2.0 * np.maximum(free, 1.0))
        # the least of so many is less than scatter leaves, by some 2 log of them as chi-square goes
        searched = np.maximum(free - 2.0 * math.log(len(scatter.square)), 1.0)
        whole = alone.square[-1] / np.maximum(alone.free[-1], 1)
        excess[g.terms] = np.where(free > 0.0, np.minimum(least / searched, whole), 0.0) - 1.0
        pairs = zip(least, free, strict=True)
        log_p[g.terms] = [log_p_of(float(q), int(f)) if f > 0.0 else 0.0 for q, f in pairs]
    return _Scatter(beyond, clear, excess, log_p)


def _covariance(usual: Array, part: EffectPart, excess: float) -> Array:
    """Covariance (p, p) of an effect by which a part of it differs beyond noise."""
    own = inverted(usual[np.ix_(part.index, part.index)])
    return part.covariance(max(excess, 0.0) * own)
