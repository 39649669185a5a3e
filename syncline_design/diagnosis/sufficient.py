"""What of a log is enough to fit effects to it later, alone or beside other logs.

At a fixed point of the parameters (the spec, or where the log's own search ended) the error is
linear in every parameter b of every effect, so that all a log says of them is
    I = X' C^-1 X,   g = X' C^-1 e + I b0,   q = e' C^-1 e   (e taken to b = 0 along the slopes),
freed of the slow courses of every sensor's channel (`slow_states`) and of what the log alone has.
C is the log's own fitted noise, white and Gauss-Markov, with less weight for rows far off.
The same less each stretch of the log (and less each group of targets, where they are few) lets the
scatter of parts speak where the noise is of another kind: the delete-a-part jackknife.
Sources: Kay, Estimation Theory (1993), ch. 5; Rue and Held (2005), ch. 2; Efron and Stein (1981).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import Candidate, candidates, signature, slopes
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import SLOW_LEAST, NoiseLevel, Structure, precision
from syncline_design.diagnosis.slow_states import States
from syncline_design.diagnosis.slow_sums import LEAST_BLOCKS, LOST
from syncline_design.diagnosis.spans import span_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

FAR = 1.6  # root mean square of a row's whitened components, from where on a row counts less
REWEIGHTED = 1
LEAST_WEIGHT = 1e-3
SHOWN_NATS = 2.5  # of likelihood, from which a sensor has Gauss-Markov noise beside its courses
PLAUSIBLE = 2.0  # standard deviation, in bounds of a log, of an effect that its search did not name
Seen = NDArray[np.bool_]
TermLabel = tuple[str, str, int, str]  # effect, sensor, stage, parameter


@dataclass(frozen=True, slots=True)
class Less:
    """The statistics of a log without one of its parts after the other: (G, p, p), (G, p), (G,)."""

    normal: Array
    score: Array
    square: Array


@dataclass(frozen=True, slots=True)
class Sufficient:
    """What one log says of the parameters labelled.

    normal (p, p), score (p,), square: I, g, q; a parameter that is not seen has a row of zeros.
    gram (p, p): mean over the rows of X' X [m2], for the RMS that values make.  less: of stretches
    of time, and of targets where they are few.
    """

    labels: tuple[TermLabel, ...]
    normal: Array
    score: Array
    square: float
    gram: Array
    less: tuple[Less, ...]


def sufficient(data: Data, model: Model, states: States) -> Sufficient:
    """The statistics of a searched log at the point where its search ended."""
    listed = [
        c
        for c in candidates(data.view)
        if c.effect.sensitivity is not None and not any(p.located for p in c.effect.parameters)
    ]
    labels = tuple((*c.label, p.name) for c in listed for p in c.effect.slopes())
    columns, point = _columns(data, model, listed)
    known = {c.label for c in listed}  # what acts in a part of the log is the log's own
    own = [a for a in model.acting if a.label not in known or span_of(a.effect) is not None]
    nuisance = np.nan_to_num(slopes(data.view, own)) if own else np.zeros((*columns.shape[:2], 0))
    every = np.concatenate(
        [nuisance, states.courses, columns, model.error[:, :, None]], axis=2
    ) * _compared(data)
    model = replace(model, level=shown_level(data, model, _left(data, model, nuisance, columns)))
    return _freed(data, model, states, labels, every, nuisance.shape[2], point)


def _left(data: Data, model: Model, nuisance: Array, columns: Array) -> Array:
    """What no value of any effect explains (n, 3): noise is judged by it.

    An effect too small to be named alone would pass for slow noise and widen its own interval.
    """
    every = np.concatenate([nuisance, columns, model.error[:, :, None]], axis=2) * _compared(data)
    total = _Sums.of(data, model, every, np.ones(len(every))).total
    values = _solved(total, np.zeros(total.shape[0] - 1))
    left: Array = every[:, :, -1] - every[:, :, :-1] @ values
    return left


def shown_level(data: Data, model: Model, left: Array) -> NoiseLevel:
    """The fitted noise without the slow parts that do not raise the likelihood by SHOWN_NATS.

    left (n, 3): what is judged by it.  A fit finds some slow noise in every log; how much there may
    be that a log does not show, the courses say.
    """
    level = model.level
    nll = _nll(data, left, level)
    for k, part in enumerate(data.structure.slow):
        index = [w.sensor for w in data.structure.white].index(part.sensor)
        share = float(np.mean(level.slow[k])) * max(1.0, level.factor[index]) ** 2
        factor = list(level.factor)
        factor[index] = math.sqrt(factor[index] ** 2 + share)
        slow = list(level.slow)
        slow[k] = tuple(SLOW_LEAST for _ in slow[k])
        trial = replace(level, factor=tuple(factor), slow=tuple(slow))
        found = _nll(data, left, trial)
        if found < nll + SHOWN_NATS:
            level, nll = trial, found
    return level


def _nll(data: Data, left: Array, level: NoiseLevel) -> float:
    known = precision(replace(data.structure, survey=None), level)
    return known.negative_log_likelihood(left)


def _compared(data: Data) -> Array:
    """1 where the truth is known, (n, 3, 1)."""
    return np.isfinite(data.view.log.truth_m)[:, :, None].astype(float)


def _columns(data: Data, model: Model, listed: Sequence[Candidate]) -> tuple[Array, Array]:
    """Slopes (n, 3, p) at the point of the model, and the point (p,)."""
    acting = {a.label: a for a in model.acting if span_of(a.effect) is None}
    parts, point = [np.zeros((len(data.view), 3, 0))], []
    for c in listed:
        one = acting.get(c.label)
        found = signature(data.view, c, {}) if one is None else slopes(data.view, [one])
        parts.append(np.nan_to_num(found))
        point += [0.0 if one is None else float(one.values[p.name]) for p in c.effect.slopes()]
    return np.concatenate(parts, axis=2), np.array(point)


def _freed(
    data: Data,
    model: Model,
    states: States,
    labels: tuple[TermLabel, ...],
    every: Array,
    width: int,
    point: Array,
) -> Sufficient:
    """Sums over parts, and the wanted columns freed of nuisance and courses."""
    fixed = width + states.courses.shape[2]
    weight = np.ones(len(data.view))
    for _ in range(REWEIGHTED):
        sums = _Sums.of(data, model, every, weight)
        prior = _prior(states, sums.total, width, model.level)
        weight, scale2 = _weights(data, model, every, sums.total, prior)
    sums = _Sums.of(data, model, every, weight)
    total = sums.total / scale2
    prior = _prior(states, total, width, model.level)
    whole = freed(total, prior)
    seen = np.diag(whole)[:-1] > LOST * np.diag(total)[fixed:-1]
    groupings = [states.block] if states.seen is None else [states.block, states.seen]
    less = []
    for part in groupings:
        parts = sums.parts(part) / scale2
        if len(parts) >= LEAST_BLOCKS:
            less.append(_less(np.array([freed(total - p, prior) for p in parts]), seen, point))
    normal, score, square = _taken(whole[None], seen, point)
    x = every[:, :, fixed:-1].reshape(-1, len(labels))
    gram = x.T @ x / max(len(data.view), 1)
    return Sufficient(labels, normal[0], score[0], float(square[0]), gram, tuple(less))


def _prior(states: States, total: Array, width: int, level: NoiseLevel) -> Array:
    """Prior precision of the nuisance and of the courses, their sizes found beside all effects.

    Meanwhile an effect is held to some PLAUSIBLE bounds of its own about where the log's search
    left it.  Free, it would take what is a slow course of its sensor, and stand in its place in
    every set of logs; at zero, an effect too small to be named would pass for a slow course.
    """
    fixed = width + states.courses.shape[2]
    last = total.shape[0] - 1
    order = np.r_[0:width, fixed:last, width:fixed, last]
    free = last - states.courses.shape[2]
    beside = total[np.ix_(order, order)]
    effects = np.arange(width, free)
    beside[effects, effects] *= 1.0 + PLAUSIBLE**-2.0
    found = states.expected_prior(beside, free, level)
    return np.concatenate([np.zeros(width), found[free:]])


def _less(matrices: Array, seen: Seen, point: Array) -> Less:
    return Less(*_taken(matrices, seen, point))


def _taken(matrices: Array, seen: Seen, point: Array) -> tuple[Array, Array, Array]:
    """I, g and q at zero, of matrices [[I, s], [s', q]] at the point; zeros where not seen."""
    both = seen[:, None] & seen
    normal = np.where(both, 0.5 * (matrices + np.swapaxes(matrices, 1, 2))[:, :-1, :-1], 0.0)
    at = np.where(seen, matrices[:, :-1, -1], 0.0)
    moved = normal @ point
    square = matrices[:, -1, -1] + 2.0 * at @ point + moved @ point
    return normal, at + moved, square


def freed(matrix: Array, prior: Array) -> Array:
    """The Schur complement of the leading block, its prior precision added: the rest, freed of it.

    matrix (m, m); prior (k,) of the first k columns.
    """
    k = prior.shape[0]
    inner = matrix[:k, :k] + np.diag(prior)
    scale = np.sqrt(np.maximum(np.diag(inner), 0.0))
    scale = np.where(scale == 0.0, 1.0, scale)
    cross = matrix[:k, k:] / scale[:, None]
    inverse = np.linalg.pinv(inner / scale[:, None] / scale, rcond=1e-12, hermitian=True)
    left: Array = matrix[k:, k:] - cross.T @ inverse @ cross
    return left


@dataclass(frozen=True, slots=True)
class _Sums:
    """Columns Y (n, 3, m) and C^-1 Y of one log."""

    columns: Array
    weighted: Array

    @classmethod
    def of(cls, data: Data, model: Model, columns: Array, weight: Array) -> _Sums:
        """By the model's noise; a row of weight w counts as if its white noise were w^-1/2."""
        structure = _weighted(replace(data.structure, survey=None), weight)
        return cls(columns, precision(structure, model.level).solve(columns))

    @property
    def total(self) -> Array:
        """Y' C^-1 Y (m, m)."""
        m = self.columns.shape[2]
        whole: Array = self.columns.reshape(-1, m).T @ self.weighted.reshape(-1, m)
        return 0.5 * (whole + whole.T)

    def parts(self, group: NDArray[np.int64]) -> Array:
        """What the rows of every group bring to it (G, m, m); together it is the whole."""
        m, found = self.columns.shape[2], []
        for k in range(int(group.max()) + 1):
            rows = group == k
            part = self.columns[rows].reshape(-1, m).T @ self.weighted[rows].reshape(-1, m)
            found.append(0.5 * (part + part.T))
        return np.array(found)


def _weighted(structure: Structure, weight: Array) -> Structure:
    """The structure with every row's white noise larger by weight^-1/2."""
    grown = 1.0 / weight[:, None, None]
    white = tuple(
        replace(
            w,
            covariance=w.covariance * grown,
            loading=None if w.loading is None else w.loading * np.sqrt(grown),
        )
        for w in structure.white
    )
    return replace(structure, white=white)


def _weights(
    data: Data, model: Model, every: Array, total: Array, prior: Array
) -> tuple[Array, float]:
    """Weights of rows by what effects and slow noise leave of them, and the variance of that."""
    every_prior = np.concatenate([prior, np.zeros(total.shape[0] - 1 - prior.shape[0])])
    error = every[:, :, -1] - every[:, :, :-1] @ _solved(total, every_prior)
    known = precision(replace(data.structure, survey=None), model.level)
    left = (error - known.slow_part(error)) * _compared(data)[:, :, 0]
    solved = (known.white_inverse @ left[:, :, None])[:, :, 0]
    count = np.maximum(_compared(data)[:, list(data.axes), 0].sum(axis=1), 1.0)
    size = np.sqrt(np.maximum(np.sum(left * solved, axis=1), 0.0) / count)
    usual = float(np.median(size)) / _usual_size(float(np.median(count)))
    far = size / max(usual, 1e-300)
    weight = np.maximum(np.minimum(1.0, FAR / np.maximum(far, FAR)), LEAST_WEIGHT)
    return weight, max(usual**2, 0.25)


def _solved(total: Array, prior: Array) -> Array:
    """Values of all columns but the last, which is the error."""
    inner = total[:-1, :-1] + np.diag(prior)
    scale = np.sqrt(np.maximum(np.diag(inner), 0.0))
    scale = np.where(scale == 0.0, 1.0, scale)
    inverse = np.linalg.pinv(inner / scale[:, None] / scale, rcond=1e-10, hermitian=True)
    values: Array = inverse @ (total[:-1, -1] / scale) / scale
    return values


def _usual_size(count: float) -> float:
    """Median of sqrt(chi2_k / k), by Wilson and Hilferty."""
    return math.sqrt((1.0 - 2.0 / (9.0 * count)) ** 3)
