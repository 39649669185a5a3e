"""Two effects that nearly undo each other: neither shows alone, both together do.

A delay and an arm that cancel but for the turns of a drive leave little for each of them alone.  To
first order two signatures together save g' M^-1 g / 2, g and M the score and the normal matrix of
both; what saves most is fitted, and pays for its freedom and for all pairs that were looked at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature, zero_values
from syncline_design.diagnosis.fitting import Data, Model, fit, solve_scaled
from syncline_design.diagnosis.noise import NoiseLevel
from syncline_design.diagnosis.scores import Gram, log_p_of, possible
from syncline_design.diagnosis.slow_states import States
from syncline_design.machine.quick_dataclass import dataclass

TRIED: Final = 2  # pairs that are fitted
SignaturePair = tuple[Signature, Signature]


@dataclass(frozen=True, slots=True)
class Promising:
    """Two signatures, the noise level under which they save most, and log p of that by chance."""

    pair: SignaturePair
    level: NoiseLevel
    log_p: float


def promising(
    scores: Sequence[tuple[NoiseLevel, Gram]], free: Sequence[Signature], limit: float
) -> list[Promising]:
    """Pairs of which chance saves as much with a log p below the limit, the least likely first.

    scores: under several noise levels, of the signatures `free`; a pair counts by its best one.
    """
    asked = [k for k, s in enumerate(free) if s.plain and s.candidate.effect.asked_jointly]
    pairs = list(combinations(asked, 2))
    best: dict[tuple[int, int], Promising] = {}
    for level, gram in scores:
        for one in pairs:
            found = _joint(gram, free, one)
            if found is None:
                continue
            log_p = log_p_of(2.0 * found, _freedom(free, one)) + math.log(len(pairs))
            if log_p < limit and (one not in best or log_p < best[one].log_p):
                best[one] = Promising((free[one[0]], free[one[1]]), level, log_p)
    return sorted(best.values(), key=lambda each: each.log_p)


def _freedom(free: Sequence[Signature], one: tuple[int, int]) -> int:
    return sum(free[k].columns.shape[2] for k in one)


def _joint(gram: Gram, free: Sequence[Signature], one: tuple[int, int]) -> float | None:
    """NLL that both save together [nat]; None where the values are none that they can have."""
    at = np.concatenate([np.arange(gram.groups[k].start, gram.groups[k].stop) for k in one])
    values = solve_scaled(gram.normal[np.ix_(at, at)], gram.score[at])
    first = gram.groups[one[0]].stop - gram.groups[one[0]].start
    if not (possible(free[one[0]], values[:first]) and possible(free[one[1]], values[first:])):
        return None
    return 0.5 * float(gram.score[at] @ values)


def standing(states: States, model: Model, found: Sequence[Promising], limit: float
             ) -> list[Promising]:  # fmt: skip
    """The pairs that noise of another kind than the model's would not show by chance either."""
    if not found:
        return []
    both = [np.concatenate([s.columns for s in one.pair], axis=2) for one in found]
    judged = states.judged(model, both)
    return [one for one, j in zip(found, judged, strict=True) if j.log_p < limit]


def with_pair(data: Data, model: Model, found: Promising) -> Model:
    """The model with both, fitted from zero by re-simulation."""
    started = tuple(
        s.candidate.acting({**zero_values(s.candidate.effect, s.at), **s.start}) for s in found.pair
    )
    return fit(data, (*model.acting, *started), model.opened, start=found.level)
