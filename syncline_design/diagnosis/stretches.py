"""What acts in a stretch of a log, however short: a delay of one second, a mount that slips.

Every candidate is asked in windows of several lengths, at every place:
    e = X b + w inside the window,   b = (X' W X)^-1 X' W e,
W the inverse of the spec's white noise, as loud as the episodes found in the log make it, and its
square b' (X' W X) b is held against the noise that the log itself has at that length: the median of
the squares of short windows over that of chi-square, which a fault of a stretch does not raise,
grown with the length as in logs drawn from the fitted noise, and at least what the median of such
windows shows beyond chance; and against what the candidate leaves in the window, which outliers
raise, and what is left beside it, which a louder while raises.  No window stands out by one of its
blocks alone: the square is the least that is left without any one of them, so that the tails of a
sensor are no fault.  A window pays for the lengths and for the places of its length (Bonferroni).
Sources: median of squares as a robust variance: Huber, Robust Statistics (1981), ch. 5; windows of
all lengths, each paying for its own number: Duembgen and Spokoiny, Ann. Statist. 29 (2001).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, Signature, commonness
from syncline_design.diagnosis.consequence import expected_rms_m, rms_m
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import (
    precision,
    white_covariance,
)
from syncline_design.diagnosis.noise_instead import noise_instead
from syncline_design.diagnosis.once_changed import once_changed
from syncline_design.diagnosis.one_course import OneCourse, one_course
from syncline_design.diagnosis.scores import clean_errors
from syncline_design.diagnosis.spans import cuttable
from syncline_design.diagnosis.stretch_ends import ends
from syncline_design.diagnosis.stretch_fits import Hit, WindowFit, as_good, as_loud, fitted, made
from syncline_design.diagnosis.stretch_windows import (
    ALONE,
    DOUBT,
    LEAST_ROWS,
    PLACES,
    BlockSums,
    Windows,
    cumulated,
    scanned,
)
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator
from syncline_design.model.distributions import chi_square_limit
from syncline_design.model.normal import NEARLY_ALL

MOST_BLOCKS: Final = 1200  # that windows are made of; of a longer log several rows each
DRAWS: Final = 6  # logs drawn from the fitted noise
STREAM: Final = 23  # key of their draws
SURE: Final = 1e-4  # chance that a sound log has such a window, below which it acts there
NEARLY_ALL_PLACES: Final = 0.05  # of the windows show less than is told
ENDS_ROUNDS: Final = 2  # of fitting it and finding its ends: a window of wrong ends fits less of it
EDGE: Final = 0.02  # of a log, within which what stands out may go on beyond its end
ASKED: Final = ("latency", "lever_arm", "mounting")  # kinds of assumptions
Label = tuple[str, str, int]


@dataclass(frozen=True, slots=True)
class Stands:
    """A candidate that stands out from one stamp to another.

    values and spreads by its parameters; log_p: log of the chance that a sound log shows as much
    anywhere; sure: whether that is beyond doubt; instead: what fits there as well.  inside:
    whether it begins and ends within the log, as what is built in does not.  margin_s: by which its
    ends may be off.  share: RMS that it makes in the log, over what the spec's noise makes.
    noise_of: the sensors whose slow noise does there as well; none of a constant beyond doubt.
    explained: the part of the square of what is left there that it makes up.
    frozen: whether it is one reading that is given over and over, of which the value is the age;
    reading: which of the sensor's, where its others go on.
    ends: of one that grows or falls, what it is at either end; the value is the larger.
    stamps_s: of single rows with sound ones between, those that it acts in; of_log: their share of
    the log, where rows that no one can tell count in part.
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
    instead: tuple[OtherFit, ...] = ()
    inside: bool = False
    margin_s: float = 0.0
    share: float = 0.0
    noise_of: tuple[str, ...] = ()
    frozen: bool = False
    explained: float = 0.0
    ends: tuple[float, float] | None = None
    stamps_s: tuple[float, ...] = ()
    of_log: float | None = None
    reading: str = ""

    @property
    def others(self) -> tuple[Label, ...]:
        """What fits there as well."""
        return tuple(one.label for one in self.instead)


@dataclass(frozen=True, slots=True)
class OtherFit:
    """What fits a stretch as well as what is named: its values and spreads by its parameters."""

    label: Label
    stage: str
    parameters: tuple[str, ...]
    values: tuple[float, ...]
    spreads: tuple[float, ...]


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


def stretches(
    data: Data, model: Model, found: Sequence[Signature], seed: int, known: Sequence[Hit] = (),
    rivals: Sequence[Signature] = (),
) -> Stretches:  # fmt: skip
    """Every candidate of a settled model's log in every window.

    known: what acts there for sure.  rivals: what it may be that stands out; what all of the log
    shows, or does not bear out, may change or act in a part of it as well.  None: the candidates.
    """
    asked = in_stretches(found)
    rivals = rivals or asked
    if not asked or len(data.view) < 4 * LEAST_ROWS:
        return Stretches()
    rng = generator([seed, STREAM])
    whitened = _whitened(data, clean_errors(data, model, rng, DRAWS), model)
    hits: list[Hit] = []
    reaches: list[ShownSize] = []
    every = [(s, _summed(data, whitened, s)) for s in asked]
    for s, sums in every:
        windows = list(scanned(sums, s.columns.shape[2]))
        hits += _hits(s, sums, windows)
        if s.candidate.effect.breaks in ASKED:
            reaches += _reaches(data, s, sums, windows)
    hits += _changed(data, whitened, every)
    ranked = [*known, *sorted(hits, key=lambda one: one.log_p)]
    stands = (_beside_noise(data, whitened, rivals, *one)
              for one in _stands(data, model, rivals, ranked))  # fmt: skip
    return Stretches(tuple(stands), tuple(reaches))


def _changed(
    data: Data, whitened: tuple[Array, Array], every: Sequence[tuple[Signature, BlockSums]]
) -> Iterator[Hit]:
    """What is built in and changed once, where it is beyond doubt no slow noise of a sensor."""
    hit = once_changed(every)
    root, left = whitened
    if hit is not None and not noise_instead(
        data, (root, left[0]), [hit.signature], (hit.from_s, hit.to_s), hit.scale2
    ):
        yield hit


def _beside_noise(
    data: Data, whitened: tuple[Array, Array], asked: Sequence[Signature], found: Stands,
    scale2: float,
) -> Stands:  # fmt: skip
    """What stands out beyond doubt, with the sensors whose slow noise does there as well."""
    if not found.sure:
        return found
    root, every = whitened
    labels = (found.label, *found.others)
    own = sorted((s for s in asked if s.candidate.label in labels),
                 key=lambda s: labels.index(s.candidate.label))  # fmt: skip
    whose = noise_instead(data, (root, every[0]), own, (found.from_s, found.to_s), scale2)
    return replace(found, noise_of=whose)


def left_as_one(data: Data, model: Model, known: Sequence[Signature]) -> OneCourse | None:
    """Whether what a settled model leaves is one course that begins and ends, of any effect that
    may act in a part of a log, those that the model holds among them."""
    asked = in_stretches(known)
    if not asked or len(data.view) < 4 * LEAST_ROWS:
        return None
    whitened = _whitened(data, np.zeros((0, len(data.view), 3)), model)
    return one_course([(s.candidate.label, _summed(data, whitened, s)) for s in asked])


def changed_once(data: Data, model: Model, asked: Sequence[Signature]) -> Hit | None:
    """What is built in and changed once, by what a model leaves; None where nothing is clear."""
    if not asked or len(data.view) < 4 * LEAST_ROWS:
        return None
    whitened = _whitened(data, np.zeros((0, len(data.view), 3)), model)
    return once_changed([(s, _summed(data, whitened, s)) for s in asked])


def in_stretches(found: Sequence[Signature]) -> list[Signature]:
    """Those that are asked in stretches."""
    effects = [(s, s.candidate.effect) for s in found if s.plain]
    return [s for s, effect in effects if effect.asked_in_stretches and cuttable(effect)]


def _whitened(data: Data, drawn: Array, model: Model) -> tuple[Array, Array]:
    """Root of W (n, 3, 3), zero where nothing is compared; the whitened remainder and drawn ones
    (1 + draws, n, 3)."""
    axes = np.isin(np.arange(3), list(data.axes))
    known = np.isfinite(data.view.log.truth_m) & axes
    covariance = white_covariance(data.structure, as_loud(data.structure, model))
    hidden = ~known
    covariance = np.where(hidden[:, :, None] | hidden[:, None, :], 0.0, covariance)
    covariance += np.eye(3) * hidden[:, None, :]
    root = np.linalg.inv(np.linalg.cholesky(covariance)) * known[:, :, None]
    every = np.concatenate([np.nan_to_num(model.scatter)[None], np.nan_to_num(drawn)])
    return root, np.einsum("nij,dnj->dni", root, every)


def _summed(data: Data, whitened: tuple[Array, Array], s: Signature) -> BlockSums:
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
    normal, score, square, rows = (cumulated(part, edges) for part in parts)
    return BlockSums(normal, score, square, rows, edges, data.view.log.time_s)


def _hits(s: Signature, sums: BlockSums, windows: Sequence[Windows]) -> Iterator[Hit]:
    """The window in which a candidate is clearest, if that is at least a doubt."""
    least = min((float(np.min(one.log_p)) for one in windows), default=0.0)
    if least >= math.log(DOUBT):
        return
    enough = math.log(SURE) if least < math.log(SURE) else math.log(DOUBT)
    clear = [np.where(one.log_p < enough, one.clear, math.inf) for one in windows]
    best, where = min(zip(windows, clear, strict=True), key=lambda pair: float(np.min(pair[1])))
    at = int(np.argmin(where))
    first, last = sums.first[at], sums.first[at + best.length] - 1
    times = float(sums.time_s[first]), float(sums.time_s[last])
    yield Hit(*times, float(best.log_p[at]), best.scale2, s)


def _stands(
    data: Data, model: Model, asked: Sequence[Signature], hits: Sequence[Hit]
) -> Iterator[tuple[Stands, float]]:
    """The first window, named, with its length's noise; then the next elsewhere, and so on."""
    left = list(hits)
    while left:
        best = left[0]
        for _ in range(ENDS_ROUNDS):
            best = _to_the_row(data, model, best)
        named = _named(data, model, asked, best)
        if named is not None:
            yield named, best.scale2
        left = [one for one in left if one.to_s < best.from_s or best.to_s < one.from_s]


def _named(data: Data, model: Model, asked: Sequence[Signature], hit: Hit) -> Stands | None:
    """What fits a window best by re-simulation, and what fits it as well.

    Of those that are as good the commonest is named, what comes and goes before what is built in.
    """
    white = precision(data.structure, as_loud(data.structure, model))
    tried = (fitted(data, model, white, s, hit) for s in asked)
    fits = [each for each in tried if each is not None]
    if not fits:
        return None
    inside = is_inside(hit.from_s, hit.to_s, data.view.log.ends_s)
    good = as_good(fits, inside=inside)
    named = min(good, key=lambda each: _seldom(each.signature.candidate))
    own = _told(data, named)
    others = tuple(_told(data, other) for other in good if other is not named)
    return Stands(
        own.label, own.stage, hit.from_s, hit.to_s, own.parameters, own.values, own.spreads,
        hit.log_p, hit.log_p < math.log(SURE), others, inside, hit.margin_s,
        _share(model, named, hit), explained=_explained(model, named, hit),
    )  # fmt: skip


def _to_the_row(data: Data, model: Model, hit: Hit) -> Hit:
    """The window with the ends of what acts there, by the candidate that it is clearest in."""
    found = fitted(data, model, precision(data.structure, as_loud(data.structure, model)),
                    hit.signature, hit)  # fmt: skip
    if found is None:
        return hit
    time_s = data.view.log.time_s
    _, (left, moved) = _whitened(data, made(model, found)[None], model)
    told = np.sum(moved**2, axis=1) / max(hit.scale2, 1.0)
    saved = np.sum(moved * left, axis=1) / max(hit.scale2, 1.0) - 0.5 * told
    rows = np.flatnonzero((time_s >= hit.from_s) & (time_s <= hit.to_s))
    own = ends(saved, told, int(rows[0]), int(rows[-1]))
    first_s, last_s = float(time_s[own.first]), float(time_s[own.last])
    usual_s = float(np.median(np.diff(np.unique(time_s))))
    return replace(hit, from_s=first_s, to_s=last_s, margin_s=usual_s * own.margin)


def _share(model: Model, fit: WindowFit, hit: Hit) -> float:
    data = fit.data
    inside = (data.view.log.time_s >= hit.from_s) & (data.view.log.time_s <= hit.to_s)
    made_m = rms_m(data, made(model, fit) * inside[:, None])
    return made_m / max(expected_rms_m(data), 1e-300)


def _explained(model: Model, fit: WindowFit, hit: Hit) -> float:
    time_s = fit.data.view.log.time_s
    inside = (time_s >= hit.from_s) & (time_s <= hit.to_s)
    left = np.nan_to_num(model.error)[inside]
    less = left - np.nan_to_num(made(model, fit))[inside]
    return 1.0 - float(np.sum(less**2)) / max(float(np.sum(left**2)), 1e-300)


def is_inside(from_s: float, to_s: float, ends_s: tuple[float, float]) -> bool:
    """Whether a stretch begins and ends within a log of these first and last stamps."""
    first, last = ends_s
    margin_s = EDGE * (last - first)
    return from_s - first > margin_s and last - to_s > margin_s


def _told(data: Data, fit: WindowFit) -> OtherFit:
    one = fit.signature.candidate
    return OtherFit(
        one.label, data.view.system.stages[one.stage].name,
        tuple(p.name for p in one.effect.slopes()), fit.values, fit.spreads,
    )  # fmt: skip


def _seldom(one: Candidate) -> tuple[bool, int, int]:
    return not one.effect.passing, *commonness(one.label)


def _usual_gap_s(time_s: Array) -> float:
    """Between rows, of all but a twentieth of the time: of a thinned log what was left out."""
    steps = np.sort(np.diff(time_s))
    told = np.cumsum(steps) <= (1.0 - NEARLY_ALL_PLACES) * np.sum(steps)
    return float(np.max(steps[told], initial=0.0)) if np.any(told) else float(np.max(steps))


def _reaches(
    data: Data, s: Signature, sums: BlockSums, windows: Sequence[Windows]
) -> Iterator[ShownSize]:
    """Size by length: sqrt(T) + 1.645 standard uncertainties, where nearly all places show it."""
    blocks = len(sums.first) - 1
    duration_s = float(sums.time_s[-1] - sums.time_s[0])
    gap_s = _usual_gap_s(sums.time_s)
    width = s.columns.shape[2]
    sizes = []
    for one in windows:
        charge = math.log(DOUBT) - math.log(len(windows) * PLACES * blocks / one.length)
        root = math.sqrt(chi_square_limit(math.exp(charge), width)) + NEARLY_ALL
        alone = 1.0 - 1.0 / one.length if one.length <= ALONE else 1.0
        known = alone * np.quantile(one.alone, NEARLY_ALL_PLACES, axis=0)
        size = root * np.sqrt(one.scale2 / np.maximum(known, 1e-300))
        long_enough = duration_s * one.length / blocks > 2.0 * gap_s or one.length == 1
        sizes.append(np.where((known > 0.0) & long_enough, size, math.inf))
    lengths = tuple(duration_s * one.length / blocks for one in windows)
    stage = data.view.system.stages[s.candidate.stage].name
    for k, p in enumerate(s.candidate.effect.slopes()):
        yield ShownSize(s.candidate.label, stage, p.name, p.unit, p.high, lengths,
                    tuple(float(size[k]) for size in sizes))  # fmt: skip
