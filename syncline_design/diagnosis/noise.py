"""Noise of the error series: what the spec says, how much and how slow it may be, and the fit.

Per sensor: white noise of the spec's covariance times factor^2; per axis of position and attitude
a first-order Gauss-Markov process.  Within `Bounds` such noise is what the spec allows; beyond, it
is a finding.
"""

from __future__ import annotations

import math
from dataclasses import field, replace

import numpy as np
from scipy.linalg import LinAlgError

from syncline_design.diagnosis.covariance import Precision, factored, with_lasting
from syncline_design.diagnosis.noise_slopes import Slopes, noise_slopes, summed_over
from syncline_design.effects.record import Array
from syncline_design.logs.log import Rows
from syncline_design.logs.stamps import repeated
from syncline_design.machine.quick_dataclass import dataclass

SensorKey = tuple[str, str]  # (stage, role)

FACTOR_LIMIT = 1.1  # white noise up to this factor of the spec's is the spec's
SLOW_LIMIT = 1.2  # slow variance over the spec's that still is of the spec's size
FACTOR_LEAST = 0.05
SLOW_LEAST = 1e-4
OPEN = 1e6
RELATIVE_FLOOR = 1e-12  # of a row's variances: keeps them invertible whatever sizes meet in a row
TIME_LEAST_S = 0.2
TIME_LEAST_STAMPS = 2.0  # between stamps: noise that is quicker is white in the log
TIME_MOST_S = 120.0
TIME_USUAL_S = 25.0  # centre of the weak prior on time constants: minutes or fractions of one
FACTOR_SPREAD = 0.15  # of the prior on log factor, below the limit
TIME_SPREAD = 1.0  # its standard deviation in log T
KEPT = 3  # factored covariances of one structure
LONG_SHARE = 1e3  # time constants over the span, from which a series is exact
MEAN_SPREAD = 0.1  # in log variance, by which a mean over the log may exceed what courses show


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
    the targets' survey, one standard deviation each, common to all rows of a target.
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


class _Packing:
    """Noise level <-> vector of logarithms, with bounds."""

    def __init__(self, structure: Structure, bounds: Bounds, free_sizes: tuple[int, ...]) -> None:
        self.structure = structure
        self.bounds = bounds
        self.free_sizes = free_sizes
        between = np.diff(np.unique(structure.time_s))
        usual_s = float(np.median(between)) if between.size else 0.0
        self.least_s = float(np.clip(TIME_LEAST_STAMPS * usual_s, TIME_LEAST_S, TIME_USUAL_S))
        self.span_s = max(float(structure.time_s[-1] - structure.time_s[0]), self.least_s)

    def pack(self, level: NoiseLevel) -> Array:
        values = [*level.factor]
        for slow in level.slow:
            values += [max(v, 10 * SLOW_LEAST) for v in slow]
        for part, times in zip(self.structure.slow, level.time_constant_s, strict=True):
            values += times[:1] if part.shared_time else times
        values += [max(level.size[i], 1e-6) for i in self.free_sizes]
        logs = np.log(np.array(values))
        low, high = np.array(self.limits()).T
        packed: Array = np.clip(logs, low, high)
        return packed

    def limits(self) -> list[tuple[float, float]]:
        limits = [(np.log(FACTOR_LEAST), np.log(b)) for b in self.bounds.factor]
        for slow in self.bounds.slow:
            limits += [(np.log(SLOW_LEAST), np.log(b)) for b in slow]
        for part in self.structure.slow:
            count = 1 if part.shared_time else part.columns
            limits += [(np.log(self.least_s), np.log(TIME_MOST_S))] * count
        limits += [(np.log(1e-7), np.log(10.0))] * len(self.free_sizes)
        return limits

    def unpack(self, vector: Array) -> NoiseLevel:
        values = [float(v) for v in np.exp(vector)]
        factor = tuple(values[: len(self.structure.white)])
        at = len(factor)
        slow: list[tuple[float, ...]] = []
        times: list[tuple[float, ...]] = []
        for part in self.structure.slow:
            slow.append(tuple(values[at : at + part.columns]))
            at += part.columns
        for part in self.structure.slow:
            count = 1 if part.shared_time else part.columns
            own = values[at : at + count]
            times.append(tuple(own * part.columns if part.shared_time else own))
            at += count
        size = [0.0] * len(self.structure.directed)
        for i, value in zip(self.free_sizes, values[at:], strict=True):
            size[i] = value
        return NoiseLevel(factor, tuple(slow), tuple(times), tuple(size))

    def slopes_at(self, level: NoiseLevel, known: Precision, error: Array) -> Slopes:
        """Slopes of the NLL by what the covariance is made of."""
        _, times = loadings(self.structure, level)
        fresh = np.zeros(known.loading.shape[2] - times.shape[0])
        return noise_slopes(known, error, self.structure.time_s, np.concatenate([times, fresh]))

    def slopes(self, level: NoiseLevel, found: Slopes) -> Array:
        """Slopes of the NLL and the prior by the packed logarithms."""
        factor, slow, sizes = self._by_size(level, found.white, found.column)
        inside = np.array(level.factor) < FACTOR_LIMIT
        factor += np.where(inside, np.log(level.factor), 0.0) / FACTOR_SPREAD**2
        usual = [
            np.log(t / TIME_USUAL_S) / TIME_SPREAD**2
            for part, chosen in zip(self.structure.slow, level.time_constant_s, strict=True)
            for t in (chosen[:1] if part.shared_time else chosen)
        ]
        excess, by_time = self._excess_slopes(level)
        constants = self._of_times(found.time) + usual + by_time
        return np.concatenate([factor, slow + excess, constants, sizes])

    def steepness(self, level: NoiseLevel, found: Slopes) -> Array:
        """About how the NLL bends along each packed logarithm: scales that a search is quick in.

        What a part makes up of the error, half of it for a time constant, and the prior's own.
        """
        factor, slow, sizes = self._by_size(level, found.expected_white, found.expected_column)
        inside = np.array(level.factor) < FACTOR_LIMIT
        times = 0.5 * self._of_times(0.5 * found.expected_column) + TIME_SPREAD**-2
        return np.concatenate(
            [np.maximum(factor, 1.0) + inside / FACTOR_SPREAD**2, slow + 1.0, times, sizes + 1.0]
        )

    def _of_times(self, column: Array) -> Array:
        """Figures of the slow columns, summed where these share a time constant."""
        at = 0
        found: list[float] = []
        for part in self.structure.slow:
            held = column[at : at + part.columns]
            at += part.columns
            found += [float(np.sum(held))] if part.shared_time else held.tolist()
        return np.array(found)

    def _by_size(
        self, level: NoiseLevel, white: Array, column: Array
    ) -> tuple[Array, Array, Array]:
        """By the logarithms of factors, slow variances and sizes: from the slopes by covariances.

        white (n, 3, 3): by each row's; column (m,): by the logarithm of each column's scale.
        """
        structure = self.structure
        own = np.cumsum([0, *(part.columns for part in structure.slow)])
        factor = np.array(
            [
                2.0 * f**2 * summed_over(white, w.grown(level).covariance)
                if not structure.shared or w.loading is None
                else 0.0
                for w, f in zip(structure.white, level.factor, strict=True)
            ]
        )
        for k, part in enumerate(structure.slow):
            index = [w.sensor for w in structure.white].index(part.sensor)
            if level.factor[index] > 1.0:
                factor[index] += float(np.sum(column[own[k] : own[k + 1]]))
        sizes = self._shared(level, column[own[-1] :], factor)
        if not structure.shared:
            parts = [structure.directed[i].direction for i in self.free_sizes]
            sizes = [
                2.0 * level.size[i] ** 2 * summed_over(white, d @ np.swapaxes(d, 1, 2))
                for i, d in zip(self.free_sizes, parts, strict=True)
            ]
        return factor, 0.5 * column[: own[-1]], np.array(sizes)

    def _shared(self, level: NoiseLevel, column: Array, factor: Array) -> list[float]:
        """Slopes by the columns that rows of a stamp share: added to the factors; by the sizes."""
        structure, at = self.structure, 0
        sizes = dict.fromkeys(self.free_sizes, 0.0)
        if not structure.shared:
            return list(sizes.values())
        at += 0 if structure.stamped is None else structure.stamped.shape[2]
        for k, part in enumerate(structure.white):
            if part.loading is not None:
                width = part.loading.shape[2]
                factor[k] += float(np.sum(column[at : at + width]))
                at += width
        for i, (directed, size) in enumerate(zip(structure.directed, level.size, strict=True)):
            if size > 0.0:
                width = directed.direction.shape[2]
                if i in sizes:
                    sizes[i] = float(np.sum(column[at : at + width]))
                at += width
        return list(sizes.values())

    def prior(self, level: NoiseLevel) -> float:
        """Weak prior [nat]: where the log does not tell, factors are 1 and time constants usual."""
        logs = [np.log(min(f, FACTOR_LIMIT)) for f in level.factor]
        total = float(sum(0.5 * (value / FACTOR_SPREAD) ** 2 for value in logs))
        for part, times in zip(self.structure.slow, level.time_constant_s, strict=True):
            used = times[:1] if part.shared_time else times
            total += sum(0.5 * (np.log(t / TIME_USUAL_S) / TIME_SPREAD) ** 2 for t in used)
        return total + sum(0.5 * x**2 for own in self._excess(level) for x in own)

    def _excess(self, level: NoiseLevel) -> list[list[float]]:
        """By how many deviations the means of the slow noise exceed what the log shows of them."""
        found = []
        for k, part in enumerate(self.structure.slow):
            both = zip(level.slow[k], level.time_constant_s[k], part.means, strict=True)
            most = self.bounds.slow[k]
            found.append(
                [
                    max(math.log(v * mean_share(t, self.span_s) / limit) / MEAN_SPREAD, 0.0)
                    if math.isfinite(limit) and open_to < OPEN
                    else 0.0
                    for (v, t, limit), open_to in zip(both, most, strict=True)
                ]
            )
        return found

    def _excess_slopes(self, level: NoiseLevel) -> tuple[Array, Array]:
        """Slopes of their cost by the logarithms of the variances and of the time constants."""
        by_slow: list[float] = []
        by_time: list[float] = []
        for k, own in enumerate(self._excess(level)):
            cost = np.array(own) / MEAN_SPREAD
            times = level.time_constant_s[k]
            held = cost * [mean_share_slope(t, self.span_s) for t in times]
            by_slow += cost.tolist()
            by_time += (
                [float(np.sum(held))] if self.structure.slow[k].shared_time else held.tolist()
            )
        return np.array(by_slow), np.array(by_time)


def mean_share(time_constant_s: float, span_s: float) -> float:
    """Variance that the mean over a span has of unit Gauss-Markov noise, 2r - 2r^2 (1 - e^(-1/r)).

    r = T / span: the integral of exp(-|t - s| / T) over both, over the span squared.
    """
    r = time_constant_s / span_s
    if r > LONG_SHARE:  # the difference below cancels
        return 1.0 - 1.0 / (3.0 * r)
    return 2.0 * r + 2.0 * r * r * math.expm1(-1.0 / r)


def mean_share_slope(time_constant_s: float, span_s: float) -> float:
    """d log mean_share / d log T."""
    r = time_constant_s / span_s
    if r > LONG_SHARE:
        return 1.0 / (3.0 * r - 1.0)
    slope = 2.0 + 4.0 * r * math.expm1(-1.0 / r) + 2.0 * math.exp(-1.0 / r)
    return r * slope / mean_share(time_constant_s, span_s)


def fit_noise(
    structure: Structure,
    error: Array,
    bounds: Bounds,
    start: NoiseLevel,
    free_sizes: tuple[int, ...] = (),
    iterations: int = 30,
) -> tuple[NoiseLevel, float]:
    """Noise level of largest likelihood within bounds, and the NLL [nat] reached (no prior in it).

    error (n, 3) [m] on the structure's rows, which holds no errors of a survey; free_sizes: which
    directed parts are fitted.
    """
    from scipy.optimize import minimize

    packing = _Packing(structure, bounds, free_sizes)
    first = packing.pack(start)
    level = packing.unpack(first)
    found = packing.slopes_at(level, precision(structure, level), error)
    scale = np.sqrt(packing.steepness(level, found))
    begun = (first * scale, level, found)

    def cost(scaled: Array) -> tuple[float, Array]:
        at, level, found = begun
        if not np.array_equal(scaled, at):
            level = packing.unpack(scaled / scale)
            try:
                found = packing.slopes_at(level, precision(structure, level), error)
            except LinAlgError:
                return 1e15, np.zeros_like(scaled)
        total = precision(structure, level).likelihood_of(found.squares) + packing.prior(level)
        return total, packing.slopes(level, found) / scale

    result = minimize(
        cost,
        first * scale,
        jac=True,
        method="L-BFGS-B",
        bounds=np.array(packing.limits()) * scale[:, None],
        options={"maxiter": iterations, "ftol": 5e-6, "gtol": 0.1, "maxls": 10},
    )
    level = packing.unpack(result.x / scale)
    return level, float(result.fun) - packing.prior(level)
