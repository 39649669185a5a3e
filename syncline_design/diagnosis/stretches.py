"""What acts in a stretch of a log, however short: a delay of one second, a mount that slips.

Every candidate is asked in windows of several lengths, at every place:
    e = X b + w inside the window,   b = (X' W X)^-1 X' W e,
W the inverse of the spec's white noise, and its square b' (X' W X) b is held against the noise that
the log itself has at that length: the median of the squares of short windows over that of
chi-square, which a fault of a stretch does not raise, grown with the length as in logs drawn from
the fitted noise, and at least what the median of such windows shows beyond chance; and against
what the candidate leaves in the window, which outliers raise.  A window pays for the lengths and
for the places of its length (Bonferroni).
Sources: median of squares as a robust variance: Huber, Robust Statistics (1981), ch. 5; windows of
all lengths, each paying for its own number: Duembgen and Spokoiny, Ann. Statist. 29 (2001).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2, f

from syncline_design.diagnosis.candidates import Candidate, Signature, commonness, zero_values
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.fitting import Data, Model, adjusted
from syncline_design.diagnosis.noise import as_specified, precision, white_covariance
from syncline_design.diagnosis.scores import clean_errors
from syncline_design.diagnosis.spans import Span, cut_to, cuttable
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array

MOST_BLOCKS: Final = 1200  # that windows are made of; of a longer log several rows each
LEAST_ROWS: Final = 3  # of a window
GROWTH: Final = math.sqrt(2.0)  # from one length to the next
LONGEST: Final = 0.5  # of the log; what acts longer than that is looked for by the search
DRAWS: Final = 6  # logs drawn from the fitted noise
STREAM: Final = 23  # key of their draws
FEW: Final = 8.0  # windows side by side, below which their median says nothing
MEDIAN_SPREAD: Final = 2.33  # of the median of m squares of a normal, relative: over root m
PLACES: Final = 3.0  # windows that differ, for one that does not overlap
DOUBT: Final = 0.005  # chance that a sound log has such a window, of one candidate: a doubt
SURE: Final = 1e-4  # the same: it acts there
NEARLY_ALL: Final = 1.6449  # standard deviations below which 5 % lie
NEARLY_ALL_PLACES: Final = 0.05  # of the windows show less than is told
AS_GOOD_NATS: Final = 4.5  # within which candidates of a window are not told apart
LOUDER: Final = 1.5  # variance in a window over the usual one, up to which it is usual
ASKED: Final = ("latency", "lever_arm", "mounting")  # kinds of assumptions
Label = tuple[str, str, int]


@dataclass(frozen=True, slots=True)
class Stands:
    """A candidate that stands out from one stamp to another.

    values and spreads by its parameters; log_p: log of the chance that a sound log shows as much
    anywhere; sure: whether that is beyond doubt; others: what fits there as well.
    """

    label: Label
    stage: str
    from_s: float
    to_s: float
    parameters: tuple[str, ...]
    values: tuple[float, ...]
    spreads: tuple[float, ...]
    log_p: float
    sure: bool
    others: tuple[Label, ...] = ()


@dataclass(frozen=True, slots=True)
class ShownSize:
    """The size of one parameter that 19 of 20 such logs would have shown, by how long it acts.

    lengths_s rising; sizes falling.  label, stage: the effect's.
    """

    label: Label
    stage: str
    parameter: str
    unit: str
    most: float
    lengths_s: tuple[float, ...]
    sizes: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Stretches:
    """What stands out, the clearest first, and what would have."""

    stands: tuple[Stands, ...] = ()
    reaches: tuple[ShownSize, ...] = ()


@dataclass(frozen=True, slots=True)
class _Windows:
    """Windows of one length in blocks: their log p, and what is needed to tell more of the best."""

    length: int
    log_p: Array  # (k,) paid for
    scale2: float
    alone: Array  # (k, p) information on each parameter alone


@dataclass(frozen=True, slots=True)
class _Hit:
    """A window in which something stands out, and the noise at its length."""

    from_s: float
    to_s: float
    log_p: float
    scale2: float


@dataclass(frozen=True, slots=True)
class _Fit:
    """A candidate fitted in a window: nat saved, its figures paid for."""

    signature: Signature
    nats: float
    values: tuple[float, ...]
    spreads: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums up to each block (B + 1, ...): X'WX, X'We of the remainder and of drawn ones, e'We and
    components compared; blocks' ends."""

    normal: Array
    score: Array
    square: Array
    count: Array
    first: Array
    time_s: Array

    def inside(self, length: int) -> tuple[Array, Array, Array, Array]:
        """The same of every window of so many blocks."""
        parts = (self.normal, self.score, self.square, self.count)
        found = tuple(part[length:] - part[:-length] for part in parts)
        return found[0], found[1], found[2], found[3]


def stretches(data: Data, model: Model, found: Sequence[Signature], seed: int = 0) -> Stretches:
    """Every candidate of a settled model's log in every window."""
    asked = [s for s in found if _asked(s)]
    if not asked or len(data.view) < 4 * LEAST_ROWS:
        return Stretches()
    rng = np.random.Generator(np.random.Philox([seed, STREAM]))
    whitened = _whitened(data, clean_errors(data, model, rng, DRAWS), model)
    hits: list[_Hit] = []
    reaches: list[ShownSize] = []
    for s in asked:
        sums = _summed(data, whitened, s)
        windows = list(_scanned(sums, s.columns.shape[2]))
        hits += _hits(sums, windows)
        if s.candidate.effect.breaks in ASKED:
            reaches += _reaches(data, s, sums, windows)
    return Stretches(tuple(_stands(data, model, asked, hits)), tuple(reaches))


def _asked(s: Signature) -> bool:
    effect = s.candidate.effect
    return s.plain and effect.asked_in_stretches and cuttable(effect)


def _whitened(data: Data, drawn: Array, model: Model) -> tuple[Array, Array]:
    """Root of W (n, 3, 3), zero where nothing is compared; the whitened remainder and drawn ones
    (1 + draws, n, 3)."""
    axes = np.isin(np.arange(3), list(data.axes))
    known = np.isfinite(data.view.log.truth_m) & axes
    covariance = white_covariance(data.structure, as_specified(data.structure))
    hidden = ~known
    covariance = np.where(hidden[:, :, None] | hidden[:, None, :], 0.0, covariance)
    covariance += np.eye(3) * hidden[:, None, :]
    root = np.linalg.inv(np.linalg.cholesky(covariance)) * known[:, :, None]
    every = np.concatenate([np.nan_to_num(model.scatter)[None], np.nan_to_num(drawn)])
    return root, np.einsum("nij,dnj->dni", root, every)


def _summed(data: Data, whitened: tuple[Array, Array], s: Signature) -> _Sums:
    root, error = whitened
    columns = root @ np.nan_to_num(s.columns)
    n = error.shape[1]
    count = min(n, MOST_BLOCKS)
    edges = np.round(np.linspace(0, n, count + 1)).astype(int)
    parts = (
        np.einsum("nij,nik->njk", columns, columns),
        np.einsum("nij,dni->ndj", columns, error),
        np.sum(error[0] ** 2, axis=1),
        np.sum(np.any(root != 0.0, axis=2), axis=1).astype(float),
    )
    normal, score, square, rows = (_cumulated(part, edges) for part in parts)
    return _Sums(normal, score, square, rows, edges, data.view.log.time_s)


def _cumulated(part: Array, edges: Array) -> Array:
    total = np.concatenate([np.zeros((1, *part.shape[1:])), np.cumsum(part, axis=0)])
    found: Array = total[edges]
    return found


def _lengths(sums: _Sums) -> list[int]:
    blocks = len(sums.first) - 1
    least = max(1, math.ceil(LEAST_ROWS * blocks / sums.first[-1]))
    found, length = [], float(least)
    while length <= LONGEST * blocks:
        found.append(round(length))
        length *= GROWTH
    return sorted(set(found))


def _scanned(sums: _Sums, width: int) -> Iterator[_Windows]:
    """All windows, length by length; the noise of a length is at least that of the shorter ones."""
    lengths = _lengths(sums)
    blocks = len(sums.first) - 1
    middle = float(chi2.median(width))
    base = floor2 = 0.0
    for length in lengths:
        normal, score, square, rows = sums.inside(length)
        gains, seen = _gains(normal, score, width)
        own = gains[:, 0]
        shown = float(np.median(own[seen])) / middle if np.any(seen) else 1.0
        drawn = float(np.mean(gains[seen, 1:])) / width if np.any(seen) else 1.0
        base = base or shown / max(drawn, 1e-300)
        count = blocks / length
        doubt = 1.0 + 2.0 * MEDIAN_SPREAD / math.sqrt(width * count)
        beyond = shown / doubt if count >= FEW else 0.0
        floor2 = max(floor2, base * drawn, beyond)
        freedom = np.maximum(rows - width, 1.0)
        left = np.maximum(square - own, 0.0) / freedom
        usual = float(np.median(left[seen])) if np.any(seen) else 1.0
        louder = np.maximum(left / max(LOUDER * usual, 1e-300), 1.0)
        log_p = _log_chi2(own / (floor2 * louder), width)
        by_left = _log_f(own / (width * np.maximum(left, 1e-300)), width, freedom)
        log_p = np.where(louder > 1.0, np.maximum(log_p, by_left), log_p)
        charge = math.log(len(lengths) * PLACES * count)
        log_p = np.where(seen, np.minimum(log_p + charge, 0.0), 0.0)
        yield _Windows(length, log_p, floor2, np.einsum("kpp->kp", normal))


def _log_chi2(square: Array, freedom: int) -> Array:
    """log of the upper tail of chi-square, by its leading term where the library's underflows."""
    found: Array = chi2.logsf(square, freedom)
    return np.where(np.isfinite(found), found, -0.5 * square)


def _log_f(share: Array, first: int, second: Array) -> Array:
    """The same of F: -(n2 / 2) log(1 + n1 F / n2)."""
    found: Array = f.logsf(share, first, second)
    return np.where(np.isfinite(found), found, -0.5 * second * np.log1p(first * share / second))


def _gains(normal: Array, score: Array, width: int) -> tuple[Array, Array]:
    """b' M b of every window and log (k, 1 + draws), and whether all parameters are seen in it."""
    diagonal = np.einsum("kpp->kp", normal)
    scale = np.sqrt(np.maximum(diagonal, 1e-300))
    scaled = normal / scale[:, :, None] / scale[:, None, :]
    scaled = scaled + 1e-9 * np.eye(width)
    right = np.swapaxes(score / scale[:, None, :], 1, 2)
    values = np.linalg.solve(scaled, right)
    typical = np.median(diagonal, axis=0)
    seen = np.all(diagonal > 1e-6 * np.maximum(typical, 1e-300), axis=1)
    return np.sum(values * right, axis=1), seen


def _hits(sums: _Sums, windows: Sequence[_Windows]) -> Iterator[_Hit]:
    """The window in which a candidate is clearest, if that is at least a doubt."""
    best = min(windows, key=lambda one: float(np.min(one.log_p)), default=None)
    if best is None:
        return
    at = int(np.argmin(best.log_p))
    log_p = float(best.log_p[at])
    if log_p < math.log(DOUBT):
        first, last = sums.first[at], sums.first[at + best.length] - 1
        yield _Hit(float(sums.time_s[first]), float(sums.time_s[last]), log_p, best.scale2)


def _stands(
    data: Data, model: Model, asked: Sequence[Signature], hits: Sequence[_Hit]
) -> Iterator[Stands]:
    """The clearest window, named; then the clearest elsewhere, and so on."""
    left = sorted(hits, key=lambda one: one.log_p)
    while left:
        best = left[0]
        named = _named(data, model, asked, best)
        if named is not None:
            yield named
        left = [one for one in left if one.to_s < best.from_s or best.to_s < one.from_s]


def _named(data: Data, model: Model, asked: Sequence[Signature], hit: _Hit) -> Stands | None:
    """What fits a window best by re-simulation, and what fits it as well.

    Each figure costs half of log N nat.  Of those within AS_GOOD_NATS the commonest is named,
    what comes and goes before what is built in.
    """
    white = precision(data.structure, as_specified(data.structure))
    tried = (_fitted(data, model, white, s, hit) for s in asked)
    fits = [each for each in tried if each is not None]
    if not fits:
        return None
    best = max(fits, key=lambda each: each.nats)
    as_good = [each for each in fits if each.nats > best.nats - AS_GOOD_NATS]
    named = min(as_good, key=lambda each: _seldom(each.signature.candidate))
    one = named.signature.candidate
    return Stands(
        one.label, data.view.system.stages[one.stage].name, hit.from_s, hit.to_s,
        tuple(p.name for p in one.effect.slopes()), named.values, named.spreads,
        hit.log_p, hit.log_p < math.log(SURE),
        tuple(other.signature.candidate.label for other in as_good if other is not named),
    )  # fmt: skip


def _seldom(one: Candidate) -> tuple[bool, int, int]:
    return not one.effect.passing, *commonness(one.label)


def _fitted(data: Data, model: Model, white: Precision, s: Signature, hit: _Hit) -> _Fit | None:
    """One candidate in a window beside the model's effects, in the spec's white noise."""
    view = data.view
    cut = cut_to(Span(s.candidate.effect, hit.from_s, hit.to_s), s, view.log.time_s)
    own = Acting(cut.candidate.effect, s.candidate.sensor, s.candidate.stage,
                 zero_values(s.candidate.effect))  # fmt: skip
    before = model.error
    acting, after, covariance = adjusted(data, (*model.acting, own), white, before, steps=6)
    slopes = s.candidate.effect.slopes()
    values = tuple(float(acting[-1].values[p.name]) for p in slopes)
    if any(abs(v) > p.high for v, p in zip(values, slopes, strict=True)):
        return None
    inside = (view.log.time_s >= hit.from_s) & (view.log.time_s <= hit.to_s)
    scale2 = max(hit.scale2, 1.0)
    rows = 3.0 * float(np.sum(inside))
    saved = white.negative_log_likelihood(before) - white.negative_log_likelihood(after)
    spreads = np.sqrt(scale2 * np.maximum(np.diag(covariance)[-len(slopes) :], 0.0))
    nats = saved / scale2 - 0.5 * len(slopes) * math.log(rows)
    return _Fit(s, nats, values, tuple(map(float, spreads)))


def _usual_gap_s(time_s: Array) -> float:
    """Between rows, of all but a twentieth of the time: of a thinned log what was left out."""
    steps = np.sort(np.diff(time_s))
    told = np.cumsum(steps) <= (1.0 - NEARLY_ALL_PLACES) * np.sum(steps)
    return float(np.max(steps[told], initial=0.0)) if np.any(told) else float(np.max(steps))


def _reaches(
    data: Data, s: Signature, sums: _Sums, windows: Sequence[_Windows]
) -> Iterator[ShownSize]:
    """Size by length: sqrt(T) + 1.645 standard uncertainties, where nearly all places show it."""
    blocks = len(sums.first) - 1
    duration_s = float(sums.time_s[-1] - sums.time_s[0])
    gap_s = _usual_gap_s(sums.time_s)
    width = s.columns.shape[2]
    sizes = []
    for one in windows:
        charge = math.log(DOUBT) - math.log(len(windows) * PLACES * blocks / one.length)
        root = math.sqrt(float(chi2.isf(math.exp(charge), width))) + NEARLY_ALL
        known = np.quantile(one.alone, NEARLY_ALL_PLACES, axis=0)
        size = root * np.sqrt(one.scale2 / np.maximum(known, 1e-300))
        long_enough = duration_s * one.length / blocks > 2.0 * gap_s or one.length == 1
        sizes.append(np.where((known > 0.0) & long_enough, size, math.inf))
    lengths = tuple(duration_s * one.length / blocks for one in windows)
    stage = data.view.system.stages[s.candidate.stage].name
    for k, p in enumerate(s.candidate.effect.slopes()):
        yield ShownSize(s.candidate.label, stage, p.name, p.unit, p.high, lengths,
                    tuple(float(size[k]) for size in sizes))  # fmt: skip
