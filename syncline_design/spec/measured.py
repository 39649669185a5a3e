"""What an error in a catalog says of its measurement: bound, claim, evidence, conditions, events.

`timing` writes these keys; an entry that has them is shown as measured.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, Field, model_validator

from syncline_design.model.figure_text import percent
from syncline_design.spec.fields import (
    Count,
    FileRecord,
    NonEmptyText,
    NonNegativeTime,
    PositiveTime,
    ReadBy,
    kind_of,
    refusal,
    refusals,
)

ALTERED: Final = (
    "its figures are not those that were written from its logs (its digest does not fit them): "
    "measure again with timing --as, or take claim, evidence and digest out"
)
Seal = Literal["fits", "differs", "none"]
# keys that are no figure of a measurement: the digest itself, where values and logs lie, words
_NO_FIGURE: Final = frozenset({"digest", "file", "conditions"})
_THINNED: Final = 0.02  # what quantiles in a file leave out of the share that they stand for
_SHA256: Final = re.compile(r"[0-9a-f]{64}")


def _read_sha256(value: Any) -> str:
    if not isinstance(value, str) or not _SHA256.fullmatch(value):
        raise refusal("not a SHA-256", "64 digits 0-9 a-f", kind_of(value))
    return value


Sha256 = Annotated[str, ReadBy(_read_sha256, {"type": "string", "pattern": "^[0-9a-f]{64}$"})]
Share = Annotated[float, Field(gt=0.0, lt=1.0)]


class MeasuredClaim(FileRecord):
    """With `confidence`, a `session_share` of sessions of this length keep the error within
    `bound` for a share `coverage` of their time.

    rests_on: servo (its own offsets, which it nulls), independent, or with declared terms.
    reservations: what kept the logs from bearing the bound out, as `timing` said.
    """

    coverage: Share
    session_share: Share | None = None
    confidence: Share | None = None
    sessions: Count | None = None
    hours: Annotated[float, Field(ge=0.0)] | None = None
    session_length: PositiveTime | None = None
    rests_on: NonEmptyText | None = None
    declared: dict[NonEmptyText, NonNegativeTime] = Field(default_factory=dict)
    made: bool | None = None
    needs_sessions: Annotated[int, Field(ge=0)] | None = None
    reservations: tuple[NonEmptyText, ...] = ()

    @property
    def session_s(self) -> float | None:
        """Length of a session [s] that the claim is bound to; the mean one where only sums are."""
        if self.session_length is not None:
            return float(self.session_length)
        if self.sessions is None or self.hours is None:
            return None
        return 3600.0 * float(self.hours) / self.sessions


class MeasuredLog(FileRecord):
    """A log that the figures rest on."""

    file: NonEmptyText
    sha256: Sha256


class MeasuredEvent(FileRecord):
    """What was no steady state: how often and how large, or one event with its time."""

    kind: NonEmptyText
    count: Count | None = None
    largest: NonNegativeTime | None = None
    size: NonNegativeTime | None = None
    size_s: Annotated[float, Field(ge=0.0)] | None = None
    from_: Annotated[str | float | None, Field(alias="from")] = None
    to: str | float | None = None


class MeasuredKeys(FileRecord):
    """Keys of an error that was measured; `bound` replaces the distribution's own as tau.

    event_bound: how far off it was, or may have been, in slow starts, steps and without lock.

    digest: of the figures as `timing` wrote them, so that one that was changed since is told.  It
    is a seal against slips and not against forgery: whoever can write the file can make it anew.
    """

    bound: NonNegativeTime | None = None
    event_bound: NonNegativeTime | None = None
    claim: MeasuredClaim | None = None
    evidence: tuple[MeasuredLog, ...] = ()
    conditions: str | None = None
    events: tuple[MeasuredEvent, ...] = ()
    digest: Sha256 | None = None

    @property
    def figures_sha256(self) -> str:
        """SHA-256 of every figure in SI: distribution with its values, bound, claim, evidence and
        events.  The same figure in another unit, and keys in another order, are the same."""
        figures = json.dumps(_plain(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(figures.encode()).hexdigest()

    @property
    def seal(self) -> Seal:
        """Whether the figures are those that were measured, as far as the entry can say."""
        if self.digest is None:
            return "none"
        return "fits" if self.digest == self.figures_sha256 else "differs"

    @property
    def why_not_measured(self) -> str:
        """Why figures that are said to be measured are not taken so; "" where they are.

        A bound that holds for a share of every session holds for as much of all values together.
        """
        if self.seal == "differs":
            return ALTERED
        values = getattr(self, "values", None)
        if not values or self.bound is None or self.claim is None:
            return ""
        within = sum(abs(one) <= self.bound for one in values) / len(values)
        if within >= self.claim.coverage - _THINNED:
            return ""
        return (f"{percent(within, 3)} of its own values lie within its bound, where its claim is "
                f"of {percent(self.claim.coverage, 4)} of the time: measure again with timing --as"
                )  # fmt: skip

    @property
    def is_measured(self) -> bool:
        """Whether the entry names a claim or the logs it rests on."""
        return self.claim is not None or bool(self.evidence)

    @model_validator(mode="after")
    def _one_bound(self) -> MeasuredKeys:
        if self.bound is not None and getattr(self, "calibrated", None) is not None:
            raise refusals(
                [(("bound",), refusal("beside calibrated", "one of them", hint="delete one"))]
            )
        return self


def _plain(value: Any) -> Any:
    """Figures as JSON has them; keys that say nothing are none, so that later ones change none."""
    if isinstance(value, BaseModel):
        told = ((name, getattr(value, name)) for name in type(value).model_fields)
        return {
            name: _plain(one)
            for name, one in told
            if name not in _NO_FIGURE and one is not None and one not in ((), {})
        }
    if isinstance(value, dict):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    return float(value) if isinstance(value, float) else value


def changed_logs(error: MeasuredKeys, folder: Path) -> Iterator[str]:
    """Logs that are where the entry names them, seen from its folder, with another content."""
    for log in error.evidence:
        path = folder / log.file
        try:
            if not path.is_file():  # never wait for a pipe, nor read a device to its end
                continue
            with path.open("rb") as stream:
                found = hashlib.file_digest(stream, "sha256").hexdigest()
        except (OSError, ValueError):  # not there any more, or never
            continue
        if found != log.sha256:
            yield log.file
