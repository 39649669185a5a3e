"""Whether the last run of a store could have shown a change that would turn the verdict.

A vehicle that stands still has no late places: a run of it bears out nothing of its latencies, and
an answer that nothing changed would be no answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from syncline_design.campaign.changes import REACH, Changes
from syncline_design.campaign.pool import Term
from syncline_design.campaign.trends import step_weight
from syncline_design.diagnosis.candidates import zero_values
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.result import Informative
from syncline_design.diagnosis.sight import DetectionLimit, informative
from syncline_design.effects.record import Array
from syncline_design.model.known import EffectEntry
from syncline_design.spec.case import Case


def sight(case: Case, changes: Changes, look: int, rate: float) -> Informative:
    """What a change with the last of `look` runs could be and not be seen."""
    if look < 2:
        return Informative(True)
    shown = tuple(_limits(case, changes, look, rate))
    return informative(promise_of(case), shown)


def _limits(case: Case, changes: Changes, look: int, rate: float) -> Iterator[DetectionLimit]:
    names = [stage.name for stage in case.spec.stages]
    for place, (term, known) in enumerate(zip(changes.terms, changes.tells(look), strict=True)):
        beyond = -math.log(rate * step_weight(look)) - float(changes.log_weights[place])
        yield from limits_of(term, names, _smallest(known, beyond))
    for term in changes.pool.untold:
        yield from limits_of(term, names)


def limits_of(
    term: Term, stages: Sequence[str], sizes: Array | None = None
) -> Iterator[DetectionLimit]:
    """Of every parameter of an effect the size (p,) from which on it shows; None: at no size."""
    values = tuple(zero_values(term.effect).items())
    entry = EffectEntry(term.effect.name, term.sensor, stages[term.stage], values)
    slopes = term.effect.slopes()
    shown = [math.inf] * len(slopes) if sizes is None else map(float, sizes)
    for p, size in zip(slopes, shown, strict=True):
        yield DetectionLimit(entry, p.name, size, p.high)


def _smallest(known: Array, beyond: float) -> Array:
    """Changes (p,) of one parameter each that reach so much evidence [nat] in half of such runs.

    N v^2 / 2 less what the width of the prior costs, log (1 + REACH^2) / 2, is `beyond`.
    """
    own = np.diag(known)
    needed = 2.0 * beyond + math.log1p(REACH**2)
    found: Array = np.sqrt(needed / np.where(own > 0.0, own, np.inf))
    return np.where(own > 0.0, found, math.inf)
