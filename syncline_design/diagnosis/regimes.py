"""Where a log disagrees: whitened scores by regime and axis."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.fitting import inverse_scaled
from syncline_design.diagnosis.gap_result import Regime
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.stamps import groups, per_stamp
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit

BINS = 6
TOGETHER = 36_000  # rows of cells whose columns are solved at once
SMOOTH_S, LEAST_HALF = 3.0, 3
STRONG = 4.0  # a cell's score that is worth showing
AXES = ("north", "east", "down", "along", "across", "forward", "right", "body_down")
WINDOWS = 40  # of time, for the first disagreement


@dataclass(frozen=True, slots=True)
class Covariate:
    name: str
    unit: str
    values: Array


def covariates(view: Scene) -> tuple[Covariate, ...]:
    """What a regime is told by: last stage's motion and bearing, and time."""
    rows = view.rows[-1]
    horizontal = np.hypot(*rotate(rows.rotation, rows.velocity_mps)[:, :2].T)
    found = [
        Covariate("speed", "m/s", horizontal),
        Covariate("turn_rate", "deg/s", np.degrees(rows.rate_radps[:, 2])),
        Covariate("heading", "deg", np.degrees(_smooth_angle(rows.euler_rad[:, 2], view))),
        Covariate("time", "s", view.log.time_s),
    ]
    if view.log.kind == "georeference":
        azimuth = np.degrees(np.angle(np.exp(1j * rows.azimuth_rad)))
        found += [Covariate("range", "m", rows.range_m), Covariate("azimuth", "deg", azimuth)]
    return tuple(found)


def level_axes(view: Scene) -> Array:
    """North, east, down, and level forward and right by the smoothed heading: (n, 3, 5)."""
    heading = _smooth_angle(view.rows[-1].euler_rad[:, 2], view)
    cos, sin, zero = np.cos(heading), np.sin(heading), np.zeros_like(heading)
    turned = np.stack([np.stack([cos, sin, zero], 1), np.stack([-sin, cos, zero], 1)], axis=2)
    return np.concatenate([np.broadcast_to(np.eye(3), (len(view), 3, 3)), turned], axis=2)


def _smooth_angle(angle_rad: Array, view: Scene) -> Array:
    """Angles averaged over SMOOTH_S, wrapped.

    A regime must not be told by the very noise that is in the error: on a straight line the
    measured heading is nothing but that.
    """
    times = view.log.time_s
    half = max(LEAST_HALF, round(0.5 * SMOOTH_S / view.log.interval_s))
    kernel = np.ones(2 * half + 1)
    _, phasor = per_stamp(times, np.exp(1j * angle_rad))
    total = np.convolve(np.pad(phasor, half, mode="edge"), kernel, mode="valid")
    smooth: Array = np.angle(total)[groups(times)]
    return smooth


def axis_vectors(view: Scene) -> Array:
    """Unit vectors (n, 3, 8) of AXES in NED."""
    rows = view.rows[-1]
    n = len(view)
    ned = np.broadcast_to(np.eye(3), (n, 3, 3))
    velocity = rotate(rows.rotation, rows.velocity_mps)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > 0.05
    scale = np.where(moving, 1.0 / np.where(moving, speed, 1.0), 0.0)
    along = np.stack([velocity[:, 0] * scale, velocity[:, 1] * scale, np.zeros(n)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0], np.zeros(n)], axis=-1)
    return np.concatenate([ned, along[:, :, None], across[:, :, None], rows.rotation], axis=2)


def where_maps(
    view: Scene, errors: Sequence[Array], known: Precision
) -> tuple[tuple[Regime, ...], ...]:
    """All cells, of each error; the score takes the noise's correlation into account."""
    axes = axis_vectors(view)
    weighted = [known.solve(np.nan_to_num(error)[:, :, None])[:, :, 0] for error in errors]
    numerators = [np.einsum("nij,ni->nj", axes, own) for own in weighted]
    plain = [np.einsum("nij,ni->nj", axes, np.nan_to_num(error)) for error in errors]
    found: list[list[Regime]] = [[] for _ in errors]
    asked = list(_cells(view))
    sizes = _own_sizes(known, axes, [inside for *_, inside in asked])
    for (covariate, low, high, inside), own in zip(asked, sizes, strict=True):
        count, unit = int(np.sum(inside)), covariate.unit
        for cells, numerator, values in zip(found, numerators, plain, strict=True):
            for k, axis in enumerate(AXES):
                if own[k] > 0.0:
                    score = float(np.sum(numerator[inside, k]) / np.sqrt(own[k]))
                    mean = float(np.mean(values[inside, k]))
                    cells.append(Regime(covariate.name, low, high, unit, axis, score, mean, count))
    return tuple(tuple(cells) for cells in found)


def _own_sizes(known: Precision, axes: Array, cells: Sequence[NDArray[np.bool_]]) -> Array:
    """x' C^-1 x of every axis in every cell, (cells, axes): some cells' columns side by side."""
    found = []
    count = max(TOGETHER // len(axes), 1)
    for at in range(0, len(cells), count):
        inside = np.stack(cells[at : at + count], axis=1).astype(float)
        columns = (axes[:, :, None, :] * inside[:, None, :, None]).reshape(len(axes), 3, -1)
        own = known.squares(columns)
        found.append(own.reshape(-1, axes.shape[2]))
    return np.concatenate(found) if found else np.zeros((0, axes.shape[2]))


def _cells(view: Scene) -> Iterator[tuple[Covariate, float, float, NDArray[np.bool_]]]:
    """BINS of every covariate, as many rows in each: its ends, and which rows are in it."""
    for covariate in covariates(view):
        edges = np.quantile(covariate.values, np.linspace(0.0, 1.0, BINS + 1))
        for low, high in itertools.pairwise(edges):
            under = covariate.values <= high if high == edges[-1] else covariate.values < high
            inside = (covariate.values >= low) & under
            if np.any(inside):
                yield covariate, float(low), float(high), inside


def strongest(cells: tuple[Regime, ...], count: int = 8) -> tuple[Regime, ...]:
    """The cells that disagree most, one per covariate and axis."""
    best: dict[tuple[str, str], Regime] = {}
    for cell in cells:
        key = cell.covariate, cell.axis
        if abs(cell.score) > STRONG and (key not in best or abs(cell.score) > abs(best[key].score)):
            best[key] = cell
    return tuple(sorted(best.values(), key=lambda c: -abs(c.score))[:count])


def first_disagreement_s(view: Scene, error: Array, known: Precision) -> float | None:
    """Start of the first window of time whose mean error is out of noise; None if none is.

    A change point's place: windows are a fortieth of the log, the limit holds for all of them
    together at 1 %.
    """
    weighted = known.solve(np.nan_to_num(error)[:, :, None])[:, :, 0]
    limit = chi_square_limit(0.01 / WINDOWS, 3)
    edges = np.linspace(0, len(view), WINDOWS + 1).astype(int)
    for a, b in itertools.pairwise(edges):
        if b - a < 2:
            continue
        columns = np.zeros((len(view), 3, 3))
        columns[a:b] = np.eye(3)
        normal = known.information(columns)
        score = weighted[a:b].sum(axis=0)
        if float(score @ inverse_scaled(normal) @ score) > limit:
            return float(view.log.time_s[a])
    return None
