"""Effects whose one parameter is not one value: a delay that is another one every few seconds.

Rows that a parameter acts alike on vouch for it together.  With x its whitened column, z the
whitened remainder and u = x . z what a row says of it, blocks of a log are asked for
    T = sum over blocks of ((sum u)^2 - sum over stamps of (sum u)^2),
products of different stamps alone, so that noise which merely grows with x has no say.  The same
remainder shifted against the column shows what T is for this noise, however slow it is.  A variance
tau^2 of the parameter from block to block adds tau^2 sum (N^2 - sum over stamps of N^2), N the sum
of x . x.
A slow noise of a sensor may look alike, so beside it a Gauss-Markov course of the parameter has to
raise the likelihood, all noise fitted anew.  What varies most is taken out before the others are
asked: two shapes that are nearly one vary alike.
Sources: circular shifts as in `remainder`; Robinson, Statistical Science 6 (1991) for the values of
single blocks (best linear unbiased prediction).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import slopes
from syncline_design.diagnosis.fitting import SHORT, Data, Model
from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.noise import OPEN, Bounds, Slow, white_covariance
from syncline_design.diagnosis.noise_fit import fit_noise
from syncline_design.diagnosis.slow_states import names_of
from syncline_design.diagnosis.spans import span_of
from syncline_design.effects.record import Array
from syncline_design.logs.stamps import groups
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator
from syncline_design.model.normal import OF_MEDIAN_DEVIATION

BLOCKS = (16, 32, 64, 128)  # of the stamps; what varies more slowly is told by quarters of the log
LEAST_STAMPS = 4  # of a block
SHIFTS = 100
STREAM = 31  # key of their draws
SURE = 6.0  # standard deviations of shifted remainders
FAR = 2.5  # usual deviations of a part of the log, beyond which a component counts no more
NATS = 10.0  # that a course of the parameter has to save beside all noise
TOLD = 0.1  # of the usual block's say, below which a block's own value is not told


@dataclass(frozen=True, slots=True)
class Wandering:
    """A parameter's standard deviation from one stretch of a log to the next, of over_s each.

    values: (from_s, to_s, value) of the stretches that tell it, as far as their noise lets them.
    sure: standard deviations of noise alone by which it stands out; whole: value over all rows.
    """

    over_s: float
    std: float
    values: tuple[tuple[float, float, float], ...]
    sure: float
    whole: float


@dataclass(frozen=True, slots=True)
class _Rows:
    """Whitened rows: what is left z (n, a), the first row of every stamp, stamps, draws."""

    left: Array
    starts: NDArray[np.int64]
    time_s: Array
    shifts: NDArray[np.int64]


def wanderings(data: Data, model: Model, least: float, seed: int) -> dict[Label, Wandering]:
    """Of effects of one parameter that act in all of the log: those whose values differ.

    least: share of a value by which it has to vary.
    """
    asked = [a for a in model.acting if len(names_of(a)) == 1 and span_of(a.effect) is None]
    if not asked:
        return {}
    axes = list(data.axes)
    lower = np.linalg.cholesky(white_covariance(data.structure, model.level)[:, axes][:, :, axes])
    every = np.nan_to_num(slopes(data.view, model.acting))
    place = np.cumsum([0, *(len(names_of(a)) for a in model.acting)])
    own = every[:, :, [place[model.acting.index(a)] for a in asked]]
    columns = np.linalg.solve(lower, own[:, axes])
    rows = _rows(data, np.linalg.solve(lower, model.error[:, axes, None])[:, :, 0], seed)
    left = {a.label: k for k, a in enumerate(asked)}
    found: dict[Label, Wandering] = {}
    while left:
        tried: dict[Label, Wandering] = {}
        for label, k in left.items():
            whole = float(asked[k].values[names_of(asked[k])[0]])
            one = _wandering(rows, columns[:, :, k], whole)
            if one is not None and one.std > least * abs(whole):
                tried[label] = one
        if not tried:
            break
        most = max(tried, key=lambda label: (tried[label].sure, label))
        k = left.pop(most)
        if _saved(data, model, own[:, :, k : k + 1], tried[most]) > NATS:
            found[most] = tried[most]
            rows = _without(rows, columns[:, :, k], tried[most])
    return found


def _saved(data: Data, model: Model, column: Array, found: Wandering) -> float:
    """nat that a Gauss-Markov course of the parameter saves beside all other noise."""
    structure, level = data.noise_structure, model.level
    rows, error = data.noise_rows, model.scatter[data.noise_rows]
    usual = found.std / max(level.factor[0], 1.0)
    course = Slow(structure.white[0].sensor, usual * column[rows], True, (OPEN,), (np.inf,))
    more = replace(structure, slow=(*structure.slow, course))
    bounds = Bounds(model.bounds.factor, (*model.bounds.slow, (OPEN,)))
    start = replace(
        level,
        slow=(*level.slow, (1.0,)),
        time_constant_s=(*level.time_constant_s, (found.over_s,)),
    )
    _, with_it = fit_noise(more, error, bounds, start, model.free_sizes, SHORT)
    _, without = fit_noise(structure, error, model.bounds, level, model.free_sizes, SHORT)
    return without - with_it


def _rows(data: Data, left: Array, seed: int) -> _Rows:
    size = np.zeros((len(left), 1))
    for part in np.array_split(np.arange(len(left)), BLOCKS[1]):  # louder where it varies more
        size[part] = np.median(np.abs(left[part])) if part.size else 0.0
    size = OF_MEDIAN_DEVIATION * np.maximum(size, np.median(np.abs(left)) if left.size else 1.0)
    left = np.clip(left, -FAR * size, FAR * size)
    time_s = data.view.log.time_s
    starts = np.flatnonzero(np.diff(groups(time_s), prepend=-1) > 0)
    rng = generator([seed, STREAM])
    n = len(left)
    shifts = rng.integers(max(n // 10, 1), max(n * 9 // 10, 2), SHIFTS)
    return _Rows(left, starts, time_s, np.concatenate([[0], shifts]))


def _wandering(rows: _Rows, column: Array, whole: float) -> Wandering | None:
    """How a parameter varies over blocks of the length that shows it best."""
    told = np.array([np.sum(column * np.roll(rows.left, -k, axis=0), axis=1) for k in rows.shifts])
    told = np.add.reduceat(told, rows.starts, axis=1)  # (1 + shifts, stamps)
    weight = np.add.reduceat(np.sum(column * column, axis=1), rows.starts)
    best: Wandering | None = None
    for count in BLOCKS:
        if len(rows.starts) < LEAST_STAMPS * count or not np.any(weight > 0.0):
            continue
        block = np.arange(len(rows.starts)) * count // len(rows.starts)
        first = np.flatnonzero(np.diff(block, prepend=-1) > 0)
        sums, own = np.add.reduceat(told, first, axis=1), np.add.reduceat(weight, first)
        shown = np.sum(sums**2, axis=1) - np.sum(told**2, axis=1)
        usual, spread = float(np.mean(shown[1:])), float(np.std(shown[1:]))
        sure = (float(shown[0]) - usual) / max(spread, 1e-300)
        if sure < SURE or (best is not None and sure <= best.sure):
            continue
        variance = (float(shown[0]) - usual) / float(np.sum(own**2) - np.sum(weight**2))
        noise = float(np.mean(np.sum(sums[1:] ** 2, axis=1))) / float(np.sum(own))
        values = whole + variance * sums[0] / (noise + variance * own)
        seen = own > TOLD * np.median(own)
        ends = rows.time_s[rows.starts[np.append(first, len(rows.starts) - 1)]]
        best = Wandering(
            float(ends[-1] - ends[0]) / count,
            float(np.sqrt(variance)),
            tuple(
                (float(a), float(b), float(v))
                for a, b, v, told_here in zip(ends[:-1], ends[1:], values, seen, strict=True)
                if told_here
            ),
            sure,
            whole,
        )
    return best


def _without(rows: _Rows, column: Array, found: Wandering) -> _Rows:
    """The rows without what a parameter's own values in stretches make of them."""
    off = np.zeros(len(rows.time_s))
    for from_s, to_s, value in found.values:
        off[(rows.time_s >= from_s) & (rows.time_s < to_s)] = value - found.whole
    return replace(rows, left=rows.left - off[:, None] * column)
