"""The difference of two designs as data: what changed in verdict, payload, sums and margins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated

from syncline_design.comparison.limits import beyond
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.verdict.tree import Provenance, RequirementResult, Status, Verdict, Word

SCHEMA = "syncline-design/diff/v1"


@dataclass(frozen=True, slots=True)
class Compared(Record):
    """One of the two files, the verdict on it, and what that depends on."""

    file: str
    verdict: Word
    provenance: Provenance | None = optional()


@dataclass(frozen=True, slots=True)
class VerdictChange(Record):
    """The verdict before and now."""

    old: Word
    new: Word


@dataclass(frozen=True, slots=True)
class Pick(Record):
    """What fills a role."""

    sensor: str | None
    name: str | None
    primitive: str | None
    timestamping: str | None


@dataclass(frozen=True, slots=True)
class RoleChange(Record):
    """A role (`stage.role`) that something else fills now; None: nothing."""

    role: str
    old: Pick | None
    new: Pick | None


@dataclass(frozen=True, slots=True)
class FigureChange(Record):
    """A figure before and now, each in its own unit; no change where the units differ."""

    name: str
    unit: str
    old_unit: str
    old: float | None
    new: float | None
    change: float | None

    @property
    def units_differ(self) -> bool:
        """Whether both sides are known, in two currencies."""
        return self.unit != self.old_unit and None not in (self.old, self.new)


@dataclass(frozen=True, slots=True)
class Standing(Record):
    """How one side stands to a requirement.

    quantile: of a simulated one; axis: of the error that is limited; waived: true where a waiver
    in force covers it.
    """

    status: Status
    value: float | None
    limit: float
    margin: float | None
    unit: str
    line: int | None
    column: int | None
    quantile: float | None = optional()
    axis: str | None = optional()
    waived: bool | None = optional()
    limit_written: str | None = optional()


@dataclass(frozen=True, slots=True)
class RequirementChange(Record):
    """A requirement before and now; None: not required.  mission: where it is one mission's."""

    id: str
    kind: str
    unit: str
    old: Standing | None
    new: Standing | None
    mission: str | None = optional()


@dataclass(frozen=True, slots=True)
class VerdictChanges(Record):
    """What differs between two verdicts.

    outgrown, admitted: where the payload is another one, requirements whose value the old payload
    had is above the limit of now; whose value the new one has is above the limit before.
    missions: the same as requirements for each mission of either side, by their names.
    """

    verdict: VerdictChange
    currency: str
    payload: tuple[RoleChange, ...]
    sums: tuple[FigureChange, ...]  # cost, mass, power
    error: FigureChange
    requirements: tuple[RequirementChange, ...]
    outgrown: tuple[str, ...] | None = optional()
    admitted: tuple[str, ...] | None = optional()
    missions: tuple[RequirementChange, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Cause(Record):
    """One thing that the files say differently; None: not there.

    effect: what this change alone does to the old spec, where it was tried.
    """

    key: str
    old: str | None
    new: str | None
    effect: VerdictChanges | None = None


@dataclass(frozen=True, slots=True)
class Diff(Record):
    """The difference of two specs or verdict files; exit_code: that of the new one."""

    schema: Annotated[str, SchemaName(SCHEMA)]
    old: Compared
    new: Compared
    causes: tuple[Cause, ...]
    verdict: VerdictChange
    currency: str
    payload: tuple[RoleChange, ...]
    sums: tuple[FigureChange, ...]
    error: FigureChange
    requirements: tuple[RequirementChange, ...]
    exit_code: int
    outgrown: tuple[str, ...] | None = optional()
    admitted: tuple[str, ...] | None = optional()
    missions: tuple[RequirementChange, ...] | None = optional()


def diff_of(
    sides: tuple[Compared, Compared],
    causes: tuple[Cause, ...],
    found: VerdictChanges,
    exit_code: int,
) -> Diff:
    """The whole of it from its parts."""
    return Diff(
        SCHEMA, *sides, causes,
        found.verdict, found.currency, found.payload, found.sums, found.error,
        found.requirements, exit_code, found.outgrown, found.admitted, found.missions,
    )  # fmt: skip


def changes(old: Verdict, new: Verdict) -> VerdictChanges:
    """Verdict, payload, sums, error and margins of two verdicts, side by side."""
    before, now = _sums(old), _sums(new)
    payload = tuple(_payload(old, new))
    return VerdictChanges(
        VerdictChange(old.verdict, new.verdict),
        new.spec.currency,
        payload,
        tuple(_figure(name, before[name], now[name]) for name in before),
        _figure("error", (_total(old), "m"), (_total(new), "m")),
        tuple(_requirements(old.requirements, new.requirements)),
        (tuple(beyond(old, new)) if payload else ()) or None,
        (tuple(beyond(new, old)) if payload else ()) or None,
        tuple(_by_mission(old, new)) or None,
    )


Amount = tuple[float | None, str]  # with its unit


def _sums(verdict: Verdict) -> dict[str, Amount]:
    units = {"cost": verdict.spec.currency, "mass": "kg", "power": "W"}
    return {name: (getattr(verdict.design, name, None), unit) for name, unit in units.items()}


def _total(verdict: Verdict) -> float | None:
    return None if verdict.syncline is None else verdict.syncline.total_m


def _figure(name: str, old: Amount, new: Amount) -> FigureChange:
    """Both sides in their own units; amounts in different currencies have no difference."""
    (before, old_unit), (now, unit) = old, new
    change = None if before is None or now is None or old_unit != unit else now - before
    return FigureChange(name, unit, old_unit, before, now, change)


def _payload(old: Verdict, new: Verdict) -> Iterator[RoleChange]:
    """Roles whose sensor or timestamping is another one."""
    before, after = _picks(old), _picks(new)
    for role in dict.fromkeys((*before, *after)):
        one, other = before.get(role), after.get(role)
        if one != other:
            yield RoleChange(role, one, other)


def _picks(verdict: Verdict) -> dict[str, Pick]:
    return {
        f"{stage.name}.{role}": Pick(one.sensor, one.name, one.primitive, one.timestamping)
        for stage, role, one in (verdict.design.roles if verdict.design is not None else ())
    }


def _by_mission(old: Verdict, new: Verdict) -> Iterator[RequirementChange]:
    """Requirements of every mission that one side has, the old one's order first."""
    before, after = (
        {one.name: one.requirements for one in verdict.missions or ()} for verdict in (old, new)
    )
    for name in dict.fromkeys((*before, *after)):
        for row in _requirements(before.get(name, ()), after.get(name, ())):
            yield replace(row, mission=name)


def _requirements(
    old: Sequence[RequirementResult], new: Sequence[RequirementResult]
) -> Iterator[RequirementChange]:
    before = {row.id: row for row in old}
    after = {row.id: row for row in new}
    for identity, either in {**before, **after}.items():
        one, other = before.get(identity), after.get(identity)
        yield RequirementChange(
            identity, either.kind, either.unit, _standing(one), _standing(other)
        )


def _standing(row: RequirementResult | None) -> Standing | None:
    if row is None:
        return None
    return Standing(
        row.status, row.value, row.limit, row.margin, row.unit, row.line, row.column,
        row.quantile, row.axis, row.is_waived or None, row.limit_written,
    )  # fmt: skip
