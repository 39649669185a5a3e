"""What logs name together against noise that stays the same over each of them.

A sensor whose readings are off by c_l standard deviations of the spec all through log l, c_l normal
and another in every log, adds B S c_l to what the log says, S the deviations and B the parameters
of the effects that are such errors.  Of the information N_l and the score s_l that leaves
    N_l' = N_l - N_l B K B' N_l,   s_l' = s_l - N_l B K B' s_l,   K = (B' N_l B + S^-2)^-1,
and an effect is within that noise where what it gains by N' and s' has a chance of RARE or more.
Source: Harville, JASA 72 (1977), of random effects; Wilks (1938) for the gain's chi-square.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from syncline_design.campaign.naming import freedom
from syncline_design.campaign.pool import Fitted, Index, Pool, Term, fitted
from syncline_design.diagnosis.constant_noise import RARE
from syncline_design.diagnosis.result import WithinNoise
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Sensor, Stage, System


@dataclass(frozen=True, eq=False)
class LastingErrors:
    """Constant errors of a sensor's readings: which parameters they are, and the spec's sigma."""

    stage: str
    sensor: str
    index: Index
    sigma: Array


def within_lasting_noise(
    fit: Fitted, k: int, system: System, *, positions: bool
) -> WithinNoise | None:
    """The sensor whose constant errors most often make what an effect of a fit makes, or more;
    None where those of none do.  positions: logs of positions, where no other sensor has noise.
    """
    every = (_told(fit, k, one) for one in _errors(fit.pool, system, positions=positions))
    often = [one for one in every if one.chance >= RARE]
    return max(often, key=lambda one: one.chance, default=None)


def _told(fit: Fitted, k: int, errors: LastingErrors) -> WithinNoise:
    """How often such errors gain as much as an effect, and how large they are in its place."""
    pool = _freed(fit.pool, errors)
    whole = fitted(pool, fit.scoped)
    rest = fitted(pool, tuple(one for i, one in enumerate(fit.scoped) if i != k))
    chance = math.exp(log_p_of(2.0 * (whole.gain - rest.gain), freedom(whole, k)))
    largest = float(np.max(np.abs(_sizes(fit.pool, rest, errors)), initial=0.0))
    return WithinNoise(errors.stage, errors.sensor, largest, chance)


def _sizes(pool: Pool, rest: Fitted, errors: LastingErrors) -> Array:
    """Errors of every log over the spec's standard deviations, where they stand for an effect."""
    found = []
    for run, normal in enumerate(pool.normal):
        at, of = rest.columns(run)
        left = pool.score[run] - normal[:, of] @ rest.values[at]
        found.append(_gain(normal, errors) @ left[errors.index] / errors.sigma)
    return np.array(found)


def _freed(pool: Pool, errors: LastingErrors) -> Pool:
    """The pool without what constant errors of a sensor may be of it."""
    normals, scores = [], []
    for normal, score in zip(pool.normal, pool.score, strict=True):
        lost = normal[:, errors.index] @ _gain(normal, errors)
        normals.append(normal - lost @ normal[errors.index])
        scores.append(score - lost @ score[errors.index])
    return replace(pool, normal=np.array(normals), score=np.array(scores))


def _gain(normal: Array, errors: LastingErrors) -> Array:
    """K = (B' N B + S^-2)^-1."""
    own = normal[np.ix_(errors.index, errors.index)] * np.outer(errors.sigma, errors.sigma)
    inverse = np.linalg.inv(own + np.eye(errors.sigma.size))
    return np.asarray(inverse * np.outer(errors.sigma, errors.sigma))


def _errors(pool: Pool, system: System, *, positions: bool) -> Iterator[LastingErrors]:
    """Of every sensor with noise."""
    found: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for term in pool.terms:
        for place, (role, axis) in zip(term.index, term.effect.constant, strict=False):
            if positions and role != "position":
                continue
            stage, sensor = _sensor(system, term, role)
            if sensor is not None and sensor.sigma[axis] > 0.0:
                found.setdefault((stage, role), []).append((int(place), sensor.sigma[axis]))
    for (name, known), own in found.items():
        places, sigmas = zip(*own, strict=True)
        yield LastingErrors(name, known, np.array(places), np.array(sigmas))


def _sensor(system: System, term: Term, role: str) -> tuple[str, Sensor | None]:
    """The sensor of a term's own stage, else of the first stage that has one."""

    def of(stage: Stage) -> Sensor | None:
        known = {"position": stage.position, "attitude": stage.attitude, "ranging": stage.ranging}
        return known[role]

    for stage in (system.stages[term.stage], *system.stages):
        if (sensor := of(stage)) is not None:
            return stage.name, sensor
    return "", None
