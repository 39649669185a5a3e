"""Delays that vary from row to row, which scatter readings as noise does, but along the motion.

A delay tau(t) that sways about its mean moves a reading by c tau, c what a second of it does to the
row (velocity, sweep): beside the noise of every reading (`noise_split`) the row's covariance has
    var(tau) c c'.
Noise of a sensor scatters in all of its readings, and as much where the vehicle is slow; such a
delay in one direction, and by speed.  Where the variance of the delay is shown, and the sensor's
noise beside it may keep the spec's figure, what scatters is no noise of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise_split import LEAST_ROWS, components, estimated
from syncline_design.diagnosis.unlike_readings import Unlike
from syncline_design.effects import plain_delay

WITHIN: Final = 1.0  # of the spec's variance, that the noise beside it may have


def swaying(
    data: Data, model: Model, known: Sequence[Signature], unlike: Sequence[Unlike] = ()
) -> Mapping[str, float]:
    """RMS [s] of the delays that vary, by `stage/sensor`; those of which noise is none beside."""
    axes = list(data.axes)
    if len(data.view) < LEAST_ROWS or not axes:
        return {}
    error = np.nan_to_num(model.error)[:, axes]
    keys, parts, fixed = components(data, unlike)
    found: dict[str, float] = {}
    for s in known:
        name, sensor, stage = s.candidate.label
        key = (data.view.system.stages[stage].name, str(sensor))
        if name != plain_delay().name or not s.plain or key not in keys:
            continue
        moved = np.nan_to_num(s.columns)[:, axes, :]
        square = moved @ np.swapaxes(moved, 1, 2)
        usual = float(np.mean(np.einsum("nii->n", parts.sum(0))))
        scale = usual / max(float(np.mean(np.einsum("nii->n", square))), 1e-300)
        values, reach = estimated(error, np.concatenate([parts, scale * square[None]]), fixed)
        own = [k for k, each in enumerate(keys) if each == key]
        kept = all(values[k] - reach[k] <= WITHIN for k in own)
        if kept and values[-1] > reach[-1]:
            found["/".join(key)] = math.sqrt(float(values[-1]) * scale)
    return found
