"""`optimize`: the choice itself with its front, runners-up, prices and what they hinge on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from syncline_design import __version__
from syncline_design.choice.acceptable import refusals
from syncline_design.choice.decide import best
from syncline_design.choice.explain import Explanation, explain
from syncline_design.choice.front import front
from syncline_design.choice.outcome import FrontPoint, Road, Unfinished
from syncline_design.choice.prices import PriceStep, staircase
from syncline_design.choice.problem import selection_of
from syncline_design.choice.slack import Slack, slack_ledger
from syncline_design.choice.table import Design, Limits, Problem, ResourceName
from syncline_design.choice.tolerance import (
    Measurement,
    ToleranceVerdict,
    measure_next,
    tolerance_verdict,
)
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import OutOfTime, Pieces, in_force, within_s
from syncline_design.machine.records import Json, json_of
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.edit import PinnedRole, pinned, pinned_spec_text
from syncline_design.spec.selection import RoleSelection
from syncline_design.verdict.acceptance import MOST_SIMULATED, Simulations
from syncline_design.verdict.choice_data import (
    designs_json,
    excluded_json,
    front_json,
    left_out,
    proof_json,
    unproven_json,
)
from syncline_design.verdict.open_choice import Picked, pick
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, open_verdict, unfinished_verdict, verify

SCHEMA = "syncline-design/optimization/v1"
# What stands for the tables where time ended before they were made.
NO_TABLES = Problem((), (), (), (), 0.0, 0.0, Limits(None, 1.0), "syncline", "cost")


@dataclass(frozen=True, slots=True)
class OptimizeSettings:
    """count: how many designs; pareto: the front too, of `resource` against error.

    every: rank every design, not only those that differ in a sensor.
    """

    count: int = 1
    pareto: bool = False
    resource: ResourceName = "cost"
    method: Road = "auto"
    time_limit_s: float | None = None
    seed: int = 0
    every: bool = False
    report: bool = False  # the whole verdict too, for a page


@dataclass(frozen=True, slots=True)
class Hinges:
    """What the chosen design hinges on: slack of every figure, tolerances, what to measure.

    None: not worked out within the time limit.
    """

    slack: tuple[Slack, ...] | None
    tolerance: ToleranceVerdict | None
    measure_next: tuple[Measurement, ...] | None


@dataclass(frozen=True, slots=True)
class Optimisation:
    """The best designs, or why there is none.

    picked: None when the time limit came before any design; `unfinished` says so.
    """

    case: Case
    problem: Problem
    settings: OptimizeSettings
    picked: Picked | None
    designs: tuple[Design, ...]
    front: tuple[FrontPoint, ...]
    prices: tuple[PriceStep, ...]
    hinges: Hinges | None
    explanation: Explanation | None
    cut_short: tuple[str, ...] = ()  # what the time limit left out or incomplete
    gave_up: tuple[str, ...] = ()  # what lacks designs because too many were simulated
    verdict: Verdict | None = None
    unfinished: str = ""

    @property
    def exit_code(self) -> int:
        """0: a design; 1: none; 3: the search for one was cut short."""
        if self.picked is None:
            return 3
        found = self.picked.verified
        if found is None:
            return 1
        return 0 if found.word == "meets" else 3


def optimize(case: Case, settings: OptimizeSettings) -> Optimisation:
    """The best designs of a spec; pinned roles stay as they are."""
    with within_s(settings.time_limit_s):
        return _optimize(case, settings)


def _optimize(case: Case, settings: OptimizeSettings) -> Optimisation:
    build = Simulations(settings.seed).problem_of
    simulated = any(r.kind == "monte_carlo" for r in case.spec.requirements)
    checking = CheckSettings(
        settings.seed, settings.method, monte_carlo=simulated or settings.report
    )
    problem = NO_TABLES
    try:
        problem = build(case)
        in_force().doing("choosing")
        picked = pick(
            problem,
            settings.method,
            None,
            lambda design: verify(case, problem, design, checking),
        )
    except OutOfTime as error:
        return _unfinished(case, problem, settings, checking, str(error))
    pieces, nothing = Pieces(lambda: refusals(problem)), _no_points()
    points = nothing
    if settings.pareto:
        points = pieces.made("front", lambda: front(problem, settings.resource), nothing)
    designs: tuple[Design, ...] = ()
    hinges = explanation = None
    if picked.verified is None:
        explanation = explain(case, problem, build)
    elif picked.exhausted:
        chosen = picked.verified.design
        designs = _designs(problem, chosen, settings, pieces)
        if picked.verified.word == "meets":
            hinges = _hinges((case, problem, chosen, build), pieces)
    if explanation is not None and explanation.cut_short:
        pieces.cut_short.append("reasons and remedies")
    steps = staircase([point for point in points if not point.undecided])
    found = Optimisation(
        case, problem, settings, picked, designs, points, steps, hinges,
        explanation, tuple(pieces.cut_short), tuple(pieces.gave_up),
    )  # fmt: skip
    return replace(found, verdict=_verdict(found, checking)) if settings.report else found


def _unfinished(
    case: Case,
    problem: Problem,
    settings: OptimizeSettings,
    checking: CheckSettings,
    why: str,
) -> Optimisation:
    """What there is to say when the time limit came before any design."""
    known = None if problem is NO_TABLES else problem
    verdict = unfinished_verdict(case, known, checking, why) if settings.report else None
    return Optimisation(
        case,
        problem,
        settings,
        None,
        (),
        (),
        (),
        None,
        None,
        ("choosing",),
        verdict=verdict,
        unfinished=why,
    )


def _no_points() -> tuple[FrontPoint, ...]:
    return ()


def _designs(
    problem: Problem, chosen: Design, settings: OptimizeSettings, pieces: Pieces
) -> tuple[Design, ...]:
    """The chosen design, then the next best others."""
    count = settings.count
    if count == 1:
        return (chosen,)

    def others() -> Iterator[Design]:
        return (d for d in best(problem, count + 1, every=settings.every) if d != chosen)

    return (chosen, *pieces.listed("next best designs", others)[: count - 1])


def _hinges(given: tuple[Case, Problem, Design, Build], pieces: Pieces) -> Hinges:
    return Hinges(
        pieces.made("slack ledger", lambda: slack_ledger(*given), None),
        pieces.made("tolerances", lambda: _tolerances(*given), None),
        pieces.made("what to measure next", lambda: measure_next(*given), None),
    )


def _tolerances(
    case: Case, problem: Problem, design: Design, build: Build
) -> ToleranceVerdict | None:
    """The verdict under tolerances; None where simulation is refused it."""
    try:
        return tolerance_verdict(case, problem, design, build)
    except Unfinished:
        return None


def _verdict(found: Optimisation, checking: CheckSettings) -> Verdict:
    """The verdict of the same design, for a page: nothing is chosen a second time."""
    assert found.picked is not None
    points = found.front if found.settings.pareto and found.settings.resource == "cost" else None
    return open_verdict(found.case, found.problem, found.picked, checking, points=points)


def optimisation_json(found: Optimisation) -> Json:
    """Everything as plain data; `designs` best first, `front` with --pareto."""
    case, problem = found.case, found.problem
    data: Json = {
        "schema": SCHEMA,
        "verdict": "infeasible" if found.exit_code == 1 else "meets",
        "spec": {"name": case.spec.name, "file": str(case.path)},
        "proof": _proof(found),
        "combinations": None if problem is NO_TABLES else str(problem.combinations),
        "designs": designs_json(case, problem, found.designs),
        **excluded_json(problem),
        "cut_short": list(found.cut_short),
        "gave_up": list(found.gave_up),
        "provenance": {
            "version": __version__,
            "spec_sha256": case.spec_sha256,
            "catalogs_sha256": case.catalogs_sha256,
            "files": json_of(case.files),
            "seed": found.settings.seed,
        },
    }
    if found.exit_code == 3:
        data["verdict"] = "indeterminate"
    if found.unfinished:
        data["message"] = unfinished_line(found)
    if found.settings.pareto:
        data["front"] = front_json(case, problem, found.front, found.settings.resource)
        data["front_left_out"] = left_out(case, problem, found.settings.resource)
        data["staircase"] = [step.to_json() for step in found.prices]
    if found.hinges is not None:
        hinges = found.hinges
        data["slack"] = None if hinges.slack is None else [row.to_json() for row in hinges.slack]
        data["tolerances"] = None if hinges.tolerance is None else hinges.tolerance.to_json()
        data["measure_next"] = (
            None if hinges.measure_next is None else [m.to_json() for m in hinges.measure_next]
        )
    if found.explanation is not None:
        data["infeasibility"] = found.explanation.to_json() | {"text": found.explanation.lines()}
    return data


def _proof(found: Optimisation) -> Json:
    if found.picked is None:
        return unproven_json(found.settings.method)
    return proof_json(found.picked)


def unfinished_line(found: Optimisation) -> str:
    """What is said where the time limit came before any design."""
    return f"No verdict: {found.unfinished}; no design was found by then."


def incomplete_lines(found: Optimisation) -> list[str]:
    """Which parts lack designs: by the time limit, or because simulation is bounded."""
    lines = []
    if found.cut_short and not found.unfinished:
        lines.append(f"The time limit ended this too early: {', '.join(found.cut_short)}.")
    return [*lines, gave_up_line(found.gave_up)] if found.gave_up else lines


def gave_up_line(pieces: Sequence[str]) -> str:
    """What is not complete because simulation is bounded."""
    names = ", ".join(pieces)
    return f"After {MOST_SIMULATED} simulated designs the search gave up; not complete: {names}."


def problem_size(problem: Problem) -> str:
    """How many combinations there are: plain up to a million, then as a power."""
    count = problem.combinations
    return f"{count}" if count < 1_000_000 else f"{count:.2e}"


def pinned_text(case: Case, problem: Problem, design: Design) -> str:
    """The spec with a design pinned, for `--write-design`."""
    return pinned_spec_text(case, *_pins(case, problem, design))


def pinned_case(case: Case, problem: Problem, design: Design) -> Case:
    """The case with a design pinned."""
    return pinned(case, *_pins(case, problem, design))


def _pins(case: Case, problem: Problem, design: Design) -> tuple[list[PinnedRole], dict[int, str]]:
    """Roles and, by stage, clocks of a design."""
    selected = selection_of(problem, design)
    index = {stage.choice.name: stage for stage in case.stages}
    roles = [_pinned(index[one.stage], one) for one in selected.roles]
    clocks = {
        stage.index: identity
        for stage in case.stages
        if stage.clocks and (identity := selected.clock(stage.choice.vehicle_name)) is not None
    }
    return roles, clocks


def _pinned(stage: StageCase, one: RoleSelection) -> PinnedRole:
    """What to write for one role; an error given in place stays, with its primitive if it has."""
    role = stage.role(one.role)
    assert role is not None
    if role.inline is not None:
        return PinnedRole(stage.index, one.role, one.sensor)
    return PinnedRole(stage.index, one.role, one.sensor, one.primitive, one.method)
