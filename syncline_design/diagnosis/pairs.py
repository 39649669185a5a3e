"""Two effects together: that nearly undo each other, or that look like a third one.

A delay and an arm that cancel but for the turns of a drive leave little for each of them alone.  A
delay and a range bias of a short drive are nearly an arm, which alone gains more than either.  To
first order two signatures together save g' M^-1 g / 2, g and M the score and the normal matrix of
both; what saves most is fitted, and pays for its freedom and for all pairs that were looked at: of
two in the place of one, each figure more costs half of log N (Schwarz 1978), as in `charges`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature, zero_values
from syncline_design.diagnosis.fitting import Data, Model, fit, solve_scaled
from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.noise import NoiseLevel
from syncline_design.diagnosis.scores import Gram, log_p_of, possible
from syncline_design.diagnosis.slow_states import States
from syncline_design.machine.quick_dataclass import dataclass

TRIED: Final = 2  # pairs that are fitted
SLACK_NATS, SLACK_SHARE = 6.0, 0.05  # by which first order may be too hard on a pair
CLEAR_NATS: Final = 4.5  # by which two have to be better than one beyond what their figures cost
SignaturePair = tuple[Signature, Signature]


@dataclass(frozen=True, slots=True)
class Promising:
    """Two signatures, the noise level under which they save most, and log p of that by chance."""

    pair: SignaturePair
    level: NoiseLevel
    log_p: float


@dataclass(frozen=True, slots=True)
class InOnesPlace:
    """Two signatures in the place of one, the noise level under which they do best against it, and
    what they save more there [nat]."""

    pair: SignaturePair
    level: NoiseLevel
    more: float


def promising(
    scores: Sequence[tuple[NoiseLevel, Gram]], free: Sequence[Signature], limit: float
) -> list[Promising]:
    """Pairs of which chance saves as much with a log p below the limit, the least likely first.

    scores: under several noise levels, of the signatures `free`; a pair counts by its best one.
    """
    pairs = _pairs(free)
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


def in_the_place(
    scores: Sequence[tuple[NoiseLevel, Gram]],
    free: Sequence[Signature],
    label: Label,
    worth: Callable[[int], float],
) -> list[InOnesPlace]:
    """Pairs that may save clearly more than the one effect of a label; the best first.

    One effect fits in its own noise no worse than in that of the two, so these gain no more on it
    than they save there, but for the slack.  worth: what that has to be, by the figures that they
    have more [nat].  scores: of all in `free`, that effect among them, where it is taken out of the
    model.  A wave or a line of a spectrum was sought by its frequency and is not: no two departures
    stand for it.
    """
    alone = [k for k, s in enumerate(free) if s.candidate.label == label]
    if not alone:
        return []
    figures = free[alone[0]].columns.shape[2]
    others = [one for one in _pairs(free) if all(free[k].candidate.label != label for k in one)]
    pairs = [(one, worth(_freedom(free, one) - figures)) for one in others]
    best: dict[tuple[int, int], tuple[float, NoiseLevel]] = {}
    for level, gram in scores:
        gains = gram.gains()
        own = max(gains[k][0] for k in alone)
        least = own - max(SLACK_NATS, SLACK_SHARE * own)
        for one, wanted in pairs:
            found = _joint(gram, free, one)
            more = -math.inf if found is None or found <= least + wanted else found - own
            if more > best.get(one, (-math.inf,))[0]:
                best[one] = more, level
    ranked = sorted(best.items(), key=lambda entry: (-entry[1][0], entry[0]))
    return [InOnesPlace((free[one[0]], free[one[1]]), level, more) for one, (more, level) in ranked]


def clearly_two(data: Data, two: Model, one: Model, free: Sequence[Signature]) -> bool:
    """Whether two effects in the place of one fit better by more than their figures and luck."""
    figures = len(two.covariance) - len(one.covariance)
    return one.nll - two.nll > clear_nats(data, free, figures)


def clear_nats(data: Data, free: Sequence[Signature], figures: int) -> float:
    """By how much two have to fit better than one, for so many figures that they have more."""
    each = 0.5 * math.log(max(len(data.view) * len(data.axes), 2))
    return CLEAR_NATS + figures * each + math.log(max(len(_pairs(free)), 1))


def _pairs(free: Sequence[Signature]) -> list[tuple[int, int]]:
    """Of what is asked jointly, whatever two."""
    return list(combinations([k for k, s in enumerate(free) if s.asked_jointly], 2))


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


def with_pair(data: Data, model: Model, found: Promising | InOnesPlace) -> Model:
    """The model with both, fitted from zero by re-simulation."""
    started = tuple(
        s.candidate.acting({**zero_values(s.candidate.effect, s.at), **s.start}) for s in found.pair
    )
    return fit(data, (*model.acting, *started), model.opened, start=found.level)
