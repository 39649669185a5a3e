"""What may have another value in every run: an effect as a whole, or one of its parameters alone.

A datum that is set out anew every day may differ to the north alone.  Held as one of three values
it would differ by a third of what it does, and a day that is nothing out of the common would pass
for a change.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from syncline_design.campaign.pool import Index, Term
from syncline_design.campaign.run_records import SameSize
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class EffectPart:
    """An effect, by its place among all, with those of its parameters that are meant, by their
    places in it (own) and among all of the pool (index); share: of the odds of its effect."""

    place: int
    term: Term
    own: Index
    share: float

    @property
    def index(self) -> Index:
        return self.term.index[self.own]

    @property
    def log_share(self) -> float:
        return math.log(self.share)

    def values(self, own: Array) -> Array:
        """Values (p,) of the whole effect, 0 of all other parameters."""
        found = np.zeros(self.term.size)
        found[self.own] = own
        return found

    def covariance(self, own: Array) -> Array:
        """Covariance (p, p) of the whole effect, 0 of all other parameters."""
        found = np.zeros((self.term.size, self.term.size))
        found[np.ix_(self.own, self.own)] = own
        return found


def parts_of(terms: Sequence[Term]) -> tuple[EffectPart, ...]:
    """The effects as a whole in their order, then single parameters of those that have several:
    each of these two kinds as likely as the other."""
    whole = [
        EffectPart(k, t, np.arange(t.size), 0.5 if t.size > 1 else 1.0) for k, t in enumerate(terms)
    ]
    return (*whole, *_singles(terms))


def _singles(terms: Sequence[Term]) -> Iterator[EffectPart]:
    for k, term in enumerate(terms):
        if term.size > 1:
            yield from (
                EffectPart(k, term, np.array([j]), 0.5 / term.size) for j in range(term.size)
            )


def with_singles(groups: Sequence[SameSize], parts: Sequence[EffectPart]) -> tuple[SameSize, ...]:
    """Groups of effects, and one of the single parameters, by their places among the parts."""
    first = sum(len(group.terms) for group in groups)
    singles = [part.index for part in parts[first:]]
    if not singles:
        return tuple(groups)
    return (*groups, SameSize(np.arange(first, len(parts)), np.array(singles)))
