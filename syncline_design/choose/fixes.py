"""Smallest single changes that make an infeasible spec feasible, each solved again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

from syncline_design.choose.decide import choose
from syncline_design.choose.evaluate import Evaluation, evaluate
from syncline_design.choose.outcome import Choice
from syncline_design.choose.variations import (
    PLATFORM_FIGURES,
    Build,
    PlatformFigure,
    platform_figure,
    quantity,
    with_methods,
    with_platform_figure,
)
from syncline_design.design_space import RESOURCES, Objective, Problem, ResourceName, with_limits
from syncline_design.loading import LoadedSpec
from syncline_design.resolution import candidate_sensors, timestamping_of, usable_primitives
from syncline_design.spec import InlineTimestamping
from syncline_design.units import UNITS, Dimension, format_quantity

FixKind = Literal["accuracy", "sync", "cost", "mass", "power", "platform", "timestamping"]
DIGITS = 3
STEPS = 40
CLOSE = 1e-4
LEAST_SHARE = 1e-3  # a platform figure is not lowered below this share of itself
MOST_METHODS = 3
LARGEST_RATIO = 1e12
DIMENSIONS: dict[ResourceName, Dimension] = {
    "cost": Dimension.MONEY,
    "mass": Dimension.MASS,
    "power": Dimension.POWER,
}


@dataclass(frozen=True, slots=True)
class Fix:
    """One change that was solved again and does make the spec feasible.

    requirement: id of the requirement it changes, None where it changes something else.
    before, after: the figure in SI (None: not a figure).
    """

    kind: FixKind
    requirement: str | None
    before: float | None
    after: float | None
    text: str

    def to_json(self) -> dict[str, Any]:
        """The entry under `fixes`."""
        return {
            "kind": self.kind,
            "requirement": self.requirement,
            "from": self.before,
            "to": self.after,
            "text": self.text,
            "proven": True,
        }


def solve(problem: Problem) -> Evaluation | None:
    """The best design's sums; None when there is none."""
    found = choose(problem, "front")
    return evaluate(problem, found.design) if isinstance(found, Choice) else None


def is_feasible(problem: Problem) -> bool:
    """Whether any design meets the spec."""
    return solve(problem) is not None


def requirement_fixes(loaded: LoadedSpec, problem: Problem) -> Iterator[Fix]:
    """For each requirement alone the least relaxation that helps."""
    names, currency = dict(problem.limits.ids), loaded.spec.currency
    written = {r.id: getattr(r.limit, "text", "") for r in loaded.spec.requirements}
    if problem.limits.accuracy_m is not None:
        name = names.get("accuracy", "accuracy")
        yield from _accuracy_fix(problem, name, written.get(name, ""))
    yield from _sync_fix(problem, names.get("sync"))
    for resource in RESOURCES:
        if problem.limits.budget(resource) is not None:
            yield from _budget_fix(problem, resource, names.get(resource, resource), currency)


def _towards(problem: Problem, objective: Objective, **limits: Any) -> Evaluation | None:
    """Sums of the best design for an objective under changed limits."""
    changed = with_limits(problem, replace(problem.limits, **limits))
    return solve(replace(changed, objective=objective))


def _accuracy_fix(problem: Problem, name: str, text: str) -> Iterator[Fix]:
    best = _towards(problem, "error", accuracy_m=None)
    before = problem.limits.accuracy_m
    if best is None or before is None:
        return
    after = rounded(best.error_m, up=True)
    if _towards(problem, problem.objective, accuracy_m=after) is None:
        after = best.error_m
    shown = [in_unit_of(text, v, Dimension.LENGTH) for v in (before, after)]
    yield Fix("accuracy", name, before, after, f"{name} from {shown[0]} to {shown[1]}")


def _sync_fix(problem: Problem, name: str | None) -> Iterator[Fix]:
    def holds(limit: float) -> bool:
        return is_feasible(with_limits(problem, replace(problem.limits, sync=limit)))

    before = problem.limits.sync
    if not holds(math.inf):
        return
    high = 2.0 * before
    while not holds(high) and high < LARGEST_RATIO:
        high *= 4.0
    if not holds(high):
        return
    after = _bisect(holds, before, high, up=True)
    shown = f"{before:.6g} to {after:.6g}"
    text = f"{name} from {shown}"
    if name is None:
        text = f"the implied sync limit from {shown}: write {{kind: sync, limit: {after:.6g}}}"
    yield Fix("sync", name, before, after, text)


def _budget_fix(
    problem: Problem, resource: ResourceName, name: str, currency: str
) -> Iterator[Fix]:
    least = _towards(problem, resource, **{resource: None})
    before = problem.limits.budget(resource)
    amount = least.amount(resource) if least is not None else None
    if before is None or amount is None:
        return
    after = Fraction(math.ceil(amount)) if resource == "cost" else amount
    if resource != "cost":
        after = max(amount, Fraction(rounded(float(amount), up=True)))
    if _towards(problem, problem.objective, **{resource: after}) is None:
        return
    dimension = {"cost": Dimension.MONEY, "mass": Dimension.MASS, "power": Dimension.POWER}[
        resource
    ]
    shown = [
        format_quantity(float(v), dimension, DIGITS + 2, currency)
        for v in (after - before, before, after)
    ]
    text = f"{name} by {shown[0]}, from {shown[1]} to {shown[2]}"
    yield Fix(resource, name, float(before), float(after), text)


def platform_fixes(loaded: LoadedSpec, build: Build) -> Iterator[Fix]:
    """Slower, nearer or turning less: the least reduction of one figure of one stage that helps."""
    for index, stage in enumerate(loaded.spec.stages):
        for figure, (words, dimension) in PLATFORM_FIGURES.items():
            found = _platform_fix(loaded, build, index, figure, dimension)
            if found is not None:
                before, after = found
                written = getattr(before, "text", "")
                shown = [in_unit_of(written, v, dimension) for v in (before, after)]
                text = f"{words} of {stage.name} from {shown[0]} to {shown[1]}"
                yield Fix("platform", None, float(before), after, text)


def _platform_fix(
    loaded: LoadedSpec, build: Build, stage: int, figure: PlatformFigure, dimension: Dimension
) -> tuple[float, float] | None:
    before = platform_figure(loaded, stage, figure)
    if before <= 0.0:
        return None

    def holds(value: float) -> bool:
        changed = with_platform_figure(loaded, stage, figure, quantity(value, dimension))
        return is_feasible(build(changed))

    unit = 180.0 / math.pi if dimension is Dimension.ANGULAR_RATE else 1.0
    last = before
    for share in (0.9, 0.7, 0.5, 0.3, 0.1, 0.03, 0.01, LEAST_SHARE):
        if holds(share * before):
            return before, _bisect(holds, last, share * before, up=False, unit=unit)
        last = share * before
    return None


def _bisect(
    holds: Callable[[float], bool], fails: float, works: float, *, up: bool, unit: float = 1.0
) -> float:
    """The value nearest to `fails` that works, to 1e-4 and then three figures in its unit."""
    for _ in range(STEPS):
        if abs(works - fails) <= CLOSE * abs(works):
            break
        middle = 0.5 * (works + fails)
        works, fails = (middle, fails) if holds(middle) else (works, middle)
    shown = rounded(works * unit, up=up) / unit
    return shown if holds(shown) else works


def in_unit_of(written: str, value: float, dimension: Dimension) -> str:
    """A figure in the unit that the user wrote, such as `5 cm`; else in a usual one."""
    unit = written.partition(" ")[2].strip()
    known = UNITS.get(unit)
    if known is None or known[0] is not dimension:
        return format_quantity(value, dimension, DIGITS + 2)
    return f"{value / float(known[1]):.5g} {unit}"


def rounded(value: float, *, up: bool) -> float:
    """Three significant figures, rounded up or down."""
    if value == 0.0 or not math.isfinite(value):
        return value
    power = DIGITS - 1 - math.floor(math.log10(abs(value)))
    scaled = Fraction(value) * Fraction(10) ** power
    whole = math.ceil(scaled) if up else math.floor(scaled)
    return float(whole / Fraction(10) ** power)


def method_fixes(loaded: LoadedSpec, build: Build, problem: Problem) -> Iterator[Fix]:
    """Timestamping methods of the catalogs that, opened to a role without options, do help."""
    for table in problem.roles:
        if table.options:
            continue
        stage = loaded.spec.stages[table.stage]
        choice = stage.role(table.role)
        assert choice is not None
        now = timestamping_of(loaded.spec, stage, choice, loaded.catalog)
        if isinstance(now, InlineTimestamping):
            continue
        have = tuple(name for name, _ in now)
        sensors = candidate_sensors(loaded.spec, stage, table.role, loaded.catalog)
        found: list[tuple[float, str]] = []
        for name, method in loaded.catalog.timestamping.items():
            if name in have or not any(
                usable_primitives(s, method, choice.primitive) for _, s in sensors
            ):
                continue
            best = solve(build(with_methods(loaded, table.stage, table.role, (*have, name))))
            if best is not None:
                found.append((float(best.cost or 0), name))
        for _, name in sorted(found)[:MOST_METHODS]:
            text = f"let {table.role} of {stage.name} be stamped by {name}"
            yield Fix("timestamping", None, None, None, text)
