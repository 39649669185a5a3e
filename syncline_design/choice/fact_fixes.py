"""What a spec may say otherwise of the world, where facts leave it without a design.

Each change is a claim about the vehicle or the market that somebody has to make true, so the text
says what; like every other fix it is solved again before it is offered.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from syncline_design.choice.outcome import Fix
from syncline_design.choice.parts import is_feasible
from syncline_design.choice.table import Problem
from syncline_design.choice.variations import Build, with_stage
from syncline_design.machine.deadline import unhurried
from syncline_design.spec.case import Case
from syncline_design.spec.gnss import has_gnss, has_gnss_time

Change = tuple[str, str | None, Case, str]  # figure, stage, the spec so written, what it takes


def fact_fixes(case: Case, problem: Problem, build: Build) -> Iterator[Fix]:
    """Changes of `gnss`, `timing_from`, `allow_discontinued` and `strict_facts` that help."""
    codes = _codes(problem)
    for figure, stage, changed, text in _changes(case, codes):
        if is_feasible(build(changed)):
            yield Fix("facts", None, figure, stage, None, None, None, text)


def _codes(problem: Problem) -> set[tuple[str, int]]:
    """Why something was ruled out, and on which stage."""
    found = {
        (gone.code, table.stage)
        for table in problem.roles
        for gone in unhurried(table.excluded.rest)
    }
    for vehicle in problem.vehicles:
        found |= {(gone.code, stage) for gone in vehicle.excluded for stage in vehicle.stages}
    return found


def _changes(case: Case, codes: set[tuple[str, int]]) -> Iterator[Change]:
    spec = case.spec
    deaf = [stage for stage in case.stages if ("gnss", stage.index) in codes]
    for stage in deaf:
        name = stage.choice.name
        timed = [one.name for one in spec.stages if one.name != name and has_gnss_time(spec, one)]
        for source in timed[:1] if not has_gnss_time(spec, stage.choice) else ():
            text = f"timing_from: {source} in {name}, if a cable can bring the time"
            yield "timing_from", name, with_stage(case, stage.index, timing_from=source), text
        if not has_gnss(spec, stage.choice):
            text = f"gnss: yes in {name}, if it can have an antenna above the water"
            yield "gnss", name, with_stage(case, stage.index, gnss=True), text
    reasons = {code for code, _ in codes}
    if "discontinued" in reasons:
        text = "allow_discontinued: yes, if one can still be had"
        yield "allow_discontinued", None, _with(case, allow_discontinued=True), text
    if "unknown-fact" in reasons:
        text = "strict_facts: no, once somebody has looked up what the entries do not tell"
        yield "strict_facts", None, _with(case, strict_facts=False), text


def _with(case: Case, **changes: Any) -> Case:
    return replace(case, spec=case.spec.model_copy(update=changes))
