"""Noise that changes: a sensor that scatters more in a part of the log.

With e what the named effects and slow noise leave, Sigma its white covariance and C_s one sensor's
part of it, a row says of that part
    t = (w' C_s w - tr Sigma^-1 C_s) / 2,   w = Sigma^-1 e,
the slope of its log likelihood by the part's size.  Means of t over a stretch and outside it are
held against those of the same blocks in any other order: what scatters alike all along knows no
order.  The stretch to the row is the one that saves most at its own size.  What is left in it has
to come and go from row to row: a missing effect that shows while the vehicle moves is no noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model, data_of
from syncline_design.diagnosis.motion_scatter import lasting
from syncline_design.diagnosis.noise import SensorKey, as_specified, white_covariance
from syncline_design.diagnosis.steady import goes_on
from syncline_design.diagnosis.unlike_readings import slopes_of_readings
from syncline_design.effects import registry
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass

BLOCKS = 40
LEAST, MOST = 2, 30  # blocks of a stretch
FINE = 160  # blocks at most in which a short stretch is looked for, of FINE_ROWS rows at least
SHORT = 16  # of them at most
FINE_ROWS = 4
CUT = 9.0  # times its expectation beyond which a row's square is cut while a stretch is looked for
ORDERS = 1000  # of the blocks, against which a stretch has to stand out
TIE = 1e-9  # by which an order of the same blocks side by side may differ in rounding
EXPLAINED = 0.5  # share of the variance between blocks that the stretch has to make up
LEAST_GROWN = 1.3  # standard deviations over the usual ones
SIZES = np.geomspace(1.05, 300.0, 90)
NATS = 15.0
MEDIAN_SQUARE = 0.4549364231195724  # of the standard normal
MOST_EPISODES = 3
ROUNDS = 4
LEAST_ROWS = 200  # of a log that is searched


@dataclass(frozen=True, slots=True)
class Episode:
    """A sensor whose white noise is `factor` times as large from one stamp to another.

    spread: standard uncertainty of the factor; gain: nat saved.
    """

    sensor: SensorKey
    from_s: float
    to_s: float
    factor: float
    spread: float
    gain: float

    def growth(self, time_s: Array) -> Array:
        """Standard deviations over the usual ones (n,)."""
        inside = (time_s >= self.from_s) & (time_s <= self.to_s)
        return np.where(inside, self.factor, 1.0)


def episode_effect() -> Effect:
    """The effect of the dictionary that an episode is."""
    return next(one for one in registry().values() if one.opens == "episode")


def with_episodes(data: Data, found: tuple[Episode, ...]) -> Data:
    """The data with the white noise of some sensors growing for a while."""
    time_s = data.structure.time_s
    white = []
    for part in data.structure.white:
        own = [one.growth(time_s) for one in found if one.sensor == part.sensor]
        white.append(replace(part, growth=np.prod(own, axis=0)) if own else part)
    structure = replace(data.structure, white=tuple(white))
    louder = data_of(data.view, structure)
    return replace(louder, axes=data.axes, noisier=data.noisier, explained=data.explained)


def without_episodes(data: Data) -> Data:
    """The data with white noise that is as loud all along."""
    white = tuple(replace(part, growth=None) for part in data.structure.white)
    usual = data_of(data.view, replace(data.structure, white=white))
    return replace(usual, axes=data.axes, noisier=data.noisier, explained=data.explained)


def episodes(data: Data, model: Model, rng: np.random.Generator) -> tuple[Episode, ...]:
    """The episodes of a log, the clearest first."""
    if len(data.view) < LEAST_ROWS:
        return ()
    axes = list(data.axes)
    left = (model.error - lasting(data, model))[:, axes]
    readings = [own[:, axes] for own in slopes_of_readings(data).values()]
    found: tuple[Episode, ...] = ()
    structure = data.structure
    while len(found) < MOST_EPISODES:
        level = replace(as_specified(structure), episodes=True)
        white = white_covariance(structure, level)[:, axes][:, :, axes]
        parts = [
            (w.sensor, w.grown(level).covariance[:, axes][:, :, axes]) for w in structure.white
        ]
        tried = [one for p in parts if (one := _in_sensor(data, left, white, p, readings, rng))]
        if not tried:
            break
        found = (*found, max(tried, key=lambda one: one.gain))
        structure = with_episodes(data, found).structure
    return found


def _in_sensor(
    data: Data,
    left: Array,
    white: Array,
    part: tuple[SensorKey, Array],
    readings: Sequence[Array],
    rng: np.random.Generator,
) -> Episode | None:
    """The stretch in which one sensor's noise is larger, if there is one; readings (n, a, c): what
    those of every sensor do."""
    sensor, own = part
    inverse = np.linalg.inv(white)
    weighted = np.einsum("nij,nj->ni", inverse, left)
    expected = np.einsum("nij,nji->n", inverse, own)
    square = np.einsum("ni,nij,nj->n", weighted, own, weighted)
    usual = np.median(square / np.maximum(expected, 1e-300))
    slope = np.minimum(square, CUT * max(float(usual), 1.0) * expected) - expected
    if not np.any(expected > 0.0) or (place := _place(slope, rng)) is None:
        return None
    first, last = place
    lower = np.asarray(np.linalg.cholesky(white), dtype=float)
    alone = np.asarray(np.linalg.solve(lower, left[:, :, None]), dtype=float)[:, :, 0]
    shares = _shares(lower, own, alone)
    factor, noise = 1.0, shares
    for _ in range(ROUNDS):
        noise = shares.of_variance(_usual(alone, first, last))
        inside = noise.rows(first, last)
        factor = float(SIZES[int(np.argmax([np.sum(inside.saved(k)) for k in SIZES]))])
        first, last = _best_run(noise.saved(factor))
    if last - first > MOST * len(left) / BLOCKS:
        return None  # most of the log is the rule, not an episode
    inside = noise.rows(first, last)
    gain = float(np.sum(inside.saved(factor)))
    if factor < LEAST_GROWN or gain < NATS + 2.0 * math.log(BLOCKS):
        return None
    time_s, rows = data.structure.time_s, slice(first, last)
    if goes_on(time_s[rows], left[rows], [own[rows] for own in readings]):
        return None
    spread = _spread(inside, factor)
    return Episode(sensor, float(time_s[first]), float(time_s[last - 1]), factor, spread, gain)


def _usual(alone: Array, first: int, last: int) -> float:
    """Variance outside a stretch over the spec's, by the median of the squares (normal noise).

    alone (n, a): the error, whitened row by row.
    """
    outside = np.r_[0:first, last : len(alone)]
    return float(np.median(alone[outside] ** 2)) / MEDIAN_SQUARE if outside.size else 1.0


def _place(slope: Array, rng: np.random.Generator) -> tuple[int, int] | None:
    """Rows [first, last) of a stretch that is louder than chance makes one.

    Three loud blocks of 40 stand side by side in one order of 260, so that no short stretch is told
    from chance by a thousand orders of them: it is asked in finer blocks.
    """
    fine = min(FINE, len(slope) // FINE_ROWS)
    asked = ((BLOCKS, MOST), (fine, SHORT)) if fine >= 2 * BLOCKS else ((BLOCKS, MOST),)
    for blocks, most in asked:
        edges = np.linspace(0, len(slope), blocks + 1).astype(int)
        means = np.add.reduceat(slope, edges[:-1]) / np.diff(edges)
        if (place := _stands_out(means, most, rng)) is not None:
            return int(edges[place[0]]), int(edges[place[1]])
    return None


def _stands_out(blocks: Array, most: int, rng: np.random.Generator) -> tuple[int, int] | None:
    """[first, last) block of the stretch that is louder than any order of the blocks shows.

    most: blocks of a stretch at most.
    """
    own, best = _clearest(blocks[None], most)
    orders = np.array([rng.permutation(blocks) for _ in range(ORDERS)])
    highest = float(np.max(_clearest(orders, most)[0])) * (1.0 + TIE)
    total = float(np.sum((blocks - blocks.mean()) ** 2))
    made_up = float(own[0] ** 2) / max(total, 1e-300)  # between and inside the two parts
    if own[0] <= highest or made_up < EXPLAINED:
        return None
    return int(best[0, 0]), int(best[0, 1])


def _clearest(rows: Array, most: int) -> tuple[Array, Array]:
    """Of rows of blocks (r, n), the contrast of each one's loudest stretch, and its ends (r, 2).

    A stretch of c blocks of sum s, of n of sum S: (s / c - (S - s) / (n - c)) sqrt(c (n - c) / n).
    """
    r, n = rows.shape
    sums = np.concatenate([np.zeros((r, 1)), np.cumsum(rows, axis=1)], axis=1)
    clearest, ends = np.full(r, -np.inf), np.zeros((r, 2), dtype=int)
    for count in range(LEAST, min(most, n) + 1):
        inside = sums[:, count:] - sums[:, :-count]
        at = np.argmax(inside, axis=1)
        highest = inside[np.arange(r), at]
        outside = sums[:, -1] - highest
        size = math.sqrt(count * (n - count) / n)
        contrast = (highest / count - outside / max(n - count, 1)) * size
        better = contrast > clearest
        clearest[better] = contrast[better]
        ends[better] = np.stack([at, at + count], axis=1)[better]
    return clearest, ends


@dataclass(frozen=True, slots=True)
class _Shares:
    """Rows along axes on which all of the noise is one and a sensor's share of it is told.

    squares (n, a): of the error, over the noise's variance; shares (n, a): of the sensor in it.
    """

    squares: Array
    shares: Array

    def of_variance(self, times: float) -> _Shares:
        """The same where all noise is so many times the variance."""
        return _Shares(self.squares / times, self.shares)

    def rows(self, first: int, last: int) -> _Shares:
        return _Shares(self.squares[first:last], self.shares[first:last])

    def saved(self, factor: float) -> Array:
        """nat that every row saves when the sensor's part is factor^2 times as large (n,)."""
        grown = 1.0 + (factor**2 - 1.0) * self.shares
        saved: Array = 0.5 * np.sum(self.squares * (1.0 - 1.0 / grown) - np.log(grown), axis=1)
        return saved


def _shares(lower: Array, own: Array, alone: Array) -> _Shares:
    """Noise of lower factors L (n, a, a), of which `own` is a sensor's: L^-1 own L^-T = V d V'."""
    half = np.linalg.solve(lower, own)
    shares, turned = np.linalg.eigh(np.linalg.solve(lower, np.swapaxes(half, 1, 2)))
    squares = np.einsum("nij,ni->nj", turned, alone) ** 2
    return _Shares(squares, np.clip(shares, 0.0, 1.0))


def _best_run(saved: Array) -> tuple[int, int]:
    """Rows [first, last) of largest sum (Kadane's maximum subarray)."""
    total = np.concatenate([[0.0], np.cumsum(saved)])
    least = np.minimum.accumulate(total)
    last = int(np.argmax(total[1:] - least[:-1])) + 1
    return int(np.argmin(total[:last])), last


def _spread(noise: _Shares, factor: float) -> float:
    """Standard uncertainty of the factor, by the curve of the likelihood over its logarithm."""
    step = 0.05
    low, middle, high = (
        float(np.sum(noise.saved(factor * math.exp(k * step)))) for k in (-1, 0, 1)
    )
    curve = (2.0 * middle - low - high) / step**2
    return factor / math.sqrt(curve) if curve > 0.0 else math.inf
