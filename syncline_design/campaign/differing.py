"""Which effect differs from run to run beyond noise and beyond any one change (`changes`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.pool import Term, inverted
from syncline_design.campaign.run_records import Differing, SameSize
from syncline_design.campaign.scatter import RunScatter
from syncline_design.diagnosis.candidates import commonness
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Array

SCATTERED: Final = 3.0  # standard deviations of Q beyond which runs clearly differ
MOSTLY: Final = 0.8  # of what one differs by that another would explain in its place
MOST_OTHERS: Final = 3
AS_CLEAR: Final = 2.0  # standard deviations of Q by which effects differ as clearly


def _own_covariance(normal: Array, term: Term) -> Array:
    """Covariance (p, p) of one effect alone, by an information matrix."""
    return inverted(normal[np.ix_(term.index, term.index)])


def clearly_differing(
    terms: Sequence[Term],
    groups: Sequence[SameSize],
    normal: Array,
    scatters: Sequence[RunScatter],
    most: Sequence[RunScatter],
) -> Differing | None:
    """The effect that differs most clearly from run to run; None where noise would do.  One change
    of it is none, of any course that the scatters know.

    normal (look, P, P): information of the runs; scatters: by group.  most: before any change was
    taken off, by which they differ at most.
    """
    if not terms:
        return None
    clear, excess, chance, beyond = (np.zeros(len(terms)) for _ in range(4))
    for g, scatter, alone in zip(groups, scatters, most, strict=True):
        least, free = scatter.square.min(axis=0), scatter.free.min(axis=0)
        clear[g.terms] = (least - free) / np.sqrt(2.0 * np.maximum(free, 1.0))
        # the least of so many is less than scatter leaves, by some 2 log of them as chi-square goes
        searched = np.maximum(free - 2.0 * math.log(len(scatter.square)), 1.0)
        whole = alone.square[-1] / np.maximum(alone.free[-1], 1)
        excess[g.terms] = np.where(free > 0.0, np.minimum(least / searched, whole), 0.0) - 1.0
        beyond[g.terms] = np.where(free > 0.0, least - free, 0.0)
        pairs = zip(least, free, strict=True)
        chance[g.terms] = [log_p_of(float(q), int(f)) if f > 0.0 else 0.0 for q, f in pairs]
    best = int(np.argmax(clear))
    if not clear[best] > SCATTERED:
        return None
    alike = np.flatnonzero(clear > clear[best] - AS_CLEAR)
    named = min(map(int, alike), key=lambda k: commonness(terms[k].label))
    usual = normal.mean(axis=0)
    others = [int(k) for k in np.argsort(-beyond) if beyond[k] >= MOSTLY * beyond.max()]
    return Differing(
        terms[best],
        excess[best] * _own_covariance(usual, terms[best]),
        terms[named],
        excess[named] * _own_covariance(usual, terms[named]),
        float(chance[named]) + math.log(len(terms)),
        tuple(terms[k] for k in others if k != named)[:MOST_OTHERS],
    )
