"""Changes of several requirements that together make a spec feasible where no single one does."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from syncline_design.choose.evaluate import Evaluation
from syncline_design.choose.fixes import DIGITS, DIMENSIONS, Fix, in_unit_of, rounded, solve
from syncline_design.choose.outcome import NoVerdict
from syncline_design.design_space import RESOURCES, Limits, Problem, ResourceName, with_limits
from syncline_design.loading import LoadedSpec
from syncline_design.units import Dimension, format_quantity

MOST = 3


def joint_fixes(
    loaded: LoadedSpec, problem: Problem, conflicts: Sequence[tuple[str, ...]]
) -> tuple[tuple[Fix, ...], ...]:
    """One requirement of each conflict moved to what the best design without them reaches.

    Solved again with the moved limits.  A conflict over the sync requirement has none: its limit
    decides which options exist, so there is no single figure to move it to.
    """
    found: list[tuple[Fix, ...]] = []
    for kinds in itertools.product(*conflicts):
        try:
            moved = None if "sync" in kinds else _moved(loaded, problem, kinds)
        except NoVerdict:
            continue
        if moved is not None:
            found.append(moved)
        if len(found) == MOST:
            break
    return tuple(found)


def _moved(loaded: LoadedSpec, problem: Problem, kinds: Sequence[str]) -> tuple[Fix, ...] | None:
    lifted: dict[str, Any] = {_field(kind): None for kind in kinds}
    best = solve(with_limits(problem, replace(problem.limits, **lifted)))
    if best is None:
        return None
    limits = {_field(kind): _reached(best, kind) for kind in kinds}
    if solve(with_limits(problem, replace(problem.limits, **limits))) is None:
        return None
    return tuple(_fix(loaded, problem.limits, kind, limits[_field(kind)]) for kind in kinds)


def _field(kind: str) -> str:
    return "accuracy_m" if kind == "accuracy" else kind


def _reached(found: Evaluation, kind: str) -> Any:
    """A limit, of three figures or whole units of money, that the design meets."""
    if kind == "accuracy":
        return rounded(found.error_m, up=True)
    amount = found.amount(_resource(kind)) or Fraction(0)
    if kind == "cost":
        return Fraction(math.ceil(amount))
    return max(amount, Fraction(str(rounded(float(amount), up=True))))


def _resource(kind: str) -> ResourceName:
    return next(name for name in RESOURCES if name == kind)


def _fix(loaded: LoadedSpec, limits: Limits, kind: str, after: Any) -> Fix:
    name = dict(limits.ids).get(kind, kind)
    written = next((r.limit for r in loaded.spec.requirements if r.id == name), 0.0)
    if kind == "accuracy":
        before = float(limits.accuracy_m or 0.0)
        text = getattr(written, "text", "")
        shown = [in_unit_of(text, value, Dimension.LENGTH) for value in (before, float(after))]
        return Fix("accuracy", name, before, float(after), f"{name} from {shown[0]} to {shown[1]}")
    resource = _resource(kind)
    before = float(limits.budget(resource) or 0)
    shown = [
        format_quantity(value, DIMENSIONS[resource], DIGITS + 2, loaded.spec.currency)
        for value in (before, float(after))
    ]
    return Fix(resource, name, before, float(after), f"{name} from {shown[0]} to {shown[1]}")
