"""Effects that act in a part of a log only: a latency under load, a layer of other water.

A candidate is tried in every stretch of a log that some blocks make up, beside the slow states:
    e = 1[a <= t < b] X b_in + X b_out 1[else] + states + w,
and in its best one it has to stand up in noise of another kind, like all that moves the mean,
paid for the number of stretches.  What acts all along and shows no sign of it outside is cut to its
stretch in the same way.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from syncline_design.diagnosis.candidates import Signature, slopes
from syncline_design.diagnosis.fitting import Model, fit
from syncline_design.diagnosis.noise import NoiseLevel, precision
from syncline_design.diagnosis.positive import inverse as inverse_of
from syncline_design.diagnosis.slow_states import BLOCKS, INSIDE, LEAST_ROWS, States, fitted_of
from syncline_design.diagnosis.spans import StampSpan, cut_to, cuttable, span_of
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import NORMAL_95, NORMAL_999

LEAST, MOST = 2, 13  # blocks of a stretch, of the states' sixteen
STRETCHES = sum(BLOCKS - k + 1 for k in range(LEAST, MOST + 1))
NATS = 4.5  # by which a stretch has to be better than the whole log, beside paying for the search
EDGES, PLACES, ROUNDS = 1.5, 13, 4  # blocks by which an end may move; places tried; how often
REFITS = 2
GONE = 0.25  # of its size inside, which an effect may have outside and still live inside alone
SURE = 2.0  # standard uncertainties of that


@dataclass(frozen=True, slots=True)
class FoundPart:
    """A stretch in blocks [first, last): nat by which it is better than the whole log."""

    first: int
    last: int
    gain: float
    better: float


@dataclass(frozen=True, slots=True)
class PartSums:
    """X'X (G, m, m) and X'e (G, m) of every block: free columns, then slow courses with a prior.

    prior (m,): precision, zero of what is free; free: how many those are.
    """

    normal: Array
    score: Array
    prior: Array
    free: int

    def best(self, column: Array, rest: Array, known: float) -> FoundPart:
        """The stretch in which a column is worth most; `known` of it is taken out already.

        column (m,): made of these columns; rest: which of them are beside it, in all of the log.
        """
        across = self.normal @ column
        normal = np.concatenate([(across @ column)[:, None], across[:, rest]], axis=1)
        score = self.score @ column + normal[:, 0] * known
        beside = np.sum(self.score + known * across, axis=0)[rest]
        held = np.sum(self.normal, axis=0)[np.ix_(rest, rest)] + np.diag(self.prior[rest])
        return _best(normal, score, (held, beside))


def blocks_of(states: States, model: Model, free: Sequence[Array]) -> PartSums:
    """Sums over the blocks of the model's own columns, of others (n, 3, p), and of the courses."""
    own = np.nan_to_num(slopes(states.data.view, model.acting))
    every = np.concatenate([own, *free, states.courses], axis=2)
    width = every.shape[2] - states.courses.shape[2]
    return PartSums(*states.sums_of(model, every, width), width)


def _best(normal: Array, score: Array, others: tuple[Array, Array]) -> FoundPart:
    """Of a column's sums by block with itself and the others (G, m), with the error (G,).

    others: their normal matrix with their prior, and their score.
    """
    count = normal.shape[0]
    rest, beside = others
    scale = np.sqrt(np.maximum(np.diag(rest), 1e-300))
    inverse = inverse_of(rest / scale[:, None] / scale, 1e-12) / scale[:, None] / scale
    sums = np.concatenate([np.zeros((1, normal.shape[1])), np.cumsum(normal, axis=0)])
    right = np.concatenate([[0.0], np.cumsum(score)])
    tried = np.array([(0, count), *_pairs(count)])
    first, last = tried.T
    inside = sums[last] - sums[first]
    across = inside[:, 1:]
    left = inside[:, 0] - np.sum((across @ inverse) * across, axis=1)
    told = right[last] - right[first] - across @ (inverse @ beside)
    seen = left > 1e-7 * max(sums[-1, 0], 1e-300)
    gains = np.where(seen, 0.5 * told**2 / np.where(seen, left, 1.0), 0.0)
    best = 1 + int(np.argmax(gains[1:]))
    better = float(gains[best] - gains[0])
    return FoundPart(int(first[best]), int(last[best]), float(gains[best]), better)


@cache
def _pairs(count: int) -> tuple[tuple[int, int], ...]:
    """Stretches [first, last) of so many blocks."""
    ends = itertools.combinations(range(count + 1), 2)
    return tuple((a, b) for a, b in ends if LEAST <= b - a <= MOST)


def in_a_part(
    states: States,
    model: Model,
    free: Sequence[Signature],
    limit: float,
    levels: Sequence[NoiseLevel],
) -> list[Signature]:
    """What acts in a stretch alone, each in its own: of effects that may come and go.

    limit: log p that one of the candidates falls below by chance, a stretch being one of many.
    levels: noise to look for its ends in; what is fitted while it is missing has swallowed it.
    """
    asked = [s for s in free if s.candidate.effect.passing and cuttable(s.candidate.effect)]
    if not states.has_parts or not asked:
        return []
    found = []
    columns = [np.nan_to_num(one.columns) for one in asked]
    blocks = blocks_of(states, model, columns)
    size, width = len(blocks.prior), blocks.free - len(asked)
    rest = np.r_[0:width, blocks.free : size]
    for k, (one, column) in enumerate(zip(asked, columns, strict=True)):
        best = blocks.best(np.eye(size)[width + k], rest, 0.0)
        if best.better < NATS + math.log(STRETCHES):
            continue
        ends = (_span_at(states, model, one, best, column, level) for level in levels)
        spans = {(span.from_s, span.to_s): span for span in ends}  # often the same
        log_p, cut = min(
            (_judged(states, model, one, span) for span in spans.values()),
            key=lambda pair: pair[0],
        )
        if log_p + math.log(STRETCHES) < limit:
            found.append(cut)
    return found


def in_a_part_of_white(
    states: States, model: Model, free: Sequence[Signature], least: float, level: NoiseLevel
) -> list[Signature]:
    """What acts in a stretch alone and would be worth more than `least` nat there, were noise
    white, and more than in the whole log.

    Slow courses take the shape of whatever begins and ends: here they are not there at all.
    """
    asked = [s for s in free if s.candidate.effect.passing and cuttable(s.candidate.effect)]
    if not states.has_parts or not asked:
        return []
    columns = [np.nan_to_num(one.columns) for one in asked]
    blocks = blocks_of(states, model, columns)
    own = blocks.free - len(asked)
    found = []
    for k, (one, column) in enumerate(zip(asked, columns, strict=True)):
        best = blocks.best(np.eye(len(blocks.prior))[own + k], np.r_[0:own], 0.0)
        if best.gain < least or best.better < NATS + math.log(STRETCHES):
            continue
        span = _span_at(states, model, one, best, column, level)
        found.append(cut_to(span, one, states.data.view.log.time_s))
    return found


def _span_at(
    states: States,
    model: Model,
    one: Signature,
    best: FoundPart,
    column: Array,
    level: NoiseLevel,
) -> StampSpan:
    """The stretch of an effect (n, 3, 1) as a noise level shows it."""
    by_level = replace(model, precision=precision(states.data.structure, level))
    return _span(states, by_level, one.candidate.effect, column[:, :, 0], best)


def _judged(
    states: States, model: Model, one: Signature, span: StampSpan
) -> tuple[float, Signature]:
    """(log p of the effect in a stretch, its signature there)."""
    cut = cut_to(span, one, states.data.view.log.time_s)
    (judged,) = _within(states, span).judged(model, [cut.columns])
    return judged.log_p, cut


def cut_down(states: States, model: Model) -> Model:
    """The model with every effect that shows no sign of itself outside a stretch cut to that."""
    if not states.has_parts:
        return model
    blocks: PartSums | None = None
    for label in [a.label for a in model.acting]:
        one = next(a for a in model.acting if a.label == label)
        if not cuttable(one.effect):
            continue
        blocks = blocks or blocks_of(states, model, ())
        best = blocks.best(*_columns_of(model, one, len(blocks.prior)), 1.0)
        if best.better < NATS + math.log(STRETCHES):
            continue
        shape = np.nan_to_num(slopes(states.data.view, (one,))) @ fitted_of(one)
        span = _span(states, model, one.effect, shape, best, 1.0)
        trial = _exchanged(states, model, one, span)
        if model.nll - trial.nll > NATS + math.log(STRETCHES) and _alone(states, trial, one, span):
            model, blocks = trial, None
    return model


def _columns_of(model: Model, one: Acting, count: int) -> tuple[Array, Array]:
    """One effect's shape made of `count` columns, the model's own first, and which are not its."""
    at = 0
    for a in model.acting:
        width = len(fitted_of(a))
        if a.label == one.label:
            break
        at += width
    column = np.zeros(count)
    column[at : at + width] = fitted_of(one)
    return column, np.delete(np.arange(count), np.s_[at : at + width])


def refined(states: States, model: Model) -> Model:
    """The model with the ends of its newest effect's stretch found anew, in the noise it leaves."""
    for _ in range(REFITS):
        one = model.acting[-1]
        span = span_of(one.effect)
        if span is None:
            break
        whole = replace(one, effect=span.effect)
        shape = np.nan_to_num(slopes(states.data.view, (whole,))) @ fitted_of(one)
        known = span.mask(states.data.view.log.time_s)
        blocks = _blocks(states, span)
        trial = _exchanged(
            states, model, one, _span(states, model, span.effect, shape, blocks, known)
        )
        if not trial.nll < model.nll:
            break
        model = trial
    return model


def _blocks(states: States, span: StampSpan) -> FoundPart:
    inside = states.block[span.mask(states.data.view.log.time_s) > 0.0]
    return FoundPart(int(inside[0]), int(inside[-1]) + 1, 0.0, 0.0)


def _exchanged(states: States, model: Model, one: Acting, span: StampSpan) -> Model:
    """The model with an effect cut to a stretch, fitted again."""
    cut = replace(one, effect=span.cut)
    acting = tuple(cut if a.label == one.label else a for a in model.acting)
    return fit(states.data, acting, model.opened, start=model.level)


def _alone(states: States, model: Model, one: Acting, span: StampSpan) -> bool:
    """Whether the effect inside differs from that outside, which is next to nothing."""
    data = states.data
    own = next(a for a in model.acting if a.label == one.label)
    signature = (np.nan_to_num(slopes(data.view, (replace(one, values=own.values),)))
                 @ fitted_of(own))  # fmt: skip
    outside = signature * (1.0 - span.mask(data.view.log.time_s))[:, None]
    if not np.any(outside):
        return False
    (judged,) = states.judged(model, [outside[:, :, None]])
    size, spread = abs(float(judged.values[0])), float(judged.spread[0])
    sure = 1.0 - size > _coverage(judged.coverage) * spread
    return sure and size < max(GONE, SURE * spread)


def _coverage(of_95: float) -> float:
    """Standard uncertainties of one chance in a thousand, from those of one in twenty (normal)."""
    return of_95 * NORMAL_999 / NORMAL_95


def _span(
    states: States,
    model: Model,
    effect: Effect,
    shape: Array,
    found: FoundPart,
    known: Array | float = 0.0,
) -> StampSpan:
    """The stretch to the row: its ends by turns where the effect (n, 3) saves most, ever finer.

    known (n,): how much of the effect is taken out of each row already.
    """
    time_s = states.data.view.log.time_s
    rows = np.flatnonzero((states.block >= found.first) & (states.block < found.last))
    ends = [int(rows[0]), int(rows[-1]) + 1]
    error = model.error + np.broadcast_to(known, time_s.shape)[:, None] * shape
    weighted = model.precision.solve(error[:, :, None])[:, :, 0]
    reach = EDGES * len(time_s) / states.count
    for _ in range(ROUNDS):
        for end in (0, 1):
            near = np.unique(np.round(ends[end] + reach * np.linspace(-1.0, 1.0, PLACES)))
            low, high = ((0, ends[1] - LEAST_ROWS), (ends[0] + LEAST_ROWS, len(time_s)))[end]
            near = near[(near >= low) & (near <= high)].astype(int)
            tried = [(int(k), ends[1]) if end == 0 else (ends[0], int(k)) for k in near]
            if tried:
                gains = _gains(model, weighted, shape, tried)
                ends = list(tried[int(np.argmax(gains))])
        reach = max(2.0 * reach / (PLACES - 1), 1.0)
    return StampSpan(effect, float(time_s[ends[0]]), float(time_s[ends[1] - 1]))


def _gains(model: Model, weighted: Array, shape: Array, tried: list[tuple[int, int]]) -> Array:
    """nat that the effect saves from one row to before another; weighted: C^-1 e (n, 3)."""
    row = np.arange(shape.shape[0])
    masks = np.stack([((row >= a) & (row < b)).astype(float) for a, b in tried], axis=1)
    columns = shape[:, :, None] * masks[:, None, :]
    own = model.precision.squares(columns)
    score = np.sum(columns * weighted[:, :, None], axis=(0, 1))
    gains: Array = 0.5 * score**2 / np.maximum(own, 1e-300)
    return gains


def _within(states: States, span: StampSpan) -> States:
    return states.within(span.mask(states.data.view.log.time_s) > 0.0, INSIDE)
