"""How large the slow courses of every channel are, from a log's normal matrix and score.

A course's coefficient is a_k ~ N(0, v / max(k, 1)), v the channel's variance over the spec's.  The
likeliest v comes by expectation and maximisation; what is expected of v counts what the log
cannot show as well.
Source: Laird and Ware, Biometrics 38 (1982); Harville, JASA 72 (1977) for restricted likelihood.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.noise import SensorKey
from syncline_design.diagnosis.positive import inverse as inverse_of
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

Channel = tuple[SensorKey, int]
STEPS = 15  # of expectation and maximisation
START = 0.1  # variance over the spec's from which sizes are looked for
STEADY_SIZE = 1e-3  # relative step of a size below which it has settled
LEAST = 1e-2  # of the spec's sigma: slow courses smaller than this do not matter
FLAT = 1e6  # prior variance of a constant while the sizes are found
SIZES = 33  # variances of a channel that are weighed
SWEEPS = 3  # over all channels, each beside what the others are expected to be
# Readings of one sensor that wander apart: yaw beside roll and pitch, ranges beside bearings.
KIN = {("attitude", 2): 1, ("ranging", 1): 1, ("ranging", 2): 1}
KIN_SPREAD = 1.0  # standard deviation in log variance by which they differ


@dataclass(frozen=True, slots=True)
class Sizing:
    """Which channel and wave every course is, and the most that a channel's variance may be."""

    roles: tuple[Channel, ...]
    channel: NDArray[np.int64]  # (q,)
    wave: Array  # (q,)
    limit: Array  # (c,)

    @property
    def start(self) -> Array:
        return np.full(len(self.roles), START)

    def likeliest(self, normal: Array, score: Array, width: int, size2: Array) -> Array:
        """Variances of the channels by expectation and maximisation, from size2 on.

        The first `width` columns are free, the courses follow.
        """
        own = np.diag(normal).copy()
        share, moving = 1.0 / np.maximum(self.wave, 1), self.wave > 0
        channel, count = self.channel[moving], np.bincount(self.channel[moving])
        information = np.full(own.shape, 1e-12)
        for _ in range(STEPS):
            information[width:] = 1.0 / np.where(moving, size2[self.channel] * share, FLAT)
            scale = 1.0 / np.sqrt(own + information)
            whole = normal * scale[:, None] * scale
            np.fill_diagonal(whole, (own + information) * scale**2)
            inverse = inverse_of(whole, 1e-12)
            values = scale * (inverse @ (scale * score))
            energy = (values**2 + scale**2 * np.diag(inverse))[width:] / share
            sized = np.clip(np.bincount(channel, energy[moving]) / count, LEAST**2, self.limit)
            if np.all(np.abs(sized - size2) < STEADY_SIZE * size2):
                return sized
            size2 = sized
        return size2

    def expected(self, normal: Array, score: Array, width: int, size2: Array) -> Array:
        """Mean of each channel's variance by what the log says of it, the others as they are.

        The likeliest is near 0 where a log is too short to show slow noise, and the variance of
        what a bias is known to grows with this variance: so its mean counts, over all from LEAST^2
        to the limit, alike likely by their logarithm.  Beside the others a channel's own courses
        have information A and score s; with D = diag(1 / k), A' = D^1/2 A D^1/2 = U L U' and
        u = U' D^1/2 s,
            log p(e | v) = sum_i u_i^2 v / (2 (1 + L_i v)) - log(1 + L_i v) / 2 + constant.
        """
        found = size2.copy()
        for c in np.tile(np.arange(len(found)), SWEEPS):
            rows = width + np.flatnonzero((self.channel == c) & (self.wave > 0))
            values, inverse = self.values(normal, score, width, found)
            root = np.sqrt(1.0 / self.wave[rows - width])
            own = inverse_of(inverse[np.ix_(rows, rows)], 1e-12)
            information = (own - np.diag(1.0 / (found[c] * root**2))) * root[:, None] * root
            weight, turned = np.linalg.eigh(information)
            weight = np.maximum(weight, 0.0)
            along2 = (turned.T @ (root * (own @ values[rows]))) ** 2
            sizes = np.geomspace(LEAST**2, self.limit[c], SIZES)[:, None]
            grown = 1.0 + weight * sizes
            logs = 0.5 * np.sum(along2 * sizes / grown - np.log(grown), axis=1)
            likely = np.exp(logs - np.max(logs))
            found[c] = float(sizes[:, 0] @ likely / np.sum(likely))
        return found

    def pooled(self, normal: Array, size2: Array) -> Array:
        """Variances of the channels, where one tells little of its own nearer to those of its kin.

        Kin share what makes them wander; what effects can make of one of them may leave too little
        there to tell by itself.  A logarithm that t waves tell varies by 2 / t, those of kin by
        KIN_SPREAD^2, so kin count as 2 / KIN_SPREAD^2 waves.  None is taken to be quieter than it
        looks.
        """
        names = [(sensor, KIN.get((sensor[1], k), 0)) for sensor, k in self.roles]
        kin = np.array([names.index(one) for one in names])
        common = np.array([np.mean(size2[kin == one]) for one in kin])
        _, inverse = self.values(normal, np.zeros(len(normal)), 0, common)
        prior = common[self.channel] / np.maximum(self.wave, 1)
        seen = np.clip(1.0 - np.diag(inverse) / prior, LEAST, 1.0) * (self.wave > 0)
        told = np.bincount(self.channel, seen, len(self.roles))
        logs, shared = np.log(size2), 2.0 / KIN_SPREAD**2
        means = np.array([np.average(logs[kin == k], weights=told[kin == k]) for k in kin])
        pooled: Array = np.exp((told * logs + shared * means) / (told + shared))
        return np.maximum(size2, pooled)

    def values(self, normal: Array, score: Array, width: int, size2: Array) -> tuple[Array, Array]:
        """Free columns and states at these variances, constants free as well, and covariance."""
        share = 1.0 / np.maximum(self.wave, 1)
        variance = np.where(self.wave > 0, size2[self.channel] * share, FLAT)
        prior = np.concatenate([np.full(width, 1e-12), 1.0 / variance])
        scale = np.sqrt(np.diag(normal) + prior)
        whole = (normal + np.diag(prior)) / scale[:, None] / scale
        inverse = inverse_of(whole, 1e-12) / scale[:, None] / scale
        return inverse @ score, inverse
