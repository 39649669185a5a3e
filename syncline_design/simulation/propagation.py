"""Mean and covariance of the error at situations: by propagation, or averaged over nodes."""

from __future__ import annotations

from typing import Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.simulation.situations import Moments, Pulls, Situations, moments_of
from syncline_design.simulation.undisturbed import StageRun

LawName = Literal["propagated", "averaged"]


@dataclass(frozen=True, slots=True)
class Law:
    """How mean and covariance follow from the error at nodes (dimensions, M) of the timing.

    propagated: nodes are `Situations.steps`; averaged: equally likely.
    """

    situations: Situations
    name: LawName
    nodes: Array

    def of(self, point: Array) -> tuple[Array, Array]:
        """(mean (n, 3), covariance (n, 3, 3)) at points (p, n)."""
        return self._summed(self.situations.moments(point, self.nodes, self._slopes_at))

    def sloped(self, point: Array) -> Sloped:
        """The same with the way back to the points; of systems without effects."""
        runs = self.situations.runs(point, self.nodes, slice(self._slopes_at))
        moments = moments_of(runs)
        return Sloped(self, point, runs, moments, *self._summed(moments))

    @property
    def _slopes_at(self) -> int | None:
        return None if self.name == "averaged" else 1

    def _summed(self, moments: Moments) -> tuple[Array, Array]:
        return averaged(moments) if self.name == "averaged" else _propagated(moments)


@dataclass(frozen=True, slots=True)
class Sloped:
    """Mean (n, 3) and covariance (n, 3, 3) of a law at points (p, n), and what they came from."""

    law: Law
    point: Array
    runs: tuple[StageRun, ...]
    moments: Moments
    mean: Array
    covariance: Array

    def slopes(self, on_mean: Array, on_covariance: Array) -> Array:
        """Slopes (p, n) by what is chosen of a figure with these by mean and covariance.

        With C = J J' + sum of c c', c how a node is off the mean: a symmetric K on C pulls on J
        by 2 K J and on c by 2 K c.
        """
        found, even = self.moments, self.law.name == "averaged"
        part = 1.0 / found.mean_m.shape[1] if even else 1.0
        about = found.mean_m - (self.mean[:, None] if even else found.mean_m[:, :1])
        twice = (2.0 * part) * on_covariance
        on_error = np.einsum("nij,nmj->inm", twice, about)
        if even:  # c sums to nothing: the mean's own pull is all it has
            on_error += part * on_mean.T[:, :, None]
        else:
            on_error[:, :, 0] = on_mean.T - np.sum(on_error[:, :, 1:], axis=2)
        on_slopes = np.einsum("nij,nmjc->icnm", twice, found.slopes_m)
        return self.law.situations.slopes(self.point, self.runs, Pulls(on_error, on_slopes))


def propagation(situations: Situations) -> Law:
    """The law of propagation, C = J J' + sum_k c_k c_k', c_k what one standard deviation of
    variable k does (JCGM 100:2008, eq. 13, independent inputs)."""
    return Law(situations, "propagated", situations.steps())


def columns_at(situations: Situations, point: Array) -> tuple[Array, Array]:
    """(mean (n, 3), what one standard deviation of each noise and variable does (n, 3, c))."""
    return _columns(situations.moments(point, situations.steps(), 1))


def _columns(about: Moments) -> tuple[Array, Array]:
    mean = about.mean_m[:, 0]
    by_timing = np.swapaxes(about.mean_m[:, 1:] - mean[:, None], 1, 2)
    return mean, np.concatenate([about.slopes_m[:, 0], by_timing], axis=2)


def _propagated(about: Moments) -> tuple[Array, Array]:
    mean, columns = _columns(about)
    return mean, columns @ np.swapaxes(columns, 1, 2)


def averaged(moments: Moments) -> tuple[Array, Array]:
    """(mean, covariance) over equally likely nodes."""
    mean = moments.mean_m.mean(axis=1)
    spread = moments.mean_m - mean[:, None]
    within = np.mean(moments.covariance(), axis=1)
    return mean, within + np.einsum("nmi,nmj->nij", spread, spread) / spread.shape[1]
