"""Slower, nearer, farther or turning less: the least change of one platform figure that helps.

A design may be feasible in a window only: nearer is more accurate, but a smaller error of the
sensors also asks for better timestamps.  So a range of values is ruled out by a problem that takes
the better end for every figure; what cannot be ruled out is halved, the part near the present
value first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import field, replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.acceptable import without_simulation
from syncline_design.choice.option import Option
from syncline_design.choice.options import Options
from syncline_design.choice.outcome import Fix
from syncline_design.choice.parts import CLOSE, Existence
from syncline_design.choice.table import (
    NOTHING,
    Limits,
    Pair,
    Problem,
    RoleTable,
    with_limits,
)
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    PLATFORM_UNITS,
    Build,
    PlatformFigure,
    platform_figure,
    with_platform_figure,
)
from syncline_design.choice.what_if import WhatIf, platform_what_if
from syncline_design.choice.written import DIGITS, in_unit_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.spec.case import Case, ends_of
from syncline_design.spec.exact import fraction_of

LEAST_SHARE = 1e-3  # a platform figure is not lowered below this share of itself
LARGEST_SHARE = 10.0  # nor a distance raised above this multiple
MOST_RANGES = 400
MOST_WINDOWS = 4  # that the sums leave and simulation is asked in
SIMULATED_CLOSE = 1e-2  # where simulation decides
MOST_DIGITS = 6
Named = tuple[int, str, str, str]
SHARES = (0.98, 0.95, 0.9, 0.8, 0.7, 0.5, 0.3, 0.2, 0.1, 0.03, 0.01, LEAST_SHARE)


def platform_fixes(case: Case, problem: Problem, build: Build) -> Iterator[Fix]:
    """The least change of each figure of each stage that helps, a distance to either side."""
    existence = Existence()
    for index, stage in enumerate(case.spec.stages):
        what_if = platform_what_if(case, problem, build, index)
        for figure, (words, dimension) in PLATFORM_FIGURES.items():
            before = platform_figure(case, index, figure)
            if not before > 0.0:
                continue
            written = getattr(before, "text", "")
            ends = (LEAST_SHARE, LARGEST_SHARE) if figure == "distance" else (LEAST_SHARE,)
            for end in ends:
                asked = _Asked(
                    case, problem, build, what_if, existence, index, figure, dimension,
                    float(before), written,
                )  # fmt: skip
                after = asked.nearest(end * float(before))
                if after is not None:
                    text = f"{words} of {stage.name} from {_shown(before, dimension)}"
                    text = f"{text} to {after.text}"
                    if figure == "distance" and stage.distance is not None:
                        text = _of_several(stage.name, stage.distance, after)
                    yield Fix(
                        "platform", None, figure, stage.name, float(before), float(after),
                        PLATFORM_UNITS[figure], text,
                    )  # fmt: skip


def _of_several(stage: str, distances: Quantity, after: Quantity) -> str:
    """Several distances with another far end; one alone where that is before the near end."""
    near, far = ends_of(distances)
    if after < near:
        return f"distance of {stage} from {distances.text} to {after.text} alone, of its platform"
    return f"far end of the distance of {stage} from {far.text} to {after.text}"


def _shown(value: float, dimension: Dimension) -> str:
    written = getattr(value, "text", "")
    return written or in_unit_of("", Fraction(value), dimension, up=True, digits=DIGITS + 2).text


@dataclass
class _Asked:
    """One figure of one stage, and what is known of its values.

    problem: of the case as it is; what_if: by the value of a figure, as quick as can be; build:
    anew from a changed case.
    """

    case: Case
    problem: Problem
    build: Build
    what_if: WhatIf
    existence: Existence
    stage: int
    figure: PlatformFigure
    dimension: Dimension
    before: float
    written: str
    problems: dict[float, Problem] = field(default_factory=dict)

    def nearest(self, end: float) -> Quantity | None:
        """The value nearest to the present one, on the way to an end, at which a design exists."""
        found = self._window(self.before, end)
        if found is None or self._simulation_rules_out(end):
            return None
        fails, works = found
        if not self._holds(works):  # simulation decides
            search = self._farther if end > self.before else self._nearer
            fails, works = search(works, end)
            if not self._holds(works):
                return None
        return self._rounded(self._edge(fails, works), end)

    def _simulation_rules_out(self, end: float) -> bool:
        """Whether the far end keeps every sum and still fails in simulation: then no value helps,
        since a slower or nearer vehicle errs no more."""
        last = self._problem(end)
        if last.judge is None or end > self.before or self._edges(self.before, end):
            return False
        return self.existence.of(without_simulation(last)) and not self.existence.of(last)

    def _problem(self, value: float) -> Problem:
        if value not in self.problems:
            self.problems[value] = self.what_if(self.problem, self.figure, value)
        return self.problems[value]

    def _changed(self, value: Quantity) -> Case:
        return with_platform_figure(self.case, self.stage, self.figure, value)

    def _holds(self, value: float) -> bool:
        return self.existence.of(self._problem(value))

    def _window(self, near: float, end: float) -> tuple[float, float] | None:
        """Nearest (value that fails, value next to it that keeps the sums)."""
        ranges = [(near, end)]
        for _ in range(MOST_RANGES):
            if not ranges:
                return None
            one, other = ranges.pop()
            best = better_of(self._problem(one), self._problem(other), self._moved(one, other))
            if not self.existence.of(best):
                continue
            if abs(other - one) <= CLOSE * max(one, other):
                for value in (*self._edges(one, other), other):
                    if self._keeps_sums(value):
                        return one, value
                continue
            middle = math.sqrt(one * other)
            ranges += [(middle, other), (one, middle)]
        return None

    def _moved(self, one: float, other: float) -> Moved:
        """Where and how fast the stage is between two values of the figure."""
        least, most = min(one, other), max(one, other)
        near = far = float(platform_figure(self.case, self.stage, "distance"))
        slowest = fraction_of(platform_figure(self.case, self.stage, "v_max"))
        if self.figure == "distance":
            near, far = least, most
        elif self.figure == "v_max":
            slowest = Fraction(least)
        return Moved(self.stage, near, far, slowest)

    def _edges(self, one: float, other: float) -> list[float]:
        """Values from one to another at which an option comes or goes, in that order."""
        found: set[float] = set()
        problem = self._problem(one)
        for table in problem.roles:
            if table.stage == self.stage:
                found |= self._edges_of(table, problem.limits.spacing_m)
        low, high = min(one, other), max(one, other)
        return sorted((d for d in found if low <= d <= high), reverse=other < one)

    def _edges_of(self, table: RoleTable, spacing_m: float | None) -> set[float]:
        """The same of one role: ends of reach; where samples get as far apart as they may."""
        pool, found = table.anywhere(), []
        speed, distance = float(table.speed_mps), float(table.distance_m)
        if self.figure == "distance":
            found += [pool.near, pool.far]
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.figure == "distance" and spacing_m is not None:
                found.append(spacing_m * pool.sound / (2.0 * speed))
            if self.figure == "v_max" and spacing_m is not None:
                found.append(spacing_m / np.maximum(1.0 / pool.rate, 2.0 * distance / pool.sound))
        return {value for one in found for value in one.tolist() if math.isfinite(value)}

    def _nearer(self, start: float, end: float) -> tuple[float, float]:
        """(last value that fails, first that holds); both fail where none is found.

        The smaller the figure, the smaller the simulated errors, so the search goes on to the far
        edge of the window that the sums leave, and into the next one.
        """
        last = start
        for _ in range(MOST_WINDOWS):
            far, beyond = self._far_edge(start, end)
            for value in (*_shares(start, far), far):
                if self._holds(value):
                    return last, value
                last = value
            following = None if far == end else self._window(beyond, end)
            if following is None:
                break
            start = following[1]
        return last, last

    def _farther(self, start: float, end: float) -> tuple[float, float]:
        """As `_nearer` to the other side, where only options that were not there before help."""
        last, seen = start, self._options(start)
        for value in (*_shares(start, end), end):
            while not self._options(value) <= seen:
                outside, inside = last, value
                while inside - outside > CLOSE * inside:
                    middle = math.sqrt(outside * inside)
                    new = not self._options(middle) <= seen
                    outside, inside = (outside, middle) if new else (middle, inside)
                if self._holds(inside):
                    return outside, inside
                seen |= self._options(inside)
                last = inside
            last = value
        return last, last

    def _far_edge(self, start: float, end: float) -> tuple[float, float]:
        """Last value on the way to an end that keeps the sums, and one close by that does not."""
        keeps, breaks = start, end
        if self._keeps_sums(end):
            return end, end
        while abs(breaks - keeps) > CLOSE * max(keeps, breaks):
            middle = math.sqrt(keeps * breaks)
            keeps, breaks = (middle, breaks) if self._keeps_sums(middle) else (keeps, middle)
        return keeps, breaks

    def _keeps_sums(self, value: float) -> bool:
        return self.existence.of(without_simulation(self._problem(value)))

    def _options(self, value: float) -> set[Named]:
        return {
            (table.stage, table.role, one.sensor, one.method)
            for table in self._problem(value).roles
            for one in table.options
        }

    def _edge(self, fails: float, works: float) -> float:
        """The value nearest to one that fails that holds, to 1e-4, or where an option comes in."""
        for end in self._edges(fails, works):
            if end != fails and self._holds(end):
                works = end
                break
            fails = end
        close = CLOSE if self._problem(works).judge is None else SIMULATED_CLOSE
        while abs(works - fails) > close * abs(works):
            middle = 0.5 * (works + fails)
            works, fails = (middle, fails) if self._holds(middle) else (works, middle)
        return works

    def _rounded(self, value: float, end: float) -> Quantity | None:
        """The value as it would be written, with as many figures as its window asks for."""
        for digits in range(DIGITS, MOST_DIGITS + 1):
            shown = in_unit_of(
                self.written, Fraction(value), self.dimension, up=end > value, digits=digits
            )
            if self.existence.of(self.build(self._changed(shown))):
                return shown
        return None


def _shares(start: float, end: float) -> Iterator[float]:
    """Values between two, at fixed shares of the first or of its reciprocal."""
    for share in SHARES:
        value = start * share if end < start else start / share
        if (value - end) * (start - end) > 0:
            yield value


@dataclass(frozen=True, slots=True)
class Moved:
    """Where and how fast a stage is, at one of several values of a figure: between which distances
    [m], and how fast at least [m/s]."""

    stage: int
    near: float
    far: float
    slowest: Fraction


def better_of(one: Problem, other: Problem, moved: Moved | None = None) -> Problem:
    """A problem that has a design wherever one of two, or any between them, has.

    For figures that move steadily from one to the other: each option takes the smaller error for
    the total, the larger noise against its timestamps, the smaller tau and rate.  moved: the stage
    whose figure it is; its options are those that work anywhere in between.
    """
    first, second = (_open(problem) for problem in (one, other))
    roles = tuple(
        _better_role(a, b, one.limits, moved)
        for a, b in zip(first.roles, second.roles, strict=True)
    )
    rate = min(one.sync_rate(), other.sync_rate())
    fixed = min(one.fixed_error(), other.fixed_error())
    pairs = tuple(_slower(a, b) for a, b in zip(one.pairs, other.pairs, strict=True))
    return replace(
        one,
        roles=roles,
        pairs=pairs,
        sync_rate_mps=float(rate),
        exact_sync_rate_mps=rate,
        fixed_error_m=float(fixed),
        exact_fixed_error_m=fixed,
        nearer=(),  # near ends rule out more; whether they do is asked of each value
        judge=None,
    )


def _open(problem: Problem) -> Problem:
    return with_limits(problem, replace(problem.limits, sync=math.inf))


def _slower(one: Pair, other: Pair) -> Pair:
    rate = min(one.rate(), other.rate())
    return replace(one, rate_mps=float(rate), exact_rate_mps=rate)


def _better_role(
    one: RoleTable, other: RoleTable, limits: Limits, moved: Moved | None
) -> RoleTable:
    """The better of each option; wherever a stage is, the same ones are here or beyond."""
    first, second = _by_name(one.pool()), _by_name(other.pool())
    if moved is not None and moved.stage == one.stage:
        first, second = _by_name(one.anywhere()), _by_name(other.anywhere())
    keeps = first.keep_own_tau_crit(limits.sync) | second.keep_own_tau_crit(limits.sync)
    if moved is not None and moved.stage == one.stage:
        keeps &= first.reach(moved.near, moved.far)
        keeps &= first.keep_spacing(moved.slowest, Fraction(moved.near), limits.spacing_m)
    beside = dict(zip(first.at.tolist(), second.at.tolist(), strict=True))
    better = replace(
        first,
        make=lambda place: _better_option(first.make(place), second.make(beside[place])),
        error=np.maximum(first.error, second.error),
        added=np.minimum(first.added, second.added),
        tau=np.minimum(first.tau, second.tau),
        crit=np.full(len(first), math.inf),
        nearer=np.zeros(len(first)),
    )
    return replace(one, options=better.take(keeps), excluded=NOTHING)


def _by_name(options: Options) -> Options:
    return options.take(options.by_name())


def _better_option(one: Option, other: Option) -> Option:
    noise = max(one.error(), other.error())
    added = min(one.error() + one.systematic(), other.error() + other.systematic())
    tau = min(one.tau(), other.tau())
    return replace(
        one,
        sensor_error_m=float(noise),
        exact_error_m=noise,
        systematic_m=float(added - noise),
        exact_systematic_m=added - noise,
        tau_s=float(tau),
        exact_tau_s=tau,
        tau_crit_s=math.inf,
        own_rate_mps=None,
        near_error_m=None,
        near_rate_mps=None,
        bends=(),
    )
