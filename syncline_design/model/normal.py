"""Quantiles of the standard normal distribution, in standard deviations."""

from __future__ import annotations

from typing import Final

NORMAL_95: Final = 1.959963984540054  # 95 % lie within it, on both sides of the mean
NORMAL_999: Final = 3.290526731491895  # 99.9 % do
HALF_WITHIN: Final = 0.6745  # half of all do: median of what is between signs, in deviations
OF_MEDIAN_DEVIATION: Final = 1.4826  # standard deviation over median absolute deviation
NEARLY_ALL: Final = 1.6449  # 19 of 20 lie below it
