"""Noise of the error series: what the spec says, how much and how slow it may be.

Per sensor: white noise of the spec's covariance times factor^2; per axis of position and attitude
a first-order Gauss-Markov process.  Within `Bounds` such noise is what the spec allows; beyond, it
is a finding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from syncline_design.diagnosis.covariance import Precision, factored, with_lasting
from syncline_design.effects.record import Array
from syncline_design.logs.log import Rows
from syncline_design.logs.stamps import repeated
from syncline_design.machine.quick_dataclass import dataclass

SensorKey = tuple[str, str]  # (stage, role)

FACTOR_LIMIT = 1.1  # white noise up to this factor of the spec's is the spec's
SLOW_LIMIT = 1.2  # slow variance over the spec's that still is of the spec's size
SLOW_LEAST = 1e-4
OPEN = 1e6
RELATIVE_FLOOR = 1e-12  # of a row's variances: keeps them invertible whatever sizes meet in a row
TIME_USUAL_S = 25.0  # centre of the weak prior on time constants: minutes or fractions of one
ROUNDING = 1e-9  # of a limit, by which a fitted figure at it may seem to exceed it
KEPT = 3  # factored covariances of one structure


@dataclass(frozen=True, slots=True)
class White:
    """White noise of one sensor as the spec has it: covariance (n, 3, 3) [m2] of the error.

    loading (n, 3, k) with loading loading' = covariance for a sensor that reads once a stamp: its
    noise is common to the rows of the stamp.  None where every row is a reading of its own.
    growth (n,): standard deviations over the spec's that the log's own episodes have; None: none.
    unlike: the same of each reading, over the quietest, with slopes (n, 3, k), what one standard
    deviation of every reading does; None: alike.
    """

    sensor: SensorKey
    covariance: Array
    loading: Array | None = None
    growth: Array | None = None
    unlike: tuple[float, ...] | None = None
    slopes: Array | None = None

    def rows(self, index: Rows) -> White:
        """The same noise on some of the rows."""
        loading = None if self.loading is None else self.loading[index]
        growth = None if self.growth is None else self.growth[index]
        slopes = None if self.slopes is None else self.slopes[index]
        return White(self.sensor, self.covariance[index], loading, growth, self.unlike, slopes)

    def grown(self, level: NoiseLevel) -> White:
        """The noise as the log has it, its readings unlike, with episodes, where the level says."""
        if not level.episodes or (self.growth is None and self.slopes is None):
            return self
        loading, covariance = self.loading, self.covariance
        if self.slopes is not None:
            own = self.slopes * np.array(self.unlike)
            covariance = own @ np.swapaxes(own, 1, 2)
            loading = None if loading is None else own
        if self.growth is not None:
            times = self.growth[:, None, None]
            covariance = times**2 * covariance
            loading = None if loading is None else times * loading
        return White(self.sensor, covariance, loading)


@dataclass(frozen=True, slots=True)
class Slow:
    """Gauss-Markov noise of one sensor: loading (n, 3, m) [m] per unit of the spec's std.

    limits: most that each variance may be over the spec's without being a finding.  means: most
    that the variance of its mean over the log may be, as far as the log's own courses show.
    """

    sensor: SensorKey
    loading: Array
    shared_time: bool  # one time constant for all columns
    limits: tuple[float, ...] = (SLOW_LIMIT,) * 3
    means: tuple[float, ...] = (math.inf,) * 3

    @property
    def columns(self) -> int:
        return int(self.loading.shape[2])


@dataclass(frozen=True, slots=True)
class Directed:
    """White noise along the motion: covariance size^2 direction direction' per row (n, 3, k).

    It comes from errors of stamps, so the rows of one stamp share it.
    """

    key: str
    direction: Array


@dataclass(frozen=True, slots=True)
class Structure:
    """All parts that the covariance of a series can be made of, on its rows.

    fixed (n, 3, 3) [m2]: what is known and not fitted, each row's own.  stamped (n, 3, k) [m]: the
    same, common to the rows of a stamp: the spec's timing errors.  survey (n, 3, q) [m]: errors of
    the targets' survey, one standard deviation each, common to all rows of a target; and of a frame
    that the log alone laid.
    """

    time_s: Array
    white: tuple[White, ...]
    slow: tuple[Slow, ...]
    fixed: Array
    directed: tuple[Directed, ...] = ()
    stamped: Array | None = None
    one_reading: bool = True  # of the vehicle for all rows of a stamp
    survey: Array | None = None
    factored: dict[NoiseLevel, Precision] = field(
        init=False, default_factory=dict, compare=False, repr=False
    )

    @property
    def shared(self) -> bool:
        """Whether rows share stamps, and with them the vehicle's noise."""
        return self.one_reading and repeated(self.time_s)

    def rows(self, index: Rows) -> Structure:
        """The same structure on some of the rows."""
        return Structure(
            self.time_s[index],
            tuple(w.rows(index) for w in self.white),
            tuple(replace(s, loading=s.loading[index]) for s in self.slow),
            self.fixed[index],
            tuple(Directed(d.key, d.direction[index]) for d in self.directed),
            None if self.stamped is None else self.stamped[index],
            self.one_reading,
            None if self.survey is None else self.survey[index],
        )


@dataclass(frozen=True, slots=True)
class NoiseLevel:
    """Fitted noise.

    factor: per white part; slow: per slow part the variances over the spec's, per column;
    time_constant_s: per slow part, per column; size: per directed part [its unit].
    episodes: whether white noise is as uneven as the structure says the log's is: larger for a
    while, or in some readings of a sensor.
    """

    factor: tuple[float, ...]
    slow: tuple[tuple[float, ...], ...]
    time_constant_s: tuple[tuple[float, ...], ...]
    size: tuple[float, ...] = ()
    episodes: bool = True


@dataclass(frozen=True, slots=True)
class Bounds:
    """Upper limits of the fit; an effect that is part of the model opens some of them."""

    factor: tuple[float, ...]
    slow: tuple[tuple[float, ...], ...]

    def opened(self, structure: Structure, sensor: SensorKey, what: str) -> Bounds:
        """Open the factor ("factor", "tails"), all slow variances ("slow") or one ("down")."""
        factor = tuple(
            OPEN if what in ("factor", "tails") and w.sensor == sensor else limit
            for w, limit in zip(structure.white, self.factor, strict=True)
        )
        slow = tuple(
            tuple(
                OPEN if part.sensor == sensor and (what == "slow" or _is_down(what, k)) else limit
                for k, limit in enumerate(limits)
            )
            for part, limits in zip(structure.slow, self.slow, strict=True)
        )
        return Bounds(factor, slow)

    def hold(self, level: NoiseLevel, free_sizes: Sequence[int]) -> bool:
        """Whether a level is within the limits, with no directed part but the free ones."""
        limits = [*self.factor, *(limit for own in self.slow for limit in own)]
        figures = [*level.factor, *(v for own in level.slow for v in own)]
        within = all(v <= b * (1.0 + ROUNDING) for v, b in zip(figures, limits, strict=True))
        return within and all(s == 0.0 or i in free_sizes for i, s in enumerate(level.size))


def _is_down(what: str, axis: int) -> bool:
    return what == "down" and axis == 2


def spec_bounds(structure: Structure) -> Bounds:
    """What the spec allows."""
    return Bounds(
        tuple(FACTOR_LIMIT for _ in structure.white),
        tuple(s.limits for s in structure.slow),
    )


def first_guess(structure: Structure) -> NoiseLevel:
    """White noise of nearly the spec's size, and some slow noise."""
    return NoiseLevel(
        tuple(0.9 for _ in structure.white),
        tuple(tuple(0.05 for _ in range(s.columns)) for s in structure.slow),
        tuple(tuple(TIME_USUAL_S for _ in range(s.columns)) for s in structure.slow),
        tuple(0.0 for _ in structure.directed),
    )


def as_specified(structure: Structure) -> NoiseLevel:
    """The spec's white noise and nothing else."""
    guess = first_guess(structure)
    return replace(
        guess,
        episodes=False,
        factor=tuple(1.0 for _ in structure.white),
        slow=tuple(tuple(SLOW_LEAST for _ in range(s.columns)) for s in structure.slow),
    )


def clipped(level: NoiseLevel, bounds: Bounds) -> NoiseLevel:
    """The level brought within bounds, with no directed part: the noise without its findings."""
    return replace(
        level,
        factor=tuple(min(f, b) for f, b in zip(level.factor, bounds.factor, strict=True)),
        slow=tuple(
            tuple(min(v, b) for v, b in zip(vs, bs, strict=True))
            for vs, bs in zip(level.slow, bounds.slow, strict=True)
        ),
        size=tuple(0.0 for _ in level.size),
        episodes=False,
    )


def with_size(level: NoiseLevel, index: int, size: float) -> NoiseLevel:
    """The level with one directed part at another size."""
    sizes = tuple(size if k == index else s for k, s in enumerate(level.size))
    return replace(level, size=sizes)


def white_covariance(structure: Structure, level: NoiseLevel) -> Array:
    """Covariance of every row's white noise (n, 3, 3) [m2], whatever it shares with others."""
    total = structure.fixed.copy()
    if structure.stamped is not None:
        total += structure.stamped @ np.swapaxes(structure.stamped, 1, 2)
    for part, factor in zip(structure.white, level.factor, strict=True):
        total += factor**2 * part.grown(level).covariance
    for directed, size in zip(structure.directed, level.size, strict=True):
        if size > 0.0:
            total += size**2 * (directed.direction @ np.swapaxes(directed.direction, 1, 2))
    diagonal = np.einsum("nii->ni", total)
    diagonal *= 1.0 + RELATIVE_FLOOR
    return total


def row_covariance(structure: Structure, level: NoiseLevel) -> Array:
    """Sigma (n, 3, 3) [m2]: the white noise that a row has for itself."""
    total = structure.fixed.copy()
    for part, factor in zip(structure.white, level.factor, strict=True):
        if part.loading is None:
            total += factor**2 * part.grown(level).covariance
    return total


def common_loading(structure: Structure, level: NoiseLevel) -> Array:
    """White noise that is new at every stamp and common to its rows, (n, 3, k) [m]."""
    columns = [np.zeros((structure.time_s.shape[0], 3, 0))]
    if structure.stamped is not None:
        columns.append(structure.stamped)
    for part, factor in zip(structure.white, level.factor, strict=True):
        if part.loading is not None:
            columns.append(factor * np.asarray(part.grown(level).loading))
    for directed, size in zip(structure.directed, level.size, strict=True):
        if size > 0.0:
            columns.append(size * directed.direction)
    return np.concatenate(columns, axis=2)


def loadings(structure: Structure, level: NoiseLevel) -> tuple[Array, Array]:
    """B (n, 3, m) [m] and time constants (m,) [s]; a slow part grows with an understated factor."""
    columns: list[Array] = [np.zeros((structure.time_s.shape[0], 3, 0))]
    times: list[float] = []
    factors = {w.sensor: max(f, 1.0) for w, f in zip(structure.white, level.factor, strict=True)}
    for part, slow, time_s in zip(structure.slow, level.slow, level.time_constant_s, strict=True):
        scale = np.sqrt(np.array(slow)) * factors.get(part.sensor, 1.0)
        columns.append(part.loading * scale)
        times.extend(time_s)
    return np.concatenate(columns, axis=2), np.array(times)


def precision(structure: Structure, level: NoiseLevel) -> Precision:
    """The factored covariance of the structure at a noise level.

    Rivals are fitted from the same noise one after the other, so the last few are kept.
    """
    kept = structure.factored
    known = kept.pop(level, None)
    if known is None:
        known = _in_time(structure, level)
        known = known if structure.survey is None else with_lasting(known, structure.survey)
        while len(kept) >= KEPT:
            del kept[next(iter(kept))]
    kept[level] = known
    return known


def _in_time(structure: Structure, level: NoiseLevel) -> Precision:
    """The same without the errors of the survey."""
    loading, times = loadings(structure, level)
    if not structure.shared:
        return factored(white_covariance(structure, level), loading, structure.time_s, times)
    common = common_loading(structure, level)
    columns = np.concatenate([loading, common], axis=2)
    times = np.concatenate([times, np.zeros(common.shape[2])])
    return factored(row_covariance(structure, level), columns, structure.time_s, times)


def marginal_variance(structure: Structure, level: NoiseLevel) -> Array:
    """Variance of every component [m2], (n, 3)."""
    loading, _ = loadings(structure, level)
    white = white_covariance(structure, level)
    total: Array = np.einsum("nii->ni", white) + np.sum(loading**2, axis=2)
    return total
