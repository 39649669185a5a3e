"""A spec with a design pinned, as text and as a case."""

from __future__ import annotations

from datetime import date

from syncline_design.choice.outcome import Infeasible
from syncline_design.choice.problem import build_problem, selection_of, sole_design
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import Build
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.edit import PinnedRole, pinned, pinned_spec_text
from syncline_design.spec.load import BadInput, Flaw
from syncline_design.spec.selection import RoleSelection
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.open_choice import chosen_of
from syncline_design.verdict.scenarios import refuse_missions


def pinned_text(case: Case, problem: Problem, design: Design) -> str:
    """The spec with a design pinned, for `--write-design`."""
    return pinned_spec_text(case, *_pins(case, problem, design))


def as_measured(case: Case, seed: int) -> Case:
    """The spec of the system that made a log: with choices open, its best design pinned."""
    refuse_missions(case)
    if sole_design(build_problem(case)) is not None:
        return case
    problem, design = picked_design(case, seed)
    if problem.combinations == 1:
        return case
    return pinned_case(case, problem, design)


def pinned_case(case: Case, problem: Problem, design: Design) -> Case:
    """The case with a design pinned."""
    return pinned(case, *_pins(case, problem, design))


def _pins(case: Case, problem: Problem, design: Design) -> tuple[list[PinnedRole], dict[int, str]]:
    """Roles and, by stage, clocks of a design."""
    selected = selection_of(problem, design)
    index = {stage.choice.name: stage for stage in case.stages}
    roles = [pinned_role(index[one.stage], one) for one in selected.roles]
    clocks = {
        stage.index: identity
        for stage in case.stages
        if stage.clocks and (identity := selected.clock(stage.choice.vehicle_name)) is not None
    }
    return roles, clocks


def pinned_role(stage: StageCase, one: RoleSelection) -> PinnedRole:
    """What to write for one role; an error given in place stays, with its primitive if it has."""
    role = stage.role(one.role)
    assert role is not None
    if role.inline is not None:
        return PinnedRole(stage.index, one.role, one.sensor)
    return PinnedRole(stage.index, one.role, one.sensor, one.primitive, one.method)


def picked_design(case: Case, seed: int) -> tuple[Problem, Design]:
    """The only design of a pinned spec, or the best of an open one; BadInput when there is none.

    By its figures as given, whatever it is chosen for.
    """
    refuse_missions(case)

    def fresh() -> Build:
        return Simulations(seed).problem_of

    build = fresh()
    problem = build(case)
    sole = sole_design(problem)
    if sole is not None:
        return sole
    chosen = chosen_of(case, problem, (build, fresh), "auto", date.today())
    if isinstance(chosen.choice, Infeasible):
        line, column = case.positions.get(("stages",), (0, 0))
        message = "no design meets this spec, so there is no system to work with"
        hint = f"see `syncline-design check {case.path.name}`, or pin the sensors"
        place = (str(case.path), line, column, "stages")
        raise BadInput((Flaw(*place, message, hint=hint),))
    return chosen.problem, chosen.choice.design
