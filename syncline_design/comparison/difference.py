"""The difference of two designs as data: what changed in verdict, payload, sums and margins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from syncline_design.machine.records import Record

Json = Mapping[str, Any]
SCHEMA = "syncline-design/diff/v1"


@dataclass(frozen=True, slots=True)
class Compared(Record):
    """One of the two files, and the verdict on it."""

    file: str
    verdict: str


@dataclass(frozen=True, slots=True)
class VerdictChange(Record):
    """The verdict before and now."""

    old: str
    new: str


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
    """How one side stands to a requirement."""

    status: str | None
    value: float | None
    limit: float | None
    margin: float | None
    unit: str | None
    line: int | None
    column: int | None


@dataclass(frozen=True, slots=True)
class RequirementChange(Record):
    """A requirement before and now; None: not required."""

    id: str
    kind: str | None
    unit: str | None
    old: Standing | None
    new: Standing | None


@dataclass(frozen=True, slots=True)
class Changes(Record):
    """What differs between two verdicts."""

    verdict: VerdictChange
    currency: str
    payload: tuple[RoleChange, ...]
    sums: tuple[FigureChange, ...]  # cost, mass, power
    error: FigureChange
    requirements: tuple[RequirementChange, ...]


@dataclass(frozen=True, slots=True)
class Cause(Record):
    """One thing that the files say differently; None: not there.

    effect: what this change alone does to the old spec, where it was tried.
    """

    key: str
    old: str | None
    new: str | None
    effect: Changes | None = None


@dataclass(frozen=True, slots=True)
class Difference(Record):
    """The difference of two specs or verdict files; exit_code: that of the new one."""

    schema: str
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


def difference(
    files: tuple[str, str], causes: tuple[Cause, ...], found: Changes, exit_code: int
) -> Difference:
    """The whole of it from its parts."""
    old, new = files
    return Difference(
        SCHEMA, Compared(old, found.verdict.old), Compared(new, found.verdict.new), causes,
        found.verdict, found.currency, found.payload, found.sums, found.error,
        found.requirements, exit_code,
    )  # fmt: skip


def changes(old: Json, new: Json) -> Changes:
    """Verdict, payload, sums, error and margins of two verdicts, side by side."""
    currency = _currency(new)
    sums = (("cost", (_currency(old), currency)), ("mass", ("kg", "kg")), ("power", ("W", "W")))
    return Changes(
        VerdictChange(old["verdict"], new["verdict"]),
        currency,
        tuple(_payload(old, new)),
        tuple(_figure(name, units, _design(old, name), _design(new, name)) for name, units in sums),
        _figure("error", ("m", "m"), _total(old), _total(new)),
        tuple(_requirements(old, new)),
    )


def _currency(verdict: Json) -> str:
    design, spec = verdict.get("design") or {}, verdict.get("spec") or {}
    return str(design.get("currency") or spec.get("currency") or "EUR")


def _design(verdict: Json, key: str) -> float | None:
    value = (verdict.get("design") or {}).get(key)
    return float(value) if isinstance(value, int | float) else None


def _total(verdict: Json) -> float | None:
    value = (verdict.get("syncline") or {}).get("total_m")
    return float(value) if isinstance(value, int | float) else None


def _figure(
    name: str, units: tuple[str, str], old: float | None, new: float | None
) -> FigureChange:
    """Both sides in their own units; amounts in different currencies have no difference."""
    before, unit = units
    change = None if old is None or new is None or before != unit else new - old
    return FigureChange(name, unit, before, old, new, change)


def _payload(old: Json, new: Json) -> Iterator[RoleChange]:
    """Roles whose sensor or timestamping is another one."""
    before, after = _picks(old), _picks(new)
    for role in dict.fromkeys((*before, *after)):
        one, other = before.get(role), after.get(role)
        if one != other:
            yield RoleChange(role, one, other)


def _picks(verdict: Json) -> dict[str, Pick]:
    stages = (verdict.get("design") or {}).get("stages") or ()
    return {
        f"{stage['name']}.{role}": Pick(
            entry.get("sensor"), entry.get("name"), entry.get("primitive"),
            entry.get("timestamping"),
        )
        for stage in stages
        for role, entry in stage["roles"].items()
        if entry is not None
    }  # fmt: skip


def _requirements(old: Json, new: Json) -> Iterator[RequirementChange]:
    before = {row["id"]: row for row in old["requirements"]}
    after = {row["id"]: row for row in new["requirements"]}
    for identity in dict.fromkeys((*before, *after)):
        one, other = before.get(identity), after.get(identity)
        either = other or one or {}
        yield RequirementChange(
            identity, either.get("kind"), either.get("unit"), _standing(one), _standing(other)
        )


def _standing(row: Json | None) -> Standing | None:
    if row is None:
        return None
    return Standing(
        row.get("status"), row.get("value"), row.get("limit"), row.get("margin"),
        row.get("unit"), row.get("line"), row.get("column"),
    )  # fmt: skip
