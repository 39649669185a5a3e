"""Readings that have noise of a size of their own, and what they do to the rows of a log.

Ranges and bearings are two devices in one sensor, and so are readings that were found unlike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.noise import SensorKey, White
from syncline_design.diagnosis.unlike_readings import Unlike, slopes_of_readings
from syncline_design.effects.record import Array
from syncline_design.logs.log import Rows
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class NoisePart:
    """Readings of one sensor with one size of noise, and what they scatter by the spec.

    covariance (n, 3, 3) [m2]; loading (n, 3, k) [m] of a sensor that reads once a stamp.
    """

    sensor: SensorKey
    readings: tuple[int, ...]
    covariance: Array
    loading: Array | None = None

    def rows(self, index: Rows) -> NoisePart:
        """The same on some of the rows."""
        loading = None if self.loading is None else self.loading[index]
        return replace(self, covariance=self.covariance[index], loading=loading)


def noise_parts(data: Data, unlike: Sequence[Unlike] = ()) -> list[NoisePart]:
    """Of every sensor that the log's error is made of."""
    grown = {one.sensor: one.growth for one in unlike}
    slopes = slopes_of_readings(data)
    found: list[NoisePart] = []
    for white in data.structure.white:
        groups = _groups(white, grown.get(white.sensor, (1.0,) * 3))
        if len(groups) == 1:
            found.append(NoisePart(white.sensor, groups[0], white.covariance, white.loading))
            continue
        own = [slopes[white.sensor][:, :, list(group)] for group in groups]
        traces = np.sum([np.einsum("nij,nij->n", each, each) for each in own], axis=0)
        scale = np.einsum("nii->n", white.covariance) / np.maximum(traces, 1e-300)
        for group, each in zip(groups, own, strict=True):
            loading = np.sqrt(scale)[:, None, None] * each
            once = None if white.loading is None else loading
            covariance = loading @ np.swapaxes(loading, 1, 2)
            found.append(NoisePart(white.sensor, group, covariance, once))
    return found


def _groups(white: White, growth: tuple[float, ...]) -> list[tuple[int, ...]]:
    """Readings that have one factor: ranges and bearings apart, and what was found unlike."""
    of: dict[tuple[bool, float], list[int]] = {}
    for k, own in enumerate(growth):
        of.setdefault((white.loading is None and k == 0, own), []).append(k)
    return [tuple(group) for group in of.values()]
