"""Readings of one sensor that scatter unlike each other: a height beside places on the level.

One factor for all of a sensor's readings is too small for the loud one and too large for the
others, and the mixture of both passes for heavy tails, or for another sensor's noise: bearings that
are too noisy beside ranges as specified look like an attitude that is.  Which they are is told by
the likelihood (`loud_readings`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data, Model, data_of
from syncline_design.diagnosis.loud_readings import LoudSensor, loud_readings
from syncline_design.diagnosis.motion_scatter import lasting
from syncline_design.diagnosis.noise import SensorKey, Structure
from syncline_design.diagnosis.steady import goes_on
from syncline_design.effects import registry
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass

READINGS = {
    "position": ("north", "east", "down"),
    "attitude": ("roll", "pitch", "yaw"),
    "ranging": ("range", "azimuth", "elevation"),
}
LEAST_ROWS = 200  # of a log that is searched


@dataclass(frozen=True, slots=True)
class Unlike:
    """growth: of each reading, deviations over the quietest; spread: of the largest, relative.

    gain: nat that this saves beside one factor for all readings of any sensor.
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
    slopes = grown_slopes(data)
    white = tuple(
        replace(part, unlike=known[part.sensor], slopes=slopes[part.sensor])
        if part.sensor in known
        else part
        for part in data.structure.white
    )
    structure = replace(data.structure, white=white)
    uneven = data_of(data.view, structure)
    return replace(uneven, axes=data.axes, noisier=data.noisier, explained=data.explained)


def slopes_of_readings(data: Data) -> dict[SensorKey, Array]:
    """What one standard deviation of every reading does to the error [m], (n, 3, k) a sensor."""
    stated = dict(channels(data.view))
    return {
        part.sensor: stated[part.sensor] if part.loading is None else part.loading
        for part in data.structure.white
    }


def grown_slopes(data: Data) -> dict[SensorKey, Array]:
    """The same of readings as the data have them, of which some rows may be far out."""
    usual = slopes_of_readings(data)
    return {
        part.sensor: usual[part.sensor] if part.slopes is None else part.slopes
        for part in data.structure.white
    }


def known_scatter(structure: Structure) -> Array:
    """Covariance of every row (n, 3, 3) [m2] of what no sensor's noise makes."""
    if structure.stamped is None:
        return structure.fixed
    return structure.fixed + structure.stamped @ np.swapaxes(structure.stamped, 1, 2)


def unlike_readings(data: Data, model: Model) -> tuple[Unlike, ...]:
    """Sensors of which some readings are clearly louder than the spec and than the others."""
    if len(data.view) < LEAST_ROWS:
        return ()
    axes, slopes = list(data.axes), grown_slopes(data)
    left = (model.error - lasting(data, model))[:, axes]
    fixed = known_scatter(data.structure)
    on_axes = {sensor: own[:, axes] for sensor, own in slopes.items()}
    motions = [one.direction[:, axes] for one in data.structure.directed]
    loud = loud_readings(left, on_axes, fixed[:, axes][:, :, axes], motions)
    if not loud or goes_on(data.structure.time_s, left, on_axes.values()):
        return ()
    return tuple(_unlike(one) for one in loud)


def _unlike(one: LoudSensor) -> Unlike:
    least = min(1.0, *one.times)
    return Unlike(one.sensor, tuple(own / least for own in one.times), one.spread, one.gain)
