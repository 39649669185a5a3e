"""What audited stamps mean for a spec: each stream against the tau_crit of the role it plays.

The residual of a stream is an upper bound of its stamps' error where they were taken on arrival.
Where the design stamps in hardware, receipts say nothing of the stamps' error, so no metres follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final, cast

from syncline_design.auditing.result import Audit, AuditedFor, StreamAudit
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case
from syncline_design.spec.edit import with_timestamping_text
from syncline_design.verdict.named import NamedRole
from syncline_design.verdict.pinned import as_measured
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import check_loaded

ARRIVAL: Final = "arrival"
_ON_ARRIVAL: Final = ("stamped_on_arrival", "packetised")
# words in names of streams that nothing else plays, by role
_WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "position": ("position", "gnss", "gps", "fix", "navsat", "rtk", "pose"),
    "attitude": ("attitude", "imu", "ahrs", "ins", "mru", "heading", "orientation"),
    "ranging": ("ranging", "lidar", "points", "scan", "usbl", "mbes", "sonar", "radar", "cloud"),
}
_IS: Final = ("is", "are")


@dataclass(frozen=True, slots=True)
class Played:
    """A role of the spec's design and the stream that plays it."""

    stage: str
    role: str
    row: NamedRole
    why: str

    @property
    def label(self) -> str:
        return f"{self.stage}.{self.role}"


def held_against(audit: Audit, case: Case, seed: int) -> Audit:
    """The audit with tau_crit, and metres where the stamps are arrivals."""
    verdict = check_loaded(as_measured(case, seed), CheckSettings(seed=seed))
    played = _played(audit, case, verdict)
    rows = tuple(_held(row, played.get(k)) for k, row in enumerate(audit.streams))
    notes = [*audit.notes, *_undecided(audit, case, verdict, played)]
    if not played and len(notes) == len(audit.notes):
        notes.append("no stream plays a role of the spec by its name or quantity: say which in "
                     "the spec, `log: {streams: {position: NAME, attitude: NAME}}`")  # fmt: skip
    spec = AuditedFor(verdict.name, verdict.file, case.spec_sha256, case.catalogs_sha256, seed)
    return replace(audit, streams=rows, notes=tuple(notes), spec=spec)


def _roles(verdict: Verdict) -> Iterator[tuple[str, str, NamedRole]]:
    stages = verdict.design.stages if verdict.design is not None else ()
    for stage in stages:
        for role, row in stage.roles.items():
            yield stage.name, role, row


def _played(audit: Audit, case: Case, verdict: Verdict) -> dict[int, Played]:
    """Place of each stream that plays a role: as the spec's `log:` says, else by its name."""
    said = _said(case)
    taken: dict[int, Played] = {}
    for stage, role, row in _roles(verdict):
        place, why = _stream_of(audit, stage, role, row, said, taken)
        if place is not None:
            taken[place] = Played(stage, role, row, why)
    return taken


def _undecided(
    audit: Audit, case: Case, verdict: Verdict, played: Mapping[int, Played]
) -> Iterator[str]:  # fmt: skip
    """Roles that several streams could play, none of them more than the others."""
    said = _said(case)
    free = [row.name for k, row in enumerate(audit.streams) if k not in played]
    for stage, role, _ in _roles(verdict):
        named = [name for name in free if _has_word(name, _WORDS[role])]
        if (
            role not in said
            and f"{stage}.{role}" not in {p.label for p in played.values()}
            and named
        ):
            yield (f"{', '.join(named)}: each may be {stage}.{role}, and none was taken as it: say "
                   f"which in the spec, `log: {{streams: {{{role}: NAME}}}}`")  # fmt: skip


def _said(case: Case) -> dict[str, str]:
    """`log: {streams: {position: NAME}}`."""
    block = getattr(case.spec.log, "streams", None)
    names = ("position", "attitude", "ranging")
    return {r: str(n) for r in names if (n := getattr(block, r, None))} if block is not None else {}


def _stream_of(
    audit: Audit, stage: str, role: str, row: NamedRole, said: Mapping[str, str],
    taken: Mapping[int, Played],
) -> tuple[int | None, str]:  # fmt: skip
    free = [k for k, one in enumerate(audit.streams) if k not in taken]
    if role in said:
        named = [k for k in free if audit.streams[k].name == said[role]]
        return (named[0] if named else None), "as the spec's `log: streams` says"
    exact = [k for k in free if _has_word(audit.streams[k].name, (row.sensor, f"{stage}_{role}"))]
    own = [k for k in free if _has_word(audit.streams[k].name, (role,))]
    by_word = [k for k in free if _has_word(audit.streams[k].name, _WORDS[role])]
    kinds = [k for k in free if role in audit.streams[k].quantity]
    for found, why in (
        (exact, "by its name"),
        (own, "by its name"),
        (by_word, "by its name"),
        (kinds, "by its quantity"),
    ):
        if len(found) == 1:
            return found[0], why
    return None, ""


def _has_word(name: str, words: tuple[str, ...]) -> bool:
    lower = name.lower()
    return any(re.search(rf"(?<![a-z]){re.escape(word)}(?![a-z])", lower) for word in words)


def _held(row: StreamAudit, played: Played | None) -> StreamAudit:
    if played is None:
        return row
    critical = played.row.tau_crit_s
    late = any(f.fault in _ON_ARRIVAL for f in row.faults)
    hardware = played.row.primitive != ARRIVAL and not late
    size = row.residual_s.as_recorded if late else row.residual_s.bound
    error = None
    if size is not None and not hardware:
        error = 0.0 if critical is None else size * played.row.sensor_error_m / critical
    notes = [*row.notes, f"taken as {played.label} {played.why}"]
    open_ = list(row.cannot_show)
    if hardware:
        open_.append(f"its error in metres: the spec stamps {played.label} in hardware "
                     f"({played.row.primitive}, {played.row.timestamping}), receipts then show "
                     "transport alone")  # fmt: skip
    return replace(row, tau_crit_s=critical, error_m=error, role=played.label, notes=tuple(notes),
                   cannot_show=tuple(open_))  # fmt: skip


def spec_with_residuals(audit: Audit, case: Case) -> str | None:
    """The spec with each residual as its role's timestamp error; None where there is none.

    Roles that are stamped in hardware keep theirs (`keeping_theirs`).  A stamp on arrival is late:
    the measurement was valid at t + mu, mu in [-bound, 0].
    """
    errors: list[tuple[int, RoleName, float, str]] = []
    for row in audit.streams:
        bound = row.residual_s.bound
        if row.role is None or bound is None or row.error_m is None:
            continue
        stage, _, role = row.role.rpartition(".")
        index = next(k for k, one in enumerate(case.spec.stages) if one.name == stage)
        errors.append((index, cast(RoleName, role), bound, _mended(row)))
    if not errors:
        return None
    return with_timestamping_text(case, errors)


def keeping_theirs(audit: Audit) -> tuple[str, ...]:
    """Roles whose stamps receipts say nothing of, as the design takes them in hardware."""
    rows = (row for row in audit.streams if row.residual_s.bound is not None)
    return tuple(row.role for row in rows if row.role is not None and row.error_m is None)


def _mended(row: StreamAudit) -> str:
    """The stream, and what has to be mended before its residual is all that it has."""
    names = dict.fromkeys(f.fault for f in row.faults if f.counts and f.fault not in _ON_ARRIVAL)
    return f"{row.name} once {', '.join(names)} {_IS[len(names) > 1]} mended" if names else row.name
