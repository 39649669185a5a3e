"""Whether two effects are told apart, by what a drive tells of both."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.planning.information import canonical_correlation, noncentrality, schur
from syncline_design.planning.wanted import PairGoal

NONCENTRALITY: Final = 60.0  # at which a rival fits worse by more than 15 nat nine times in ten
LEAST_SEEN: Final = 1e-9  # of a parameter's information, below which a rival makes all of it
SAME: Final = 0.99  # correlation above which two effects stay one class


def pair_ratio(information: Array, pair: PairGoal) -> float:
    """1 or less where the better of two effects beats its rival, however that is refitted."""
    found = noncentrality_of(information, pair)
    ratio = math.sqrt(NONCENTRALITY / max(found, 1e-9))
    correlation = canonical_correlation(information, pair.first, pair.second)
    blocked = 0.0 if pair.known else (correlation / SAME) ** 8
    return max(ratio, blocked if correlation > SAME else 0.0)


def noncentrality_of(information: Array, pair: PairGoal) -> float:
    """Of the effect named first where its size is known, beyond first order where that can be;
    else of the weaker of the two."""
    first = noncentrality_of_first(information, pair)
    return first if pair.known else min(first, noncentrality_of_second(information, pair))


def noncentrality_of_first(information: Array, pair: PairGoal) -> float:
    """Of the effect named first over its rival; without a known size in its least visible
    direction."""
    if pair.beyond is not None:
        own, rival = pair.beyond
        return max(float(schur(information, (own,), rival)[0, 0]), 0.0)
    if pair.known:
        return float(pair.sizes @ schur(information, pair.first, pair.second) @ pair.sizes)
    return noncentrality(information, pair.first, pair.second, pair.sizes)


def noncentrality_of_second(information: Array, pair: PairGoal) -> float:
    """The other way about: of the effect named second, at a size that matters, over the first."""
    return noncentrality(information, pair.second, pair.first, pair.second_sizes)


def told_from(information: Array, pair: PairGoal) -> Array:
    """Sizes [SI] of the effect named first, each parameter alone, from which it is told apart (p,);
    infinite for what is never told.

    To first order the noncentrality of one of size v is v^2 (G_AA - G_AB G_BB^-1 G_BA)_kk, so that
    two effects whose correlation makes them one class are told apart all the same where one is
    large.
    """
    alone = np.diag(schur(information, pair.first, pair.second))
    seen = alone > LEAST_SEEN * np.diag(information)[list(pair.first)]
    return np.where(seen, np.sqrt(NONCENTRALITY / np.where(seen, alone, 1.0)), np.inf)
