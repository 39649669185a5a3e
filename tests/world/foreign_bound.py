"""Cramer-Rao bound of hidden parameters in noise that is not the model's, by what made the log.

The covariance is that of the maker: white noise of every row, Gauss-Markov processes through a
Kalman filter over the channels that they are on, and slow noise as the cosines that it is drawn
from.  Heavy noise goes by its variance, steps by their correlation exp(-dt / usual stay).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.world.bound import Key, _reading_slope, all_faults, row_covariance, slopes
from tests.world.foreign import (
    AS_MEASURED,
    ATTITUDE,
    POSITION,
    RANGING,
    WAVES,
    WHITE,
    Part,
)
from tests.world.hidden import Hidden
from tests.world.noise import Noise, white_sigmas
from tests.world.scenarios import Scenario
from tests.world.sensing import read_all
from tests.world.trajectory import Array

STAY = 0.03  # of the log: usual length of a step
HEAVY = 0.98 + 0.02 * 36.0  # variance of the kind "heavy"
COARSE = 1.0 / np.sqrt(3.0)  # of sigma: rounding to two of them
KINDS: dict[str, tuple[Part, ...]] = {
    "slow position": (Part(POSITION, 0.7, "slow"),),
    "slow attitude": (Part(ATTITUDE, 0.7, "slow"),),
    "slow ranging": (Part(RANGING, 0.7, "slow"),),
    "multipath steps": (Part(POSITION, 0.7, "steps"),),
    "heavy": (Part((*POSITION, *RANGING, *ATTITUDE), 0.7 * float(np.sqrt(HEAVY)), "heavy"),),
    "coarse": (Part((*POSITION, *RANGING), COARSE, "heavy"),),
    "by range": (Part(RANGING, 0.6, "by range"),),
    "by speed": (Part(POSITION, 0.7, "by speed"),),
    "rough velocity": (),
    "no motion columns": (),
    **AS_MEASURED,
}


@dataclass(frozen=True)
class _Parts:
    """White (n, 3, 3), Gauss-Markov loadings (n, 3, m) with their times, slow columns (n, 3, q)."""

    white: Array
    loading: Array
    time_s: Array
    slow: Array


def information_in(
    run: Scenario, effects: tuple[Hidden, ...], kind: str, keys: Sequence[Key]
) -> Array:
    """Fisher information (p, p) of the parameters on a log with noise of a kind."""
    slope = slopes(run, effects, keys)
    parts = _parts(run, effects, kind)
    both = np.concatenate([slope, parts.slow], axis=2)
    white = _whitened(run.stamps_s, parts, both).reshape(-1, both.shape[2])
    own, slow = white[:, : slope.shape[2]], white[:, slope.shape[2] :]
    cross = slow.T @ own
    inner = np.eye(slow.shape[1]) + slow.T @ slow
    return np.asarray(own.T @ own - cross.T @ np.linalg.solve(inner, cross))


def _parts(run: Scenario, effects: tuple[Hidden, ...], kind: str) -> _Parts:
    faults = all_faults(run, effects)
    noise = Noise() if kind == "white" else WHITE
    white = row_covariance(run, faults, noise)
    loading: list[Array] = []
    times: list[float] = []
    slow: list[Array] = []
    time_s = run.stamps_s - run.stamps_s[0]
    for part in KINDS.get(kind, ()):
        for name in part.names:
            own = part.share * _channel(run, effects, name)
            if part.shape in ("gm", "steps"):
                loading.append(own)
                times.append(part.time_s or STAY * float(time_s[-1]))
            elif part.shape == "slow":
                slow.append(own[:, :, None] * _cosines(time_s.size)[:, None, :])
            else:
                own = own * _growth(run, part.shape)[:, None]
                white = white + own[:, :, None] * own[:, None, :]
    none = np.zeros((time_s.size, 3, 0))
    stacked = np.stack(loading, axis=2) if loading else none
    return _Parts(white, stacked, np.array(times), np.concatenate([none, *slow], axis=2))


def _channel(run: Scenario, effects: tuple[Hidden, ...], name: str) -> Array:
    """What one sigma of a column does to the estimate (n, 3) [m]."""
    sigma = white_sigmas(run.carriers[0], Noise(), run.kind == "position")
    readings = read_all(run, all_faults(run, effects))
    if name in POSITION:
        axis, size = POSITION.index(name), sigma["position"]
        assert size is not None
        return np.asarray(np.broadcast_to(size[axis] * np.eye(3)[axis], (run.stamps_s.size, 3)))
    order = ATTITUDE[::-1] if name in ATTITUDE else RANGING  # the world turns by yaw, pitch, roll
    size = sigma["attitude" if name in ATTITUDE else "ranging"]
    if size is None:
        return np.zeros((run.stamps_s.size, 3))
    slope = _reading_slope(run, readings, 0, "euler_rad" if name in ATTITUDE else "polar")
    axis = order.index(name)
    return np.asarray(slope[:, :, axis] * size[axis])


def _growth(run: Scenario, shape: str) -> Array:
    if shape == "by range":
        polar = read_all(run, all_faults(run, ()))[0].polar
        if polar is None:
            return np.zeros(run.stamps_s.size)
        return np.asarray((polar[:, 0] / np.median(polar[:, 0])) ** 2)
    if shape == "by speed":
        speed = np.linalg.norm(run.carriers[0].path.velocity(run.stamps_s)[:, :2], axis=1)
        return np.asarray(speed / max(float(np.sqrt(np.mean(speed**2))), 1e-9))
    return np.ones(run.stamps_s.size)


def _cosines(rows: int) -> Array:
    """Columns whose squares sum to the covariance of `foreign.slow`."""
    phase, k = np.linspace(0.0, np.pi, rows)[:, None], np.arange(1, WAVES + 1)
    size = np.sqrt(1.0 / (k * np.sum(1.0 / k)))
    return np.concatenate([size * np.cos(phase * k), size * np.sin(phase * k)], axis=1)


def _whitened(stamps_s: Array, parts: _Parts, signal: Array) -> Array:
    """Innovations of a filter that knows the noise, of every column of the signal."""
    if not parts.time_s.size:
        return np.asarray(np.linalg.solve(np.linalg.cholesky(parts.white), signal))
    count = parts.time_s.size
    state, spread = np.zeros((count, signal.shape[2])), np.eye(count)
    result = np.empty_like(signal)
    for row, observed in enumerate(signal):
        if row:
            keep = np.exp(-(stamps_s[row] - stamps_s[row - 1]) / parts.time_s)
            state = keep[:, None] * state
            spread = keep[:, None] * spread * keep + np.diag(1.0 - keep**2)
        look = parts.loading[row]
        cross = spread @ look.T
        lower = np.linalg.cholesky(look @ cross + parts.white[row])
        result[row] = np.linalg.solve(lower, observed - look @ state)
        gain = np.linalg.solve(lower, cross.T)
        state = state + gain.T @ result[row]
        spread = spread - gain.T @ gain
    return result
