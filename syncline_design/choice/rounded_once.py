"""Total errors of many designs at once, each rounded once.

Where every figure is a plain float, sums and products are carried as unevaluated pairs of floats
(T. J. Dekker, Numer. Math. 18, 1971, and D. E. Knuth's TwoSum), about 32 digits; otherwise design
by design in fractions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.choice.evaluate import total_error_m
from syncline_design.choice.pareto import Floats, Indices
from syncline_design.choice.table import Design, Pair, Problem

SPLIT = 2.0**27 + 1.0
Double = tuple[Floats, Floats]  # value and what rounding left over


def total_errors_m(problem: Problem, designs: Sequence[Design]) -> list[float]:
    """Total error of each design [m]."""
    if not designs:
        return []
    if not _is_plain(problem):
        return [total_error_m(problem, design) for design in designs]
    options = np.array([design.options for design in designs]).T
    clocks = np.array([design.clocks for design in designs]).T
    columns = _Columns(problem, options, clocks)
    total = columns.sync()
    for r in range(len(problem.roles)):
        total = plus(plus(total, columns.error(r)), columns.systematic(r))
    total = plus(total, np.full(len(designs), problem.fixed_error_m))
    out: list[float] = (total[0] + total[1]).tolist()
    return out


def _is_plain(problem: Problem) -> bool:
    """Whether every figure is a float and nothing more."""
    given = [problem.exact_sync_rate_mps, problem.exact_fixed_error_m]
    given += [pair.exact_rate_mps for pair in problem.pairs]
    given += [clock.exact_offset_s for vehicle in problem.vehicles for clock in vehicle.clocks]
    if any(figure is not None for figure in given):
        return False
    options = [option for table in problem.roles for option in table.options]
    exact = [(o.exact_error_m, o.exact_tau_s, o.exact_systematic_m) for o in options]
    return all(figures == (None, None, None) for figures in exact)


class _Columns:
    """Figures of the chosen options, one row per design."""

    def __init__(self, problem: Problem, options: Indices, clocks: Indices) -> None:
        self.problem, self.options, self.clocks = problem, options, clocks

    def error(self, r: int) -> Floats:
        """Sensor errors of one role [m]."""
        table = self.problem.roles[r].options
        return np.array([table[i].sensor_error_m for i in self.options[r]])

    def systematic(self, r: int) -> Floats:
        """Systematic errors that come with the sensors of one role [m]."""
        table = self.problem.roles[r].options
        return np.array([table[i].systematic_m for i in self.options[r]])

    def sync(self) -> Double:
        """Sync error [m]: rate times the largest bound, or the sum over pairs."""
        size = self.options.shape[1]
        largest: Double = (np.zeros(size), np.zeros(size))
        summed: Double = (np.zeros(size), np.zeros(size))
        for pair in self.problem.pairs:
            bound = self._bound(pair)
            above = (bound[0] > largest[0]) | ((bound[0] == largest[0]) & (bound[1] > largest[1]))
            largest = (
                np.where(above, bound[0], largest[0]),
                np.where(above, bound[1], largest[1]),
            )
            caused = times(bound, pair.rate_mps)
            summed = plus(plus(summed, caused[0]), caused[1])
        if self.problem.sync_model == "per_sensor":
            return summed
        return times(largest, self.problem.sync_rate_mps)

    def _bound(self, pair: Pair) -> Double:
        tau, host = self._timing(pair.role)
        bound: Double = (tau, np.zeros(len(tau)))
        vehicle = self.problem.roles[pair.role].vehicle
        if pair.reference is None:
            return plus(bound, np.where(host, self._offset(vehicle), 0.0))
        other, other_host = self._timing(pair.reference)
        vehicles = [vehicle, self.problem.roles[pair.reference].vehicle]
        same = (host == other_host) & (~host | (vehicles[0] == vehicles[1]))
        bound = plus(bound, other)
        for vehicle, on_host in zip(vehicles, (host, other_host), strict=True):
            bound = plus(bound, np.where(on_host & ~same, self._offset(vehicle), 0.0))
        return bound

    def _offset(self, vehicle: int) -> Floats:
        """Bounds of the offset of a vehicle's host clock [s]."""
        table = self.problem.vehicles[vehicle].clocks
        return np.array([table[i].offset_bound_s for i in self.clocks[vehicle]])

    def _timing(self, r: int) -> tuple[Floats, Indices]:
        table = self.problem.roles[r].options
        chosen = [table[i] for i in self.options[r]]
        host = np.array([option.timeline == "host" for option in chosen])
        return np.array([option.tau_s for option in chosen]), host


def plus(pair: Double, value: Floats) -> Double:
    """A pair plus a float."""
    total = pair[0] + value
    shadow = total - pair[0]
    rest = (pair[0] - (total - shadow)) + (value - shadow)
    low = pair[1] + rest
    high = total + low
    return high, low - (high - total)


def times(pair: Double, factor: float) -> Double:
    """A pair times a float."""
    high, rest = exact_product(pair[0], factor)
    low = rest + pair[1] * factor
    total = high + low
    return total, low - (total - high)


def exact_product(a: Floats, b: float) -> Double:
    """Two floats whose sum is a * b exactly."""
    product = a * b
    a_high, b_high = a * SPLIT - (a * SPLIT - a), b * SPLIT - (b * SPLIT - b)
    a_low, b_low = a - a_high, b - b_high
    rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return product, rest
