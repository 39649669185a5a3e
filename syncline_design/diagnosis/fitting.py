"""Fit effects and noise together: generalised least squares on the re-simulated error.

Gauss-Newton with step halving, on the scene itself and not on its linearisation; the noise is
fitted again after every change of the effects, as what it absorbs depends on what is removed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.axes import Axes, varying_axes
from syncline_design.diagnosis.borrowed import Noisier, borrowed_nats
from syncline_design.diagnosis.candidates import Candidate, slopes
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.noise import (
    Bounds,
    NoiseLevel,
    Structure,
    first_guess,
    precision,
    spec_bounds,
)
from syncline_design.diagnosis.noise_fit import fit_noise
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

NOISE_ROWS = 800  # rows on which the noise is fitted; stretches spread over the whole log
POLISH_ROWS = 3000
STRETCH = 80
WINDOW = 500
FIRST_TIMES_S = (None, 3.0, 30.0)
FAR = 3.0  # standard uncertainties of a step after which slopes are found anew
LONG, SHORT = 40, 25  # looks of a noise fit from scratch, and from a good start


@dataclass(frozen=True, slots=True)
class Data:
    """A scene with its noise structure, the rows the noise is fitted on, and the axes compared."""

    view: Scene
    structure: Structure
    noise_rows: NDArray[np.int64]
    noise_structure: Structure
    axes: Axes
    noisier: tuple[Noisier, ...] = ()  # once a search is on
    explained: Array | None = None  # (n, 3, f) what effects could make of the error, once known

    def borrowed_nats(self, model: Model, known: Precision) -> float:
        """What noise of the columns of motion costs a model's effects [nat], at a covariance."""
        return borrowed_nats(self.noisier, model.acting, model.error, known)

    def error(self, acting: Sequence[Acting]) -> Array:
        """Corrected error with unknown components at zero (they have a huge variance)."""
        return np.nan_to_num(self.view.error(acting))


def data_of(view: Scene, structure: Structure) -> Data:
    """A scene ready for fitting."""
    index = windows(len(view), NOISE_ROWS, STRETCH)
    axes = varying_axes(view.error(), structure)
    return Data(view, structure, index, _in_time(structure, index), axes)


def _in_time(structure: Structure, index: NDArray[np.int64]) -> Structure:
    """The structure that noise is fitted with: what the survey's errors leave.

    The same one where that is all of it: what is factored for the one then serves the other.
    """
    if structure.survey is None and len(index) == len(structure.time_s):
        return structure
    return replace(structure.rows(index), survey=None)


def windows(rows: int, most: int, length: int) -> NDArray[np.int64]:
    """Contiguous windows of rows spread evenly over a log, the first row among them."""
    if rows <= most:
        return np.arange(rows)
    count = max(most // length, 1)
    starts = np.linspace(0, rows - length, count).astype(np.int64)
    return np.unique((starts[:, None] + np.arange(length)).ravel())


@dataclass(frozen=True, slots=True)
class Opened:
    """A stochastic effect that is part of the model: what it lets the noise do.

    what: "factor", "tails", "slow" or "down" of a sensor, or "size" of a directed part.
    """

    candidate: Candidate
    what: str
    directed: int = -1


@dataclass(frozen=True, slots=True)
class Model:
    """Effects and noise fitted to a log.

    nll: of all rows in use [nat]; covariance (P, P) of the continuous parameters of `acting`, in
    their order; error (n, 3) what is left [m].
    """

    acting: tuple[Acting, ...]
    opened: tuple[Opened, ...]
    bounds: Bounds
    level: NoiseLevel
    nll: float
    covariance: Array
    error: Array
    precision: Precision

    @property
    def labels(self) -> tuple[tuple[str, str, int], ...]:
        """Everything named, each once, in order: effects that move the mean first."""
        moved = [a.label for a in self.acting]
        return tuple(dict.fromkeys([*moved, *(o.candidate.label for o in self.opened)]))

    @property
    def scatter(self) -> Array:
        """What is left less the targets' survey errors (n, 3) [m]: what the noise is fitted to."""
        return self.error - self.precision.constant_part(self.error)

    @property
    def free_sizes(self) -> tuple[int, ...]:
        return tuple(o.directed for o in self.opened if o.directed >= 0)


def bounds_of(data: Data, opened: Sequence[Opened]) -> Bounds:
    """What the noise may be once some effects open it."""
    bounds = spec_bounds(data.structure)
    for one in opened:
        if one.what != "size":
            stage = data.view.system.stages[one.candidate.stage].name
            bounds = bounds.opened(data.structure, (stage, one.candidate.sensor), one.what)
    return bounds


def fit(
    data: Data,
    acting: Sequence[Acting] = (),
    opened: Sequence[Opened] = (),
    start: NoiseLevel | None = None,
    against: float = math.inf,
) -> Model:
    """Fit the parameters of the effects, then the noise, then the effects once more.

    Without a start the noise is fitted from the spec's; with one, the effects are adjusted at that
    noise first, so that what they explain is not taken for noise.  It is fitted on some of the
    rows, and stays what it was where that suits all of them better.  against: NLL [nat] of what it
    is held against; how far behind that it is need not be known well.
    """
    bounds = bounds_of(data, opened)
    sizes = tuple(o.directed for o in opened if o.directed >= 0)
    level = start or first_guess(data.structure)
    factored = precision(data.structure, level)
    found = stepped(data, tuple(acting), factored, data.error(acting))
    nll = factored.likelihood_of(found.squares)
    starts = [level] if start is not None else [slow_guess(level, t) for t in FIRST_TIMES_S]
    scatter = found.error - factored.constant_part(found.error)
    fitted = _fitted_noise(data, scatter, starts, bounds, sizes, nll - against)
    known = precision(data.structure, fitted)
    after = stepped(data, found.acting, known, found.error, columns=found.columns)
    nll_after = known.likelihood_of(after.squares)
    if not (bounds.hold(level, sizes) and nll < nll_after):
        level, factored, found, nll = fitted, known, after, nll_after
    return Model(
        found.acting, tuple(opened), bounds, level, nll, found.covariance, found.error, factored
    )


def _fitted_noise(
    data: Data,
    scatter: Array,
    starts: Sequence[NoiseLevel],
    bounds: Bounds,
    sizes: tuple[int, ...],
    behind: float,
) -> NoiseLevel:
    """The likeliest level on the rows that noise is fitted on; behind: nat, over all rows."""
    looks = LONG if len(starts) > 1 else SHORT
    behind *= len(data.noise_rows) / len(data.view)
    own, structure = scatter[data.noise_rows], data.noise_structure
    fits = [fit_noise(structure, own, bounds, one, sizes, looks, behind) for one in starts]
    level, _ = min(fits, key=lambda found: found[1])
    return level


def thinned(data: Data, model: Model, most: int) -> tuple[Data, Model]:
    """Data and model on windows of the rows, for tests with many regressors."""
    index = windows(len(data.view), most, WINDOW)
    if index.shape[0] == len(data.view):
        return data, model
    structure = data.structure.rows(index)
    fewer = data_of(data.view.part(index), structure)
    known = precision(structure, model.level)
    return fewer, replace(model, error=model.error[index], precision=known)


def finely(data: Data) -> Data:
    """The data with the noise fitted on POLISH_ROWS rows, for the final figures."""
    index = windows(len(data.view), POLISH_ROWS, STRETCH)
    return replace(data, noise_rows=index, noise_structure=_in_time(data.structure, index))


def slow_guess(level: NoiseLevel, time_s: float | None) -> NoiseLevel:
    """The level with half of the variance slow, of one time constant; None leaves it as it is.

    The likelihood has several peaks in the time constant, so a fit from scratch starts at each.
    """
    if time_s is None:
        return level
    return replace(
        level,
        factor=tuple(0.75 for _ in level.factor),
        slow=tuple(tuple(0.4 for _ in own) for own in level.slow),
        time_constant_s=tuple(tuple(time_s for _ in own) for own in level.time_constant_s),
    )


def adjusted(
    data: Data, acting: tuple[Acting, ...], known: Precision, error: Array, steps: int = 3
) -> tuple[tuple[Acting, ...], Array, Array]:
    """Parameters of least e' C^-1 e at a known C; (effects, their error, covariance (P, P))."""
    found = stepped(data, acting, known, error, steps)
    return found.acting, found.error, found.covariance


@dataclass(frozen=True, slots=True)
class Stepped:
    """Effects at their best at a known C: the error they leave, and its e' C^-1 e.

    covariance (P, P); columns (n, 3, P): the slopes that it ends with.
    """

    acting: tuple[Acting, ...]
    error: Array
    squares: float
    covariance: Array
    columns: Array


def stepped(
    data: Data,
    acting: tuple[Acting, ...],
    known: Precision,
    error: Array,
    steps: int = 3,
    columns: Array | None = None,
) -> Stepped:
    """The same, with all that was found; columns: slopes found nearby to start from."""
    squares = _squares(known, error)
    if not acting:
        return Stepped(acting, error, squares, np.zeros((0, 0)), np.zeros((*error.shape, 0)))
    if columns is None:
        columns = np.nan_to_num(slopes(data.view, acting))
    weighted = known.solve(columns)
    for _ in range(steps):
        normal, right = inner(columns, weighted), inner(weighted, error[:, :, None])[:, 0]
        change = solve_scaled(normal, right)
        acting, error, squares, moved = _stepped(data, acting, change, known, (error, squares))
        size2 = moved * moved * float(change @ normal @ change)
        if size2 < 1e-4:
            break
        if size2 > FAR**2:  # the slopes of the old place may not hold in the new one
            columns = np.nan_to_num(slopes(data.view, acting))
            weighted = known.solve(columns)
    return Stepped(acting, error, squares, inverse_scaled(inner(columns, weighted)), columns)


def inner(first: Array, second: Array) -> Array:
    """Sum over rows and components of first (n, 3, p) times second (n, 3, q); (p, q)."""
    product: Array = first.reshape(-1, first.shape[2]).T @ second.reshape(-1, second.shape[2])
    return product


def scored(known: Precision, columns: Array, error: Array) -> tuple[Array, Array]:
    """X' C^-1 X (p, p) and X' C^-1 e (p,), X (n, 3, p) and e (n, 3)."""
    both = known.information(np.concatenate([columns, error[:, :, None]], axis=2))
    return both[:-1, :-1], both[:-1, -1]


def _stepped(
    data: Data,
    acting: tuple[Acting, ...],
    change: Array,
    known: Precision,
    before: tuple[Array, float],
) -> tuple[tuple[Acting, ...], Array, float, float]:
    """The longest of the full step and its halves that lowers the weighted squares.

    before: the error and its squares.  Effects, error and squares after, and the share.
    """
    error, squares = before
    for share in (1.0, 0.5, 0.25, 0.1):
        trial = _moved(acting, share * change)
        left = data.error(trial)
        fewer = _squares(known, left)
        if fewer <= squares:
            return trial, left, fewer, share
    return acting, error, squares, 0.0


def _squares(known: Precision, error: Array) -> float:
    return float(known.squares(error[:, :, None])[0])


def _moved(acting: Sequence[Acting], change: Array) -> tuple[Acting, ...]:
    at, result = 0, []
    for one in acting:
        names = [p.name for p in one.effect.slopes()]
        added = {n: one.values[n] + float(change[at + i]) for i, n in enumerate(names)}
        at += len(names)
        result.append(replace(one, values={**one.values, **added}))
    return tuple(result)


def solve_scaled(normal: Array, right: Array) -> Array:
    """Solve normal x = right with columns scaled alike; directions the log cannot see stay put."""
    scale = _scale(normal)
    seen = np.diag(normal) > 0.0
    scaled = normal / scale[:, None] / scale
    solution: Array = np.asarray(np.linalg.lstsq(scaled, right / scale, rcond=1e-10)[0]) / scale
    return np.where(seen, solution, 0.0)


def _scale(normal: Array) -> Array:
    scale: Array = np.sqrt(np.maximum(np.diag(normal), 0.0))
    scale[scale == 0.0] = 1.0
    return scale


def inverse_scaled(normal: Array) -> Array:
    """Inverse of the normal matrix, columns scaled alike first; zero for what no row depends on."""
    scale = _scale(normal)
    seen = np.diag(normal) > 0.0
    scaled = normal / scale[:, None] / scale
    inverse: Array = np.asarray(np.linalg.pinv(scaled, rcond=1e-12)) / scale[:, None] / scale
    return np.where(seen[:, None] & seen, inverse, 0.0)
