"""What the best possible reader of a log could name: the yardstick beside the study's rates.

It knows the noise, the linear signature of every effect on this very log (the world's own finite
differences) and that exactly one is present; it names the effect whose likelihood ratio is least
likely by chance, if that chance is below 5 % shared among the effects.  No reader with the same
false alarms names much more often.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from benchmarks.study_cases import GEOREFERENCE, POSITION
from tests.world import CHAIN, DISCRETE, STOCHASTIC, Hidden, hidden
from tests.world.bound import all_faults, fitted_keys, row_covariance, slopes, whitened
from tests.world.noise import wanders
from tests.world.trajectory import Array
from tests.world.worldlog import WorldLog

SAME_CLASS = 0.99  # share of a signature's length that another effect reproduces
DRAWS = 2000
INVISIBLE = 3.5  # standard deviations


def candidates(log: WorldLog) -> list[Hidden]:
    """Every effect with a slope that may sit on this kind of log, once per stage it fits."""
    if log.run.kind == "position":
        stage = log.run.carriers[0].name
        datum: dict[str, float | str] = {"north_m": 0.0, "east_m": 0.0, "down_m": 0.0}
        return [
            *(hidden(effect, "position", stage, **values) for effect, values in POSITION),
            hidden("timestamp_step", "position", stage, step_s=0.0, time_s=140.0),
            hidden("datum_offset", "target", stage, **datum),
        ]
    listed = []
    for effect, sensor, values, where in GEOREFERENCE:
        if where in ((CHAIN,), ("vessel_figure_eights", CHAIN)) and log.run.name not in where:
            continue
        for carrier in log.run.carriers:
            if sensor == "target" and carrier is not log.run.carriers[-1]:
                continue
            if sensor == "position" and carrier.sensors.position_m is None:
                continue
            if effect == "turnaround_delay" and carrier.sensors.ranging_type != "usbl":
                continue
            listed.append(hidden(effect, sensor, carrier.name, **values))
    return listed


def _signatures(log: WorldLog, effects: list[Hidden]) -> list[Array]:
    """Whitened signature (3 n, p) of every effect."""
    faults = all_faults(log.run, ())
    covariance = row_covariance(log.run, faults, log.noise)
    wander = wanders(log.run.carriers[0], log.noise, faults[0])
    columns, sizes = [], []
    for effect in effects:
        keys = fitted_keys((effect,))
        columns.append(slopes(log.run, (effect,), keys))
        sizes.append(len(keys))
    white = whitened(log.run.stamps_s, covariance, wander, np.concatenate(columns, axis=2))
    return np.split(white.reshape(-1, sum(sizes)), np.cumsum(sizes)[:-1], axis=1)


def told_apart(log: WorldLog, truth: Hidden, other: tuple[str, str, str | None]) -> bool:
    """Whether this log could tell another effect from the true one.

    It could when the other leaves more than INVISIBLE standard deviations of the truth's whitened
    signal unexplained, and does not reproduce SAME_CLASS of its length; both beside what further
    true effects there are, since a reader has to fit those as well.
    """
    first = log.run.carriers[0].name
    matching = [
        e
        for e in candidates(log)
        if (e.effect, e.sensor) == other[:2] and e.stage == (other[2] or e.stage or first)
    ]
    if not matching:
        return True
    company = [e for e in log.truth if e != truth and e.effect not in STOCHASTIC | DISCRETE]
    own, beside, *others = _signatures(log, [truth, matching[0], *company])
    if others:
        known = np.linalg.qr(np.concatenate(others, axis=1))[0]
        own, beside = (part - known @ (known.T @ part) for part in (own, beside))
    theta = np.array([truth.number(name) for _, name in fitted_keys((truth,))])
    signal = own @ theta
    directions, sizes, _ = np.linalg.svd(beside, full_matrices=False)
    basis = directions[:, sizes > 1e-9 * sizes[0]]
    left = float(np.linalg.norm(signal - basis @ (basis.T @ signal)))
    length = float(np.linalg.norm(signal))
    return left > INVISIBLE and left > np.sqrt(1.0 - SAME_CLASS**2) * length


def ideal_naming(log: WorldLog, truth: Hidden, seed: int = 0) -> float:
    """Chance that the best possible reader names the effect or one of its class."""
    listed = candidates(log)
    names = [(e.effect, e.sensor, e.stage) for e in listed]
    place = names.index((truth.effect, truth.sensor, truth.stage))
    parts = _signatures(log, listed)
    whole, triangle = np.linalg.qr(np.concatenate(parts, axis=1))
    sizes = [part.shape[1] for part in parts]
    bases = [
        np.linalg.svd(block, full_matrices=False)[0]
        for block in np.split(triangle, np.cumsum(sizes)[:-1], axis=1)
    ]
    theta = np.array([truth.number(name) for _, name in fitted_keys((truth,))])
    signal = whole.T @ (parts[place] @ theta)
    noise = np.random.default_rng([seed, 61]).standard_normal((DRAWS, signal.size))
    chance = np.column_stack(
        [
            stats.chi2.logsf(np.sum(((signal + noise) @ basis) ** 2, axis=1), size)
            for basis, size in zip(bases, sizes, strict=True)
        ]
    )
    reach = np.linalg.norm(signal)
    same = [np.linalg.norm(signal @ basis) > SAME_CLASS * reach for basis in bases]
    best = np.argmin(chance, axis=1)
    found = chance[np.arange(DRAWS), best] < np.log(0.05 / len(listed))
    return float(np.mean(np.array(same)[best] & found))
