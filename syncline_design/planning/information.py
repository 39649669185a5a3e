"""What a log would tell: information matrices of all effects, with the noise of the diagnosis.

For columns X (n, 3, p) of the error by the parameters and the covariance C of the error series
(white and Gauss-Markov, `diagnosis.covariance`) the Fisher information is X' C^-1 X; with prior
standard deviations s the posterior covariance is (X' C^-1 X + diag(s^-2))^-1.
Source: Kay, Estimation Theory (1993), ch. 3 and 11.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis import candidates as effects_of
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    Structure,
    as_specified,
    marginal_variance,
    precision,
)
from syncline_design.diagnosis.result import Noise
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import bearing, euler_to_rotation, rotate
from syncline_design.effects.record import Array, Parameter, StageRows
from syncline_design.machine.quick_dataclass import dataclass

LOST: Final = 1e-9  # of a parameter's scaled information: below, the others hold it all
STEP_AT: Final = 0.5  # of the drive: where a step is taken to happen
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Unknown:
    """One parameter of one effect: what a plan counts."""

    candidate: effects_of.Candidate
    parameter: Parameter

    @property
    def prior(self) -> float:
        """Its standard deviation before the drive: the middle of its plausible sizes."""
        return math.sqrt(self.parameter.low * self.parameter.high)


def unknowns(view: Scene) -> tuple[Unknown, ...]:
    """Every parameter that moves the mean error and that this drive can show."""
    return tuple(_parameters(effects_of.candidates(view)))


def hardly_moved(view: Scene) -> tuple[Unknown, ...]:
    """Those that this system can have besides, though what they follow hardly varies here: the
    bend of a mount on a vehicle that keeps level."""
    return tuple(_parameters(effects_of.hidden_by_noise(view)))


def _parameters(found: Sequence[effects_of.Candidate]) -> Iterator[Unknown]:
    for one in found:
        if one.effect.sensitivity is not None:
            yield from (Unknown(one, p) for p in one.effect.slopes())


def late(time_s: Array) -> Array:
    """Which rows of a drive come after a step that happens in it, (n,)."""
    return np.asarray(time_s - time_s[0] >= STEP_AT * (time_s[-1] - time_s[0]))


def columns(view: Scene, wanted: Sequence[Unknown], after: Array | None = None) -> Array:
    """Slopes (n, 3, p) of the error by the parameters, at zero.

    after: rows that a step acts on; None: those of the later half.
    """
    found: dict[str, Array] = {}
    acts = late(view.log.time_s) if after is None else after
    parts = []
    for one in wanted:
        c = one.candidate
        if c.key not in found:
            at = {p.name: 0.0 for p in c.effect.parameters if p.located}  # from the first row on
            slopes = np.nan_to_num(effects_of.signature(view, c, at))
            found[c.key] = slopes * acts[:, None, None] if at else slopes
        names = [p.name for p in c.effect.slopes()]
        parts.append(found[c.key][:, :, names.index(one.parameter.name)])
    return np.stack(parts, axis=-1) if parts else np.zeros((len(view), 3, 0))


def drift_columns(
    view: Scene, wanted: Sequence[Unknown], first: Array, after: Array | None = None
) -> Array:
    """How the columns grow with every second that a log's start lies further back."""
    rows = tuple(replace(r, start_s=float(r.time_s[0]) - 1.0) for r in view.rows)
    later = columns(replace(view, rows=rows), wanted, after)
    return later - first


def fisher(structure: Structure, level: NoiseLevel, slopes: Array) -> Array:
    """X' C^-1 X, (p, p)."""
    found = precision(structure, level).information(slopes)
    return 0.5 * (found + found.T)


def expected_noise(view: Scene, measured: Noise | None = None) -> tuple[Structure, NoiseLevel]:
    """The noise that a log of this drive would have.

    As the spec states it: white noise of the sensors' sigmas, and the Gauss-Markov noise that its
    `effects` list; or as a diagnosis fitted it to a log of the same system.
    """
    structure = structure_of(view)
    level = as_specified(structure)
    if measured is not None:
        return structure, _as_measured(structure, level, measured)
    slow, times = list(level.slow), list(level.time_constant_s)
    for one in view.known:
        if not one.effect.wanders:
            continue
        sensor = view.system.stages[one.stage].name, one.sensor
        std, time_s = (float(one.values[p.name]) for p in one.effect.parameters)
        for k, part in enumerate(structure.slow):
            if part.sensor == sensor:
                own = _share(view, one.stage, std)
                slow[k] = tuple(max(a, b) for a, b in zip(slow[k], own, strict=True))
                times[k] = tuple(time_s for _ in times[k])
    return structure, replace(level, slow=tuple(slow), time_constant_s=tuple(times))


def _share(view: Scene, stage: int, std_m: float) -> tuple[float, ...]:
    """A wandering position's variance over that of white and wandering noise together."""
    sensor = view.system.stages[stage].position
    assert sensor is not None
    return tuple(std_m**2 / (std_m**2 + sigma**2) for sigma in sensor.sigma)


def _as_measured(structure: Structure, level: NoiseLevel, measured: Noise) -> NoiseLevel:
    factors: Mapping[str, float] = measured.white_factor
    factor = tuple(
        factors.get("/".join(w.sensor), f)
        for w, f in zip(structure.white, level.factor, strict=True)
    )
    slow, times = list(level.slow), list(level.time_constant_s)
    for k, part in enumerate(structure.slow):
        found = measured.slow.get("/".join(part.sensor))
        if found is not None and len(found.variance_over_spec) == part.columns:
            slow[k] = tuple(found.variance_over_spec)
            times[k] = tuple(found.time_constant_s[0] for _ in times[k])
    return replace(level, factor=factor, slow=tuple(slow), time_constant_s=tuple(times))


def rms_per_unit(slopes: Array) -> Array:
    """RMS of the error vector [m] that one unit of each parameter makes, (p,)."""
    found: Array = np.sqrt(np.mean(np.sum(slopes**2, axis=1), axis=0))
    return found


def noise_rms_m(structure: Structure, level: NoiseLevel, visible: Array) -> float:
    """RMS [m] that the noise makes, on the components that are known, (n, 3)."""
    variance = marginal_variance(structure, level) * visible
    return float(np.sqrt(np.mean(np.sum(variance, axis=1))))


def sigmas(information: Array, index: Sequence[int], prior: Array | None = None) -> Array:
    """Standard uncertainty of some parameters with one another free; infinite where not seen.

    information: with what the noise shifts (`with_shift`) as its last row and column; a shift of
    the estimates counts like the scatter, sigma^2 + shift^2.
    """
    own = covariance_of(block(information, index, index), prior)
    return shifted(*own, information[np.asarray(index), -1])


def shifted(covariance: Array, lost: Flags, shift: Array) -> Array:
    """Standard uncertainty by a covariance (p, p) with what the noise shifts (p,); infinite of what
    is lost."""
    moved = covariance @ shift
    size = np.sqrt(np.maximum(np.diagonal(covariance), 0.0) + moved**2)
    return np.where(lost, np.inf, size)


def noise_shift(view: Scene) -> Array:
    """By how much noise of angles moves the error on average, to second order [m], (n, 3, 1).

    Of the vector R(roll, pitch, yaw) (l + r n(azimuth, elevation)) with independent angles of
    standard deviations s: sum over them of s^2 / 2 times the second derivative, here by second
    differences.  A sounder whose beams scatter by 0.5 deg measures 40 m short by 3 mm.
    """
    total = np.zeros((len(view), 3))
    for stage, rows, logged in zip(view.system.stages, view.rows, view.log.stages, strict=True):
        if logged.range_m is None or stage.attitude is None or stage.ranging is None:
            continue
        angles = np.column_stack([rows.euler_rad, rows.azimuth_rad, rows.elevation_rad])
        spread = (*stage.attitude.sigma, *stage.ranging.sigma[1:])

        def reached(at: Array, rows: StageRows = rows) -> Array:
            vector = rows.range_m[:, None] * bearing(at[:, 3], at[:, 4])
            return rotate(euler_to_rotation(at[:, :3]), rows.ranging_m - rows.antenna_m + vector)

        here = reached(angles)
        for k, sigma in enumerate(spread):
            step = sigma * np.eye(5)[k]
            total += 0.5 * (reached(angles + step) + reached(angles - step) - 2.0 * here)
    return total[:, :, None]


def with_shift(view: Scene, wanted: Sequence[Unknown], after: Array | None = None) -> Array:
    """The columns of the unknowns, and what the noise shifts as one more, (n, 3, p + 1)."""
    return np.concatenate([columns(view, wanted, after), noise_shift(view)], axis=2)


def covariance_of(information: Array, prior: Array | None = None) -> tuple[Array, Flags]:
    """Covariance (p, p), and which parameters it holds no figure for (p,)."""
    whole = information if prior is None else information + np.diag(prior**-2.0)
    size = np.diagonal(whole)
    unseen = size <= 0.0
    scale = np.where(unseen, 1.0, np.sqrt(np.where(unseen, 1.0, size)))
    values, vectors = np.linalg.eigh(whole / scale[:, None] / scale)
    blind = values < LOST
    inverse = np.where(blind, 0.0, 1.0 / np.where(blind, 1.0, values))
    covariance = (vectors * inverse) @ vectors.T / scale[:, None] / scale
    lost = unseen
    if blind.any():
        lost = unseen | (np.sum(vectors[:, blind] ** 2, axis=1) > 1e-6)
    return covariance, lost


def schur(information: Array, own: Sequence[int], rival: Sequence[int]) -> Array:
    """Information on one effect's parameters with a rival's free."""
    other = block(information, rival, rival)
    scale = np.sqrt(np.maximum(np.diag(other), 1e-300))
    inverse = np.linalg.pinv(other / scale[:, None] / scale, rcond=1e-9) / scale[:, None] / scale
    cross = block(information, own, rival)
    left: Array = block(information, own, own) - cross @ inverse @ cross.T
    return left


def block(information: Array, rows: Sequence[int], columns: Sequence[int]) -> Array:
    """Some rows of some columns."""
    return np.asarray(information[np.asarray(rows)[:, None], np.asarray(columns)])


def noncentrality(
    information: Array, own: Sequence[int], rival: Sequence[int], size: Array
) -> float:
    """Least 2 x log likelihood ratio, on average, by which the true effect of these sizes beats its
    rival refitted: over all directions of the effect's parameters."""
    left = schur(information, own, rival) * size[:, None] * size
    return max(float(np.linalg.eigvalsh(0.5 * (left + left.T))[0]), 0.0)


def canonical_correlation(information: Array, own: Sequence[int], rival: Sequence[int]) -> float:
    """Largest canonical correlation of two effects' estimates, the rest known.

    The same of the information's blocks: Q_A^-1/2 Q_AB Q_B^-1/2 and its counterpart have the same
    singular values (partitioned inverse).
    """
    parts = []
    for index in (own, rival):
        alone = block(information, index, index)
        scale = np.sqrt(np.maximum(np.diagonal(alone), 1e-300))
        values, vectors = np.linalg.eigh(alone / scale[:, None] / scale)
        root = np.where(values > LOST, 1.0 / np.sqrt(np.maximum(values, LOST)), 0.0)
        parts.append((vectors * root).T / scale)
    cross = parts[0] @ block(information, own, rival) @ parts[1].T
    return min(float(np.linalg.norm(cross, 2)), 1.0) if cross.size else 0.0
