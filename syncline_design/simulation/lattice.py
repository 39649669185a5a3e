"""Points that fill the unit cube evenly: sums over them stand for integrals."""

from __future__ import annotations

from functools import lru_cache
from statistics import NormalDist

import numpy as np

from syncline_design.effects.record import Array

POINTS = 4093
MANY_POINTS = 16381  # where many timestamps, and not noise, make the error
_GENERATORS = {POINTS: 666, MANY_POINTS: 7723}


@lru_cache(maxsize=16)
def lattice(dimensions: int, count: int = POINTS) -> Array:
    """x_j = 1 - |2 {k a^j / N + 1 / 2N} - 1|, k = 0 .. N-1: (dimensions, N), inside (0, 1).

    Korobov's lattice of a prime N, folded by the tent map, with which sums of smooth functions
    converge nearly as N^-2 (Hickernell, MCQMC 2000).  The generators a are the best of some
    hundred drawn, for N = 4093 in 16 and N = 16381 in 12 dimensions, by the P2 criterion.
    """
    k = np.arange(count, dtype=np.int64)
    power, rows = 1, []
    for _ in range(dimensions):
        rows.append((k * power % count + 0.5) / count)
        power = power * _GENERATORS.get(count, _GENERATORS[POINTS]) % count
    folded = 1.0 - np.abs(2.0 * np.array(rows).reshape(dimensions, count) - 1.0)
    return np.clip(folded, 0.25 / count, 1.0 - 0.25 / count)


@lru_cache(maxsize=16)
def sphere_lattice(skipped: int, axes: int, count: int = POINTS) -> Array:
    """Unit vectors (axes, N), axes 1, 2 or 3, of the lattice's dimensions after the first few.

    On the line both signs in turn; on the circle the angle, on the sphere height and angle are
    uniform (Archimedes).
    """
    share = lattice(skipped + 2, count)[skipped:]
    if axes == 1:
        return np.where(share[:1] < 0.5, -1.0, 1.0)
    angle = 2.0 * np.pi * share[0]
    circle = np.stack([np.cos(angle), np.sin(angle)])
    if axes == 2:
        return circle
    height = 2.0 * share[1] - 1.0
    return np.concatenate([circle * np.sqrt(1.0 - height * height), height[None]])


@lru_cache(maxsize=64)
def normal_row(row: int, count: int = POINTS) -> Array:
    """Standard normal numbers (N,) of one of the lattice's dimensions."""
    return normal_quantile(lattice(row + 1, count)[row])


def normal_quantile(share: Array) -> Array:
    """Standard normal quantiles at shares in (0, 1), any shape (Wichura, AS 241, 1988)."""
    invert = NormalDist().inv_cdf
    return np.array([invert(float(one)) for one in share.ravel()]).reshape(share.shape)
