"""Why no design meets a spec, in the user's words: roles without options, the requirements that
cannot hold together, and the smallest single changes that help."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from syncline_design.choice.fixes import Fix, method_fixes, requirement_fixes, with_requirements
from syncline_design.choice.joint import joint_fixes
from syncline_design.choice.outcome import NoVerdict
from syncline_design.choice.parts import Part, is_feasible, lifted, parts_of
from syncline_design.choice.platform_fixes import platform_fixes
from syncline_design.choice.problem import build_problem
from syncline_design.choice.table import Problem, RoleTable, VehicleTable
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import in_force
from syncline_design.spec.case import Case

Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class RoleGap:
    """A role that no candidate can take; misses_by: tau over the tau it may have at most."""

    stage: str
    role: str
    nearest: str | None
    misses_by: float | None
    text: str

    def to_json(self) -> dict[str, Any]:
        """The entry under `roles_without_options`."""
        return {
            "stage": self.stage,
            "role": self.role,
            "nearest": self.nearest,
            "misses_by": self.misses_by,
            "text": self.text,
        }


@dataclass(frozen=True, slots=True)
class ConflictMember:
    """A requirement of the conflict; id None and no line: the implied sync limit."""

    kind: str
    id: str | None
    line: int | None

    @property
    def words(self) -> str:
        """`ACC-1 (line 4)`."""
        if self.id is None:
            return "the implied sync requirement"
        return self.id if self.line is None else f"{self.id} (line {self.line})"


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a spec is infeasible.  minimal: proven that any one of the conflict left out helps.

    further: conflicts that remain once the first is lifted; where there are any, no requirement
    alone can be moved far enough.  joint: changes that help together.  each_suffices: whether the
    spec has a design without any one requirement of the conflict.  cut_short: the time limit ended
    the search for reasons and remedies, so what is not there may still exist.
    """

    gaps: tuple[RoleGap, ...]
    conflict: tuple[ConflictMember, ...]
    minimal: bool
    fixes: tuple[Fix, ...]
    further: tuple[tuple[ConflictMember, ...], ...] = ()
    joint: tuple[tuple[Fix, ...], ...] = ()
    each_suffices: bool = False
    cut_short: bool = False

    def to_json(self) -> dict[str, Any]:
        """The value of `infeasibility`."""
        return {
            "roles_without_options": [gap.to_json() for gap in self.gaps],
            "conflict": {"requirements": _members_json(self.conflict), "minimal": self.minimal},
            "further_conflicts": [_members_json(one) for one in self.further],
            "fixes": [fix.to_json() for fix in self.fixes],
            "joint_fixes": [[fix.to_json() for fix in together] for together in self.joint],
            "cut_short": self.cut_short,
        }

    def lines(self) -> list[str]:
        """The explanation as text."""
        out = ["No design meets this spec."]
        out += [f"  {gap.text}" for gap in self.gaps]
        if self.conflict:
            out.append(f"  {_conflict_text(self.conflict, self.minimal, self.each_suffices)}")
        out += [f"  Apart from that, {_conflict_text(one, True, False)}" for one in self.further]
        if self.fixes:
            out.append("Any one of these changes makes it feasible (each solved again):")
            out += [f"  - {fix.text}" for fix in self.fixes]
        elif not self.cut_short:
            out.append("No single change of a requirement, platform or method was found to help.")
        if self.joint:
            out.append("Changes that do so together (solved again):")
            out += ["  - " + " and ".join(f.text for f in together) for together in self.joint]
        if self.cut_short:
            which = "further" if self.fixes or self.joint else "any"
            out.append(
                f"The time limit ended the search for reasons and remedies: whether {which} change "
                "would help was not worked out."
            )
        return out


def _conflict_text(members: Sequence[ConflictMember], minimal: bool, each_suffices: bool) -> str:
    names = [member.words for member in members]
    if len(names) == 1:
        return f"{names[0]} alone cannot be met by any combination of the candidates."
    if not minimal:
        return f"{_listed(names)} cannot all hold together (a smaller set was not ruled out)."
    ending = "; without any one of them a design exists" if each_suffices else ""
    return f"{_listed(names)} cannot hold together{ending}."


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _members_json(members: Sequence[ConflictMember]) -> list[dict[str, Any]]:
    return [{"id": m.id, "kind": m.kind, "line": m.line} for m in members]


def explain(case: Case, problem: Problem, build: Build = build_problem) -> Explanation:
    """Reasons and remedies for a problem that has no design.

    build: how a changed spec becomes a problem (with the known effects and simulated requirements,
    where there are any).
    """
    gaps = tuple(_gap(table, problem.limits.sync) for table in problem.roles if not table.options)
    gaps += tuple(_clock_gap(vehicle) for vehicle in problem.vehicles if not vehicle.clocks)
    conflict, minimal = _conflict(problem)
    further = _further(problem, conflict)
    moves = _proven(lambda: requirement_fixes(case, problem, build))
    fixes = [fix for together in moves if len(together) == 1 for fix in together]
    joint = tuple(together for together in moves if len(together) > 1)
    if not moves:
        joint = joint_fixes(case, problem, build)
    fixes += _proven(lambda: method_fixes(case, build, problem))
    fixes += _proven(lambda: platform_fixes(case, build))
    return Explanation(
        gaps,
        tuple(_member(case, part) for part in conflict),
        minimal,
        tuple(fixes),
        tuple(tuple(_member(case, part) for part in parts) for parts in further),
        joint,
        _each_suffices(case, problem, build, conflict),
        cut_short=in_force().is_over,  # once over, every search after it ended without an answer
    )


def _proven(source: Callable[[], Iterable[Found]]) -> list[Found]:
    """What a source finds until it can prove no more."""
    found: list[Found] = []
    with suppress(NoVerdict):  # a remedy that cannot be proven is not offered
        found.extend(source())
    return found


def _each_suffices(case: Case, problem: Problem, build: Build, conflict: Sequence[Part]) -> bool:
    """Whether the spec has a design without any one requirement of the conflict, as it would be
    written: another requirement of the kind stays, and without a sync requirement 1.0 is implied.
    """

    def helps(part: Part) -> bool:
        if part.id is None:
            return is_feasible(lifted(problem, [part]))
        rest = [one for one in case.spec.requirements if one.id != part.id]
        return is_feasible(build(with_requirements(case, rest)))

    try:
        return bool(conflict) and all(map(helps, conflict))
    except NoVerdict:
        return False


def _further(problem: Problem, first: tuple[Part, ...]) -> tuple[tuple[Part, ...], ...]:
    """Conflicts that remain, one after the other, once those before them are lifted."""
    found: list[tuple[Part, ...]] = []
    gone = list(first)
    while gone:
        rest = lifted(problem, gone)
        try:
            conflict = () if is_feasible(rest) else _conflict(rest)[0]
        except NoVerdict:
            break
        if not conflict:
            break
        found.append(conflict)
        gone += conflict
    return tuple(found)


def _gap(table: RoleTable, sync_limit: float) -> RoleGap:
    """The nearest candidate of a role without options, and by how much it misses."""
    where = f"{table.role} of {table.stage_name}"
    measured = [one for one in table.excluded if one.ratio is not None]
    if measured:
        nearest = min(measured, key=lambda one: (one.ratio or 0.0, one.sensor, one.method))
        misses = (nearest.ratio or 0.0) / sync_limit
        name = f"{nearest.sensor} stamped by {nearest.method}"
        text = f"No option for {where}: the nearest, {name}, {_excess(misses)}."
        return RoleGap(table.stage_name, table.role, name, misses, text)
    reasons = "; ".join(dict.fromkeys(one.reason for one in table.excluded))
    text = f"No option for {where}: {reasons or 'no candidates'}."
    return RoleGap(table.stage_name, table.role, None, None, text)


def _excess(misses: float) -> str:
    """How far a timestamp error is from what is allowed, in as many digits as show it."""
    if misses == 1.0:
        return "has exactly the timestamp error that its own tau_crit bids it stay below"
    shown = next(t for n in range(3, 18) if float(t := f"{misses:.{n}g}") != 1.0)
    return f"has {shown} times the timestamp error that its own tau_crit allows"


def _clock_gap(vehicle: VehicleTable) -> RoleGap:
    """Why no clock that is offered to a vehicle can work there."""
    reasons = "; ".join(one.reason for one in vehicle.excluded)
    text = f"No clock for {vehicle.name}: {reasons}."
    return RoleGap(vehicle.name, "clock", None, None, text)


def _conflict(problem: Problem) -> tuple[tuple[Part, ...], bool]:
    """A set of requirements that cannot hold together, none of which can be left out."""
    every = parts_of(problem)
    active = list(every)
    try:
        if not is_feasible(lifted(problem, active)):
            return (), False
    except NoVerdict:
        return tuple(active), False
    minimal = True
    for part in every:
        absent = [one for one in every if one not in active or one == part]
        try:
            feasible = is_feasible(lifted(problem, absent))
        except NoVerdict:
            minimal, feasible = False, True
        if not feasible:
            active.remove(part)
    return tuple(active), minimal


def _member(case: Case, part: Part) -> ConflictMember:
    line = None
    for index, requirement in enumerate(case.spec.requirements):
        if requirement.id == part.id:
            place = case.positions.get(("requirements", index))
            line = place[0] if place else None
    return ConflictMember(part.kind, part.id, line)
