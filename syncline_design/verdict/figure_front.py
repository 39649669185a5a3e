"""The front of a resource against a figure of the error: worst case, THU, TVU, RMS, a quantile.

Each point is the first design in the order of the resource whose figure is below that of the point
before, every other requirement kept; the judge of figures decides, so that nothing that could lie
on the front is left out but by a bound (`cuts`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, get_args

from syncline_design.choice.acceptable import iter_judged
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.narrowed import stated
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Judge, Problem
from syncline_design.model.figure_text import percent
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import Requirement
from syncline_design.verdict.acceptance import Simulations

FigureKind = Literal["worst_case", "thu", "tvu", "rmse", "quantile"]
FIGURES: tuple[FigureKind, ...] = get_args(FigureKind)
_DEFAULTS: dict[FigureKind, dict[str, Any]] = {
    "rmse": {"axis": "3d"},
    "quantile": {"of": "3d", "p": 0.95},
}
_LOOSE = "1000000000 m"
LESS = 1.0 - 1e-3  # figures nearer to each other than their search: the cheaper is on the front


def drawn_requirement(case: Case, kind: FigureKind) -> Requirement:
    """What the front is drawn over: as the spec's first requirement of that kind says, else 95 % or
    in space; its limit out of the way."""
    own = next((one for one in case.spec.requirements if one.kind == kind), None)
    keys = dict(_DEFAULTS.get(kind, {}))
    if own is not None:
        asked = {key: getattr(own, key) for key in ("confidence", "axis", "of", "p")}
        keys |= {key: value for key, value in asked.items() if value is not None}
    taken = {one.id for one in case.spec.requirements}
    name = next(name for k in range(len(taken) + 1) if (name := f"front-{k}") not in taken)
    return Requirement.model_validate({"id": name, "kind": kind, "limit": _LOOSE, **keys})


def figure_words(requirement: Requirement) -> str:
    """A figure in words, as a heading of a front."""
    share = requirement.share
    part = "" if share is None else f"{percent(float(share), 6)} of "
    axis = {"3d": "3D", None: ""}.get(requirement.axis or requirement.of, "")
    axis = axis or str(requirement.axis or requirement.of or "")
    return {
        "worst_case": "certified worst case",
        "thu": f"{part}horizontal errors (THU)",
        "tvu": f"{part}vertical errors (TVU)",
        "rmse": f"RMS of {axis} errors",
        "quantile": f"{part}{axis} errors",
    }[requirement.kind]


def figure_front(
    case: Case, requirement: Requirement, resource: ResourceName, seed: int
) -> Iterator[FrontPoint]:
    """Points by rising amount and falling figure.

    They keep every requirement of the spec but accuracy and those on this very figure.
    """
    problem = Simulations(seed).problem_of(without_figure(case, requirement))
    priced = stated(problem, resource)
    judge = problem.judge
    if priced.is_empty or judge is None:
        return
    least = float(requirement.limit)
    while True:
        found = None
        for found in _next(priced.problem, judge, requirement.id, resource, least):
            yield replace(found, design=priced.whole(found.design))
        if found is None or found.undecided or found.figure_m is None:
            return
        least = found.figure_m * LESS


def without_figure(case: Case, requirement: Requirement) -> Case:
    """The case with a figure's requirement in place of accuracy and all on that figure."""
    rest = (one for one in case.spec.requirements if one.kind != "accuracy")
    others = [one for one in rest if not _is_same(one, requirement)]
    spec = case.spec.model_copy(update={"requirements": (*others, requirement)})
    return replace(case, spec=spec)


def _next(
    problem: Problem, judge: Judge, name: str, resource: ResourceName, least_m: float
) -> Iterator[FrontPoint]:
    """The first design of a smaller figure, after those that simulation leaves open."""
    limits = tuple((one, least_m if one == name else limit) for one, limit in judge.limits)
    asked = replace(problem, objective=resource, judge=judge.with_limits(limits))
    for design, said in iter_judged(asked):
        if said.failed:
            continue
        sums = evaluate(problem, design)
        amount = sums.amount(resource)
        assert amount is not None
        figure = judge.reached_m(problem, design, name)
        yield FrontPoint(amount, sums.error_m, design, said.undecided, figure)
        if said.passed:
            return


def _is_same(one: Requirement, other: Requirement) -> bool:
    """Whether two requirements limit the same figure."""
    return (one.kind, one.share, one.axis, one.of) == (
        other.kind, other.share, other.axis, other.of,
    )  # fmt: skip
