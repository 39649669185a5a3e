"""Spec to verdict: choose what is open, recheck exactly, cross-check by Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from syncline_design.choice.judged import refusals
from syncline_design.choice.problem import sole_design
from syncline_design.choice.table import Problem
from syncline_design.machine.deadline import OutOfTime, Pieces
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, load
from syncline_design.spec.references import names_candidates
from syncline_design.spec.requirement import JUDGED_KINDS, STATED_KINDS
from syncline_design.verdict.acceptance import MOST_SIMULATED
from syncline_design.verdict.cautions import unproven
from syncline_design.verdict.choice_data import choice_of, left_out_text, without_choice
from syncline_design.verdict.cloud import cloud
from syncline_design.verdict.design_data import sensor_names
from syncline_design.verdict.no_design import infeasible_verdict, unfinished_verdict
from syncline_design.verdict.one_design import verdict_on, verify
from syncline_design.verdict.open_choice import Picked, chosen_of, pick
from syncline_design.verdict.scenarios import is_family
from syncline_design.verdict.settings import CheckSettings, build_of
from syncline_design.verdict.tree import (
    Caution,
    Checked,
    Refused,
    Verdict,
)
from syncline_design.verdict.verified import refused

if TYPE_CHECKING:
    from syncline_design.choice.outcome import FrontPoint
    from syncline_design.choice.variations import Build

T = TypeVar("T")


def check_files(paths: Sequence[Path], settings: CheckSettings) -> list[Checked]:
    """Verdicts of specs, in the order given; a refused file stands among them as such.

    Of a refused file nothing is computed.  A time limit binds all of them together.
    """
    read = [_or_refused(path, load) for path in paths]  # all before anything is computed
    return [_check_or_refuse(item, settings) for item in read]


def _check_or_refuse(read: Case | Refused, settings: CheckSettings) -> Checked:
    if isinstance(read, Refused):
        return read
    return _or_refused(read.path, lambda _: check_loaded(read, settings))


def _or_refused(path: Path, work: Callable[[Path], T]) -> T | Refused:
    try:
        return work(path)
    except BadInput as error:
        return refused(str(path), error)


def check_loaded(case: Case, settings: CheckSettings) -> Verdict:
    """The verdict of a loaded spec; without any design when the time is over, indeterminate."""
    if is_family(case):
        from syncline_design.verdict.missions import check_family  # 23 ms, for families alone

        return check_family(case, settings)
    build = build_of(settings)
    problem: Problem | None = None
    try:
        problem = build(case)
        if sole_design(problem) is not None:
            return _sole_verdict(case, problem, settings, build)
        return _check_open(case, problem, settings, build)
    except OutOfTime as error:
        return unfinished_verdict(case, problem, settings, str(error))


def _sole_verdict(case: Case, problem: Problem, settings: CheckSettings, build: Build) -> Verdict:
    """The verdict on the only design that a spec leaves.

    Where the spec names candidates, that no design meets it is said as for any number of designs.
    """
    sole = sole_design(problem)
    assert sole is not None
    everything, design = sole
    verified = verify(case, everything, design, settings)
    if verified.word == "fails" and names_candidates(case):
        return infeasible_verdict(case, problem, settings, build)
    return verdict_on(case, everything, verified, settings, without_choice(problem))


def _check_open(case: Case, problem: Problem, settings: CheckSettings, build: Build) -> Verdict:
    """Choose, then verify; without any design say why and what would help."""
    builds = (build, lambda: build_of(settings))
    chosen = chosen_of(case, problem, builds, settings.road, settings.day)
    return open_verdict(pick(chosen, settings), settings)


def open_verdict(
    picked: Picked, settings: CheckSettings, points: Sequence[FrontPoint] | None = None
) -> Verdict:
    """The verdict on what was picked for a spec; points: its front of cost, where known."""
    case, problem, build = picked.chosen.case, picked.chosen.problem, picked.chosen.build
    if sole_design(problem) is not None:
        return _sole_verdict(case, problem, settings, build)
    if picked.verified is None:
        return infeasible_verdict(case, problem, settings, build)
    pieces = Pieces(lambda: refusals(problem))
    choice = choice_of(
        case, problem, picked, pieces, points,
        pictured=settings.cloud, others=settings.others, brief=settings.brief,
    )  # fmt: skip
    if settings.cloud:
        names = sensor_names(case, problem)
        around = pieces.listed("cloud", lambda: cloud(problem, choice.front or (), names))
        choice = replace(choice, cloud=tuple(around))
    found = verdict_on(case, problem, picked.verified, settings, choice)
    missing = choice.front_left_out
    warnings = (
        *_passed_over(picked),
        *unproven(picked.choice.proof),
        *(Caution(code, message) for code, message in pieces.cautions),
        *found.warnings,
        *([Caution("unpriced", left_out_text(missing, "cost"))] if missing else ()),
    )
    is_open = picked.verified.word != "meets" and not picked.exhausted
    return replace(found, verdict="indeterminate" if is_open else found.verdict, warnings=warnings)


def _passed_over(picked: Picked) -> Iterator[Caution]:
    passed_over = picked.choice.proof.passed_over
    if not passed_over:
        return
    count = f"{passed_over} design{'s' if passed_over > 1 else ''}"
    rows = () if picked.verified is None else picked.verified.requirements
    stated = [row.id for row in rows if row.kind in STATED_KINDS]
    judged = [row.id for row in rows if row.kind in JUDGED_KINDS]
    limits = f"the limits of {', '.join(judged)}" if stated else "the Monte Carlo limits"
    message = f"{count} that come before this one keep every sum but not {limits}"
    if not picked.exhausted:
        message = (
            f"{count} keep every sum but not {limits}; shown is the first; the "
            f"search stopped after {MOST_SIMULATED} simulated designs"
        )
    yield Caution("passed-over", message)
