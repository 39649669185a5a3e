"""Quantiles of the standard normal distribution, in standard deviations."""

from __future__ import annotations

from typing import Final

NORMAL_95: Final = 1.959963984540054  # 95 % lie within it, on both sides of the mean
NEARLY_ALL: Final = 1.6449  # 19 of 20 lie below it
