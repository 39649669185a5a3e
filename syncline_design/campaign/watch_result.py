"""What `watch` says: typed, and written as JSON (schema syncline-design/watch/v1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, Literal

from syncline_design.diagnosis.result import (
    NOT_SHOWN,
    Check,
    Informative,
    LogOutcome,
    Other,
    SpecRead,
    UnlikeOthers,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.figure_text import to_digits, to_power

SCHEMA: Final = "syncline-design/watch/v1"
WatchOutcome = Literal["unchanged", "alarm"]
MOST_EVIDENCE: Final = 1e299  # beyond it evidence is not told apart
WHOLE: Final = 995.0  # from which evidence is told by its power of ten


def e_value_text(value: float) -> str:
    """An e-value to two figures, everywhere alike: `40`, `1.6e+03`, `more than 1e+299`."""
    if value >= MOST_EVIDENCE:
        return "more than 1e+299"
    return to_power(value) if value >= WHOLE else to_digits(value, 2)


@dataclass(frozen=True, slots=True)
class RunValue(Record):
    """A parameter as one run alone tells it, in SI; null where it says nothing of it."""

    effect: str
    sensor: str
    stage: str
    parameter: str
    value: float
    standard_uncertainty: float | None
    interval95: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class WatchedRun(Record):
    """One run: its number from 1 in the order of adding, and what it tells alone.

    baseline: which baseline it belongs to, from 1.  e_value: the evidence for a change up to this
    run, since its baseline; null of the first.  new: whether this call added it.  left_out: true
    of a run that is counted no more.  checks: where it contradicts itself or the platform's limits.
    """

    run: int
    files: tuple[str, ...]
    date: str | None
    start: str
    rows: int
    verdict: LogOutcome
    named: tuple[str, ...]
    baseline: int
    e_value: float | None
    new: bool
    values: tuple[RunValue, ...]
    left_out: bool | None = optional()
    checks: tuple[Check, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Since(Record):
    """The first run that has a change, and between which runs it lies with 95 %.

    low, high: numbers of runs; low_date, high_date: their dates, where they have some.
    """

    run: int
    file: str
    date: str | None
    low: int
    high: int
    low_date: str | None
    high_date: str | None


@dataclass(frozen=True, slots=True)
class Drift(Record):
    """A parameter that is another with every run: by how much from one to the next, in SI; by_run:
    the last run, by which it came to the whole change; ended: whether it is no longer another in
    the runs after that."""

    per_run: float
    standard_uncertainty: float
    text: str
    by_run: int
    ended: bool | None = optional()


@dataclass(frozen=True, slots=True)
class Alarm(Record):
    """One parameter that changed: by how much, in SI, and since when.

    words: a convention that is another, which has no figure; then `change` is null.  text: the
    change as outputs print it.  first_run: at which run the alarm was first due.  alone: true where
    the runs before and after `since` are alike, and differ from that one run.  drift: where it is
    another with every run, of which `since` is the first; change is what it came to by the last.
    """

    effect: str
    sensor: str
    stage: str
    parameter: str
    change: float | None
    standard_uncertainty: float | None
    interval95: tuple[float, float] | None
    unit: str
    text: str
    since: Since
    evidence: str
    e_value: float | None
    first_run: int
    aliases: tuple[Other, ...]
    words: str | None = optional()
    alone: bool | None = optional()
    drift: Drift | None = optional()


@dataclass(frozen=True, slots=True)
class Unsettled(Record):
    """An effect in which the runs are not all alike, where it is not clear yet whether by a change,
    by a drift or by another value in every run.

    spread: standard deviation beyond noise by parameter, in SI.  log10_chance: of so much by noise
    alone, over all effects.
    """

    effect: str
    sensor: str
    stage: str
    spread: Mapping[str, float]
    log10_chance: float


@dataclass(frozen=True, slots=True)
class WatchRule(Record):
    """How an alarm is raised: at this e-value, with this chance of a false one over all looks."""

    method: str
    false_alarm_rate: float
    threshold: float
    looks: int


@dataclass(frozen=True, slots=True)
class WatchProvenance(Record):
    """What the answer depends on."""

    version: str
    spec_sha256: str
    catalogs_sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch(Record):
    """The runs of one system, and what changed.

    baseline_after: how many runs lie before the baseline that counts.  ordered_by: whether runs
    are in the order of their dates.  cautions: what is odd in the last run and no change.
    last: hash of the store's last line.  torn: bytes of a line that a kill had left.
    informative: whether the last run could have shown a change that would turn the verdict.
    unlike: runs that are unlike all the others, each with every effect in which it is, the clearest
    first; unlike_rate: the chance that any of several alike runs is said to be, over all looks.
    unsettled: where nothing rang, and the runs are not all alike yet.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: WatchOutcome
    spec: SpecRead
    store: str
    runs: tuple[WatchedRun, ...]
    alarms: tuple[Alarm, ...]
    e_value: float | None
    rule: WatchRule
    baseline_after: int
    ordered_by: Literal["date", "adding"]
    cautions: tuple[str, ...]
    last: str
    torn: int
    provenance: WatchProvenance
    informative: Informative
    unlike: tuple[UnlikeOthers, ...] | None = optional()
    unlike_rate: float | None = optional()
    unsettled: Unsettled | None = optional()

    @property
    def contradicted(self) -> tuple[WatchedRun, ...]:
        """Runs that count and contradict themselves or the limits of the spec's platform."""
        own = (run for run in self.runs if run.run > self.baseline_after and not run.left_out)
        return tuple(run for run in own if run.checks)

    @property
    def exit_code(self) -> int:
        """0 nothing changed, 1 something did."""
        return 1 if self.alarms else 0

    def demanded_exit_code(self, *, informative: bool) -> int:
        """The exit code; 3 where nothing changed in runs of which the last could not show it, or
        of which one does not belong to the others or that differ."""
        alike = not self.unlike and self.unsettled is None
        bears_out = self.informative.ok and alike and not self.contradicted
        hidden = informative and not self.alarms and not bears_out
        return NOT_SHOWN if hidden else self.exit_code
