"""By what a run that stands alone is another, beside what its others say that changed.

Every effect may be another in that run alone.  The likeliest is told first, another where the
chance of what it explains by noise, all effects counted, is below the limit of a strange run; after
each, all of them are held against what could be in their place (`what_changed`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.possible_changes import PossibleChange, PossibleChanges
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.strangers import Departure, limit_of
from syncline_design.campaign.trends import Trend
from syncline_design.campaign.what_changed import MOST_CHANGES, commonest, refined
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, eq=False)
class OfOneRun(PossibleChanges):
    """What may be another in one run alone; fixed: what changed in the others, too."""

    fixed: tuple[PossibleChange, ...] = ()

    @property
    def alone(self) -> int:
        """Place of the trend that one run has."""
        return next(k for k, one in enumerate(self.trends) if one.is_of_one_run)

    def gains(self, beside: Sequence[PossibleChange]) -> Array:
        found = super().gains([*self.fixed, *beside])
        found[np.arange(len(found)) != self.alone] = -np.inf
        return found

    def log_chance(self, one: PossibleChange, beside: Sequence[PossibleChange]) -> float:
        """log of the chance that noise alone explains as much, all effects counted."""
        size = self.changes.terms[one.effect].size
        charged = float(self.gains(beside)[self.alone, one.effect]) + size
        weight = float(self.changes.log_weights[one.effect])
        square = 2.0 * (charged - weight - self.weight_of(self.trends[self.alone]))
        return log_p_of(max(square, 0.0), size) + float(np.log(len(self.changes.terms)))


def departures_beside(changes: Changes, run: int, seen: Sequence[Change]) -> tuple[Departure, ...]:
    """All in which a run, by its place, is another than what the others and their changes say."""
    place = {term.label: k for k, term in enumerate(changes.terms)}
    pulse = Trend("step", run, run + 1)
    fixed = tuple(PossibleChange(place[one.term.label], one.trend) for one in seen)
    needed = (pulse, *(one.trend for one in seen))
    possible = OfOneRun(changes, changes.pool.count, (), tuple(seen), needed, True, fixed)
    found: list[PossibleChange] = []
    while len(found) < MOST_CHANGES:
        one = commonest(changes, possible.trends, possible.gains(found))
        if possible.log_chance(one, found) >= limit_of(changes):
            break
        found = refined(possible, [*found, one])
    fitted = possible.values([*fixed, *found])[len(fixed) :]
    return tuple(_departure(possible, found, k, one) for k, one in enumerate(fitted))


def _departure(
    possible: OfOneRun, found: Sequence[PossibleChange], k: int, fitted: Change
) -> Departure:
    rest = [one for at, one in enumerate(found) if at != k]
    terms = possible.changes.terms
    others = tuple((terms[i], worse) for i, worse in possible.rivals(found, k))
    judged = Judged(fitted.values, possible.noise * fitted.covariance)
    return Departure(fitted.term, judged, possible.log_chance(found[k], rest), others)
