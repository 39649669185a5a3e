"""Quantile and root mean square of |P e|, e normal, by three moments, and their slopes.

Q = sum of lambda chi2 is taken as a shifted, scaled chi2 of h = c2^3 / c3^2 degrees of freedom,
c_r = tr C^r + r m' C^(r-1) m (Imhof, Biometrika 48, 1961, after Pearson), its quantile by Wilson
and Hilferty (1931): only to find where a figure is largest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Asked:
    """What is asked of each error: the axes that count (n, 3), 1 or 0; of a quantile the standard
    normal one of its share (n,), of a root mean square NaN."""

    axes: Array
    normal: Array


@dataclass(frozen=True, slots=True)
class ThreeMoments:
    """c_1, c_2, c_3 (n,) of n means m (n, 3) and covariances C (n, 3, 3) [m]; C m and C C."""

    asked: Asked
    mean: Array
    covariance: Array
    turned: Array
    squared: Array
    first: Array
    second: Array
    third: Array

    def figures(self) -> Array:
        """The figures asked for [m] (n,)."""
        z = self.asked.normal
        h, ratio = self._freedom(np.isfinite(z))
        between = (_chi2(h, np.where(np.isfinite(z), z, 0.0)) - h) * ratio
        square = self.first + np.where(np.isfinite(z), between, 0.0)
        found: Array = np.sqrt(np.maximum(square, 0.0))
        return found

    def _freedom(self, felt: NDArray[np.bool_]) -> tuple[Array, Array]:
        """h and sqrt(c2 / h) = c3 / c2; 1 and 0 where nothing scatters or `felt` is not set."""
        felt = felt & (self.third > 0.0) & (self.second > 0.0)
        second = np.where(felt, self.second, 1.0)
        third = np.where(felt, self.third, 1.0)
        return second * (second / third) ** 2, np.where(felt, third / second, 0.0)

    def slopes(self) -> tuple[Array, Array]:
        """Slopes of `figures` by mean (n, 3) and by the covariance's elements (n, 3, 3)."""
        value = self.figures()
        half = np.where(value > 0.0, 0.5 / np.where(value > 0.0, value, 1.0), 0.0)
        by_second, by_third = (half * part for part in self._by_moments())
        m, c, turned = self.mean, self.covariance, self.turned
        on_mean = (2.0 * half)[:, None] * m + (4.0 * by_second)[:, None] * turned
        on_mean += (6.0 * by_third)[:, None] * np.einsum("nij,nj->ni", c, turned)
        twice, thrice = 2.0 * by_second, 3.0 * by_third
        once = m[:, :, None] * (twice[:, None] * m + 2.0 * thrice[:, None] * turned)[:, None, :]
        on_covariance = twice[:, None, None] * c + thrice[:, None, None] * self.squared
        on_covariance += 0.5 * (once + np.swapaxes(once, 1, 2))
        axes = self.asked.axes
        on_covariance[:, (0, 1, 2), (0, 1, 2)] += half[:, None] * axes
        return on_mean * axes, on_covariance * axes[:, :, None] * axes[:, None, :]

    def _by_moments(self) -> tuple[Array, Array]:
        """Slopes of the figure's square by c_2 and c_3; none where nothing scatters.

        With k(h) = chi2(h) - h and q = c3 / c2 it is c_1 + k q, dh / h = 3 dc2 / c2 - 2 dc3 / c3.
        """
        z = self.asked.normal
        felt = np.isfinite(z)
        h, ratio = self._freedom(felt)
        z = np.where(felt, z, 0.0)
        chi2 = _chi2(h, z)
        # by ln h, chi2 = h u^3 has the slope chi2 + 3 h u^2 h u'
        bent = 2.0 / (9.0 * h) - 0.5 * z * np.sqrt(2.0 / (9.0 * h))
        by_log = chi2 + 3.0 * h * np.cbrt(chi2 / h) ** 2 * bent - h
        by_ratio = chi2 - h
        each = np.where(ratio > 0.0, 1.0 / np.where(ratio > 0.0, self.second, 1.0), 0.0)
        return ratio * (3.0 * by_log - by_ratio) * each, (by_ratio - 2.0 * by_log) * each


def three_moments(mean: Array, covariance: Array, asked: Asked) -> ThreeMoments:
    """Of normal errors of these means (n, 3) [m] and covariances (n, 3, 3) [m2]."""
    axes = asked.axes
    mean = mean * axes
    covariance = covariance * axes[:, :, None] * axes[:, None, :]
    turned = np.einsum("nij,nj->ni", covariance, mean)
    squared = covariance @ covariance
    return ThreeMoments(
        asked=asked,
        mean=mean,
        covariance=covariance,
        turned=turned,
        squared=squared,
        first=np.einsum("nii->n", covariance) + np.einsum("ni,ni->n", mean, mean),
        second=np.einsum("nii->n", squared) + 2.0 * np.einsum("ni,ni->n", mean, turned),
        third=np.einsum("nij,nji->n", squared, covariance)
        + 3.0 * np.einsum("ni,ni->n", turned, turned),
    )


def _chi2(h: Array, z: Array) -> Array:
    """Quantiles of chi2 of h degrees of freedom (Wilson and Hilferty)."""
    part = 2.0 / (9.0 * h)
    found: Array = h * np.maximum(1.0 - part + z * np.sqrt(part), 0.0) ** 3
    return found
