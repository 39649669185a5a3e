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
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import white_covariance
from syncline_design.diagnosis.noise_split import LEAST_ROWS, components, estimated
from syncline_design.diagnosis.unlike_readings import Unlike
from syncline_design.effects import plain_delay
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit
from syncline_design.model.normal import NORMAL_95

TELLS: Final = 4.0  # variance of the delays over that of a row's own, from which it tells its own
WITHIN: Final = 1.0  # of the spec's variance, that the noise beside it may have


@dataclass(frozen=True, slots=True)
class LargestDelay:
    """The largest delay of any row about that of all rows [s], and its 95 % interval."""

    value_s: float
    low_s: float
    high_s: float


def largest_delays(data: Data, model: Model) -> Mapping[str, LargestDelay]:
    """Of sensors whose stamps scatter, by `stage/sensor`.

    With a_i what a second of delay does to row i over its noise, r_i what is left of it, and v the
    variance of the delays, that of the row is v a_i' r_i / (1 + v w_i), w_i = a_i' a_i, but for a
    standard deviation of sqrt(v / (1 + v w_i)); of rows that tell it by themselves (v w_i > 4) it
    is a_i' r_i / w_i, as delays are no normal ones.  The lower end pays for the number of rows.
    Source: Robinson, Statistical Science 6 (1991), best linear unbiased prediction.
    """
    level, structure = model.level, data.structure
    alone = replace(level, size=tuple(0.0 for _ in level.size))
    root = np.linalg.inv(np.linalg.cholesky(white_covariance(structure, alone)))
    left = np.einsum("nij,nj->ni", root, np.nan_to_num(model.error))
    found: dict[str, LargestDelay] = {}
    for one in model.opened:
        if one.candidate.effect.opens != "size" or one.directed < 0:
            continue
        name = data.view.system.stages[one.candidate.stage].name
        own = structure.directed[one.directed].direction[:, :, 0]
        along = np.einsum("nij,nj->ni", root, np.nan_to_num(own))
        variance = level.size[one.directed] ** 2
        found[f"{name}/{one.candidate.sensor}"] = _largest(along, left, variance)
    return found


def _largest(along: Array, left: Array, variance: float) -> LargestDelay:
    weight = np.sum(along**2, axis=1)
    tells = variance * weight > TELLS
    certain = np.where(
        tells, 1.0 / np.maximum(weight, 1e-300), variance / (1.0 + variance * weight)
    )
    size = np.abs(certain * np.sum(along * left, axis=1))
    reach = np.sqrt(certain)
    of_all = math.sqrt(chi_square_limit(0.05 / len(size), 1))
    low = max(float(np.max(size - of_all * reach)), 0.0)
    return LargestDelay(float(np.max(size)), low, float(np.max(size + NORMAL_95 * reach)))


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
