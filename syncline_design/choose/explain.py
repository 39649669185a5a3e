"""Why no design meets a spec, in the user's words: roles without options, the requirements that
cannot hold together, and the smallest single changes that help."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from syncline_design.choose.fixes import (
    Fix,
    is_feasible,
    method_fixes,
    platform_fixes,
    requirement_fixes,
)
from syncline_design.choose.joint import joint_fixes
from syncline_design.choose.outcome import NoVerdict
from syncline_design.choose.variations import Build
from syncline_design.design_space import Limits, Problem, RoleTable, with_limits
from syncline_design.loading import LoadedSpec
from syncline_design.problem import build_problem

KINDS = ("accuracy", "sync", "cost", "mass", "power")


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

    further: conflicts that remain once the first is lifted; where there are any, no single change
    helps and `joint` holds changes that help together.  simulated: ids of Monte Carlo requirements,
    which a changed spec still has to meet.
    """

    gaps: tuple[RoleGap, ...]
    conflict: tuple[ConflictMember, ...]
    minimal: bool
    fixes: tuple[Fix, ...]
    further: tuple[tuple[ConflictMember, ...], ...] = ()
    joint: tuple[tuple[Fix, ...], ...] = ()
    simulated: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The value of `infeasibility`."""
        return {
            "roles_without_options": [gap.to_json() for gap in self.gaps],
            "conflict": {"requirements": _members_json(self.conflict), "minimal": self.minimal},
            "further_conflicts": [_members_json(one) for one in self.further],
            "fixes": [fix.to_json() for fix in self.fixes],
            "joint_fixes": [[fix.to_json() for fix in together] for together in self.joint],
        }

    def lines(self) -> list[str]:
        """The explanation as text."""
        out = ["No design meets this spec."]
        out += [f"  {gap.text}" for gap in self.gaps]
        if self.conflict:
            out.append(f"  {_conflict_text(self.conflict, self.minimal, bool(self.further))}")
        out += [f"  Apart from that, {_conflict_text(one, True, True)}" for one in self.further]
        if self.fixes:
            out.append("Any one of these changes makes it feasible (each solved again):")
            out += [f"  - {fix.text}" for fix in self.fixes]
        else:
            out.append("No single change of a requirement, platform or method makes it feasible.")
        if self.joint:
            out.append("Changes that do so together (solved again):")
            out += ["  - " + " and ".join(f.text for f in together) for together in self.joint]
        if self.simulated and (self.fixes or self.joint):
            out.append(f"Then {_listed(self.simulated)} has still to be met by simulation.")
        return out


def _conflict_text(members: Sequence[ConflictMember], minimal: bool, more: bool) -> str:
    names = [member.words for member in members]
    if len(names) == 1:
        return f"{names[0]} alone cannot be met by any combination of the candidates."
    if not minimal:
        return f"{_listed(names)} cannot all hold together (a smaller set was not ruled out)."
    ending = "" if more else "; without any one of them a design exists"
    return f"{_listed(names)} cannot hold together{ending}."


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _members_json(members: Sequence[ConflictMember]) -> list[dict[str, Any]]:
    return [{"id": m.id, "kind": m.kind, "line": m.line} for m in members]


def explain(loaded: LoadedSpec, problem: Problem, build: Build = build_problem) -> Explanation:
    """Reasons and remedies for a problem that has no design.

    build: how a changed spec becomes a problem (with the known effects, where there are any).
    """
    gaps = tuple(_gap(table, problem.limits.sync) for table in problem.roles if not table.options)
    conflict, minimal = _conflict(problem)
    further = _further(problem, conflict)
    members, *others = (
        tuple(_member(loaded, problem, kind) for kind in kinds)
        for kind_sets in ((conflict,), further)
        for kinds in kind_sets
    )
    fixes: list[Fix] = []
    sources: tuple[Callable[[], Any], ...] = (
        lambda: requirement_fixes(loaded, problem),
        lambda: method_fixes(loaded, build, problem),
        lambda: platform_fixes(loaded, build),
    )
    for source in sources:
        try:
            fixes += source()
        except NoVerdict:  # a remedy that cannot be proven is not offered
            continue
    joint = joint_fixes(loaded, problem, (conflict, *further)) if further and not fixes else ()
    simulated = tuple(r.id for r in loaded.spec.requirements if r.kind == "monte_carlo")
    return Explanation(gaps, members, minimal, tuple(fixes), tuple(others), joint, simulated)


def _further(problem: Problem, first: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Conflicts that remain, one after the other, once those before them are lifted."""
    found: list[tuple[str, ...]] = []
    lifted = list(first)
    while lifted:
        rest = with_limits(problem, _without(problem.limits, lifted))
        try:
            conflict = () if is_feasible(rest) else _conflict(rest)[0]
        except NoVerdict:
            break
        if not conflict:
            break
        found.append(conflict)
        lifted += conflict
    return tuple(found)


def _gap(table: RoleTable, sync_limit: float) -> RoleGap:
    """The nearest candidate of a role without options, and by how much it misses."""
    where = f"{table.role} of {table.stage_name}"
    measured = [one for one in table.excluded if one.ratio is not None]
    if measured:
        nearest = min(measured, key=lambda one: (one.ratio or 0.0, one.sensor, one.method))
        misses = (nearest.ratio or 0.0) / sync_limit
        name = f"{nearest.sensor} stamped by {nearest.method}"
        text = (
            f"No option for {where}: the nearest, {name}, has {misses:.3g} times the timestamp "
            "error that its own tau_crit allows."
        )
        return RoleGap(table.stage_name, table.role, name, misses, text)
    reasons = "; ".join(dict.fromkeys(one.reason for one in table.excluded))
    text = f"No option for {where}: {reasons or 'no candidates'}."
    return RoleGap(table.stage_name, table.role, None, None, text)


def _conflict(problem: Problem) -> tuple[tuple[str, ...], bool]:
    """A set of requirement kinds that cannot hold together, none of which can be left out."""
    active = [kind for kind in KINDS if _is_active(problem.limits, kind)]
    try:
        if not is_feasible(with_limits(problem, _without(problem.limits, active))):
            return (), False
    except NoVerdict:
        return tuple(active), False
    minimal = True
    for kind in list(active):
        absent = [k for k in KINDS if k not in active or k == kind]
        try:
            feasible = is_feasible(with_limits(problem, _without(problem.limits, absent)))
        except NoVerdict:
            minimal, feasible = False, True
        if not feasible:
            active.remove(kind)
    return tuple(active), minimal


def _is_active(limits: Limits, kind: str) -> bool:
    if kind == "sync":
        return math.isfinite(limits.sync)
    return (limits.accuracy_m if kind == "accuracy" else getattr(limits, kind)) is not None


def _without(limits: Limits, kinds: list[str]) -> Limits:
    """Limits with some kinds lifted."""
    changes: dict[str, Any] = {}
    for kind in kinds:
        if kind == "sync":
            changes["sync"] = math.inf
        else:
            changes["accuracy_m" if kind == "accuracy" else kind] = None
    return replace(limits, **changes)


def _member(loaded: LoadedSpec, problem: Problem, kind: str) -> ConflictMember:
    name = dict(problem.limits.ids).get(kind)
    line = None
    for index, requirement in enumerate(loaded.spec.requirements):
        if requirement.id == name:
            place = loaded.positions.get(("requirements", index))
            line = place[0] if place else None
    return ConflictMember(kind, name, line)
