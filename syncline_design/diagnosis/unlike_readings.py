"""Readings of one sensor that scatter unlike each other: a height beside places on the level.

One factor for all of a sensor's readings is too small for the loud one and too large for the
others, and the mixture of both passes for heavy tails.  So every reading has its own variance in
    E[z_j^2] = sum_c f_c (b_j . l_c)^2 + known,
z the whitened error that slow noise leaves, l_c what one standard deviation of a reading does
(weighted least squares, squares far out cut, spread by delete-a-block jackknife).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data, Model, data_of
from syncline_design.diagnosis.motion_scatter import (
    BLOCKS,
    TOLD_APART,
    in_blocks,
    lasting,
    own_share,
    variances_of,
)
from syncline_design.diagnosis.noise import SensorKey, Structure, White, white_covariance
from syncline_design.effects import registry
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass

READINGS = {
    "position": ("north", "east", "down"),
    "attitude": ("roll", "pitch", "yaw"),
    "ranging": ("range", "azimuth", "elevation"),
}
LOUD = 1.3  # standard deviations of the spec's that the loudest reading has
QUIET = 0.7  # of the loudest, at most, that another one has
QUIETEST = 0.2  # of the spec's: what seems quieter is taken for that
STEADY = 0.5  # correlation of one row with the next above which it is no white noise
CHANCE = 1e-4
LEAST_ROWS = 200  # of a log that is searched


@dataclass(frozen=True, slots=True)
class Unlike:
    """growth: of each reading, deviations over the quietest; spread: of the largest, relative.

    gain: nat that this saves beside the spec's noise.
    """

    sensor: SensorKey
    growth: tuple[float, ...]
    spread: float
    gain: float

    @property
    def of_each(self) -> dict[str, float]:
        """The growth of every reading by its name."""
        return dict(zip(READINGS[self.sensor[1]], self.growth, strict=True))


def factor_effect() -> Effect:
    """The effect of the dictionary that noise of another size is."""
    return next(one for one in registry().values() if one.opens == "factor")


def with_unlike(data: Data, found: tuple[Unlike, ...]) -> Data:
    """The data with white noise that differs among the readings of some sensors."""
    known = {one.sensor: one.growth for one in found}
    slopes = _slopes(data)
    white = tuple(
        replace(part, unlike=known[part.sensor], slopes=slopes[part.sensor])
        if part.sensor in known
        else part
        for part in data.structure.white
    )
    structure = replace(data.structure, white=white)
    uneven = data_of(data.view, structure)
    return replace(uneven, axes=data.axes, noisier=data.noisier, explained=data.explained)


def _slopes(data: Data) -> dict[SensorKey, Array]:
    """What one standard deviation of every reading does to the error [m], (n, 3, k) a sensor."""
    stated = dict(channels(data.view))
    return {
        part.sensor: stated[part.sensor] if part.loading is None else part.loading
        for part in data.structure.white
    }


def unlike_readings(data: Data, model: Model) -> tuple[Unlike, ...]:
    """Sensors of which one reading is clearly louder than the spec and than another one."""
    if len(data.view) < LEAST_ROWS:
        return ()
    slopes = _slopes(data)
    count = {sensor: own.shape[2] for sensor, own in slopes.items()}
    value, left, seen = _variances(data, model, list(slopes.values()))
    found, at = [], 0
    for sensor, k in count.items():
        own = slice(at, at + k)
        at += k
        one = _judged(sensor, value[own], left[:, own], seen[own])
        if one is not None and not _is_steady(data, model, slopes[sensor], one):
            found.append(replace(one, gain=_saved(data.structure, data, model, slopes, one)))
    return tuple(one for one in found if one.gain > 0.0)


def _variances(data: Data, model: Model, slopes: list[Array]) -> tuple[Array, Array, Array]:
    """Variances over the spec's, the same without each block, and which of them the log tells."""
    axes = list(data.axes)
    white = white_covariance(data.structure, model.level)[:, axes][:, :, axes]
    lower = np.linalg.cholesky(white)
    error = np.linalg.solve(lower, (model.error - lasting(data, model))[:, axes, None])[:, :, 0]
    columns = np.concatenate([np.linalg.solve(lower, s[:, axes]) ** 2 for s in slopes], axis=2)
    known: Array = np.zeros(error.shape)
    if data.structure.stamped is not None:
        known = np.sum(np.linalg.solve(lower, data.structure.stamped[:, axes]) ** 2, axis=2)
    columns, squares = columns.reshape(known.size, -1), (error**2).ravel()
    normal, right, parts = in_blocks(columns, squares, known.ravel())
    left = np.array([variances_of(normal - n, right - r) for n, r in parts])
    order = [[i for i in range(len(normal)) if i != k] + [k] for k in range(len(normal))]
    seen = np.array([own_share(normal[np.ix_(o, o)]) > TOLD_APART for o in order])
    return variances_of(normal, right), left, seen


def _judged(sensor: SensorKey, value: Array, left: Array, seen: Array) -> Unlike | None:
    """Whether one reading is louder than the spec, and than another one, beyond chance."""
    from scipy.stats import t

    told = np.flatnonzero(seen)
    if told.size < 2:
        return None
    loud = told[int(np.argmax(value[told]))]
    quiet = told[int(np.argmin(value[told]))]
    sure = float(t.isf(CHANCE, BLOCKS - 1))

    def clear(margin: Array, whole: float) -> bool:
        spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((margin - margin.mean()) ** 2))
        return bool(whole > sure * spread)

    if not value[loud] > LOUD**2 or not value[quiet] < QUIET**2 * value[loud]:
        return None
    if not clear(left[:, loud], float(value[loud] - 1.0)):
        return None
    apart = QUIET**2 * left[:, loud] - left[:, quiet]
    if not clear(apart, float(QUIET**2 * value[loud] - value[quiet])):
        return None
    times = np.where(seen, np.sqrt(np.maximum(value, QUIETEST**2)), 1.0)
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((left[:, loud] - left[:, loud].mean()) ** 2))
    least = min(1.0, float(np.min(times)))
    growth = tuple(float(own) / least for own in times)
    return Unlike(sensor, growth, 0.5 * float(spread / value[loud]), 0.0)


def _is_steady(data: Data, model: Model, slopes: Array, one: Unlike) -> bool:
    """Whether what the loud reading leaves goes on from row to row: it is no white noise then."""
    k = int(np.argmax(one.growth))
    axes = list(data.axes)
    left = (model.error - lasting(data, model))[:, axes]
    along = slopes[:, axes, k]
    size = np.sum(along**2, axis=1)
    part = np.sum(along * left, axis=1) / np.maximum(size, np.finfo(float).tiny)
    return bool(np.sum(part[1:] * part[:-1]) > STEADY * np.sum(part**2))


def _saved(
    structure: Structure, data: Data, model: Model, slopes: dict[SensorKey, Array], one: Unlike
) -> float:
    """nat that a size for each reading saves over the best one size for all of them."""
    axes = list(data.axes)
    left = (model.error - lasting(data, model))[:, axes]

    def cost(part: White, times: float) -> float:
        white = tuple(part if w.sensor == one.sensor else w for w in structure.white)
        factor = tuple(
            times if w.sensor == one.sensor else f
            for w, f in zip(structure.white, model.level.factor, strict=True)
        )
        level = replace(model.level, factor=factor, episodes=True)
        total = white_covariance(replace(structure, white=white), level)[:, axes][:, :, axes]
        lower = np.linalg.cholesky(total)
        scaled = np.linalg.solve(lower, left[:, :, None])[:, :, 0]
        logs = np.log(np.einsum("nii->ni", lower))
        return float(0.5 * np.sum(scaled**2) + np.sum(logs))

    plain = next(w for w in structure.white if w.sensor == one.sensor)
    own = replace(plain, unlike=one.growth, slopes=slopes[one.sensor])
    sizes = np.geomspace(QUIETEST, 2.0 * max(one.growth), 40)
    return min(cost(plain, s) for s in sizes) - min(cost(own, s) for s in sizes[sizes <= 3.0])
