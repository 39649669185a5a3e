"""A store of runs watched over time: `watch STORE SPEC FILE`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design import __version__
from syncline_design.campaign.adding import content_hash, run_of
from syncline_design.campaign.alarms import alarms_of, others_of, since_of
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.compared_runs import ComparedRuns
from syncline_design.campaign.joint import JointError
from syncline_design.campaign.looks import KeptLook
from syncline_design.campaign.odd_run import departures_beside
from syncline_design.campaign.oddities import cautions, unsettled_in
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.run_values import RunParameter, run_values
from syncline_design.campaign.seen import Seen
from syncline_design.campaign.sight import sight
from syncline_design.campaign.standing import StandingAlone, standing
from syncline_design.campaign.store import (
    Entry,
    Stored,
    add_baseline,
    add_looks,
    add_omission,
    add_run,
    by_date,
    demand_known,
    demand_new,
    demand_system,
    read_store,
    refused,
)
from syncline_design.campaign.strangers import RATE as STRANGER_RATE
from syncline_design.campaign.strangers import Stranger, strangers
from syncline_design.campaign.telling import estimates
from syncline_design.campaign.trends import Trend
from syncline_design.campaign.watch_result import (
    Alarm,
    RunValue,
    Unsettled,
    Watch,
    WatchedRun,
    WatchProvenance,
    WatchRule,
)
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.result import SpecRead, UnlikeOthers
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import NORMAL_95
from syncline_design.spec.case import Case

RATE: Final = 0.05
METHOD: Final = (
    "e-process: Bayes factors of a change of each effect from each run on, mixed; false alarms "
    "count over all looks since a baseline (Ville's inequality)"
)
SHOWN: Final = 2.0  # standard uncertainties from which a parameter of a changed effect is told


@dataclass(frozen=True, slots=True)
class WatchRequest:
    """A store and the files of one more run; none: look at the store again."""

    store: Path
    files: tuple[Path, ...] = ()
    rate: float = RATE


def watch(
    case: Case,
    request: WatchRequest,
    settings: DiagnosisSettings | None = None,
    progress: SearchProgress = silent,
) -> Watch:
    """Add a run to a store, and say what changed since when.

    Raises BadInput for a spec, a log or a store that cannot be used.
    """
    with one_thread():
        system = pinned_system(case)
        stored = read_store(request.store)
        if stored is not None:
            demand_system(stored, system, case.spec.name)
        torn = 0 if stored is None else stored.torn
        before = 0 if stored is None else len(stored.entries)
        if request.files:
            _add(case, request, stored, settings or DiagnosisSettings(), progress)
            stored = read_store(request.store, stored)
        if stored is None or not stored.entries:
            raise JointError(f"{request.store}: no runs yet; expected a FILE to add, or a store "
                             "with runs")  # fmt: skip
        in_force().doing("comparing the runs")
        progress("comparing the runs", 0.9)
        found = Watching(case, request, stored, before)
        try:
            if request.files and found.fresh:  # whoever only looks again leaves the store as it is
                found = replace(found, stored=add_looks(stored, found.fresh))
            return found.told(torn)
        except np.linalg.LinAlgError:
            raise refused(
                request.store,
                "its runs hold statistics that no log has: someone made the chain anew",
                "runs as `watch` wrote them",
                hint="take back a copy of the store, or begin a new one and add the logs again",
            ) from None


def accept(store: Path) -> Stored:
    """Make a new baseline of a store: runs from now on are held against one another."""
    stored = read_store(store)
    if stored is None or not stored.entries:
        raise refused(store, "no runs to accept", "a store that `watch` added runs to")
    add_baseline(store)
    found = read_store(store)
    assert found is not None
    return found


def leave_out(store: Path, run: int, reason: str, *, back: bool = False) -> Stored:
    """Count a run of a store no more (back: count it again); it stays in the file."""
    if not reason.strip():
        raise refused(store, "no reason given", "a reason, which every look repeats")
    if read_store(store) is None:  # before a file is made of nothing
        raise refused(store, "no runs", "a store that `watch` added runs to")
    add_omission(store, run, reason.strip(), back=back)
    found = read_store(store)
    assert found is not None
    return found


def _add(
    case: Case,
    request: WatchRequest,
    stored: Stored | None,
    settings: DiagnosisSettings,
    progress: SearchProgress,
) -> None:
    if stored is not None:
        demand_known(stored, content_hash(request.files), request.files)
    progress("reading the run", 0.0)
    run = run_of(case, request.files, settings, promise_of(case), progress)
    demand_new(stored, run, request.store)
    add_run(request.store, case.spec.name, pinned_system(case), run, known=stored)


@dataclass(frozen=True, eq=False)
class Watching:
    """A store looked at.

    A run unlike all the others, before and after, would hide what else changed: it makes every
    effect of it one that differs from run to run.  So the others are looked at without it, too.
    """

    case: Case
    request: WatchRequest
    stored: Stored
    before: int

    @cached_property
    def ordered(self) -> tuple[Entry, ...]:
        """Runs of the last baseline, in their order."""
        after = self.stored.baselines[-1] if self.stored.baselines else 0
        return tuple(by_date(tuple(e for e in self.stored.counted if e.number > after)))

    @cached_property
    def every(self) -> ComparedRuns:
        return ComparedRuns(self.stored, self.ordered, -math.log(self.request.rate))

    @cached_property
    def standing(self) -> StandingAlone:
        """Runs that are unlike all the others, and which of them stand alone.

        What is strange without the likeliest change is one odd run among runs that change; what a
        change alone makes so is looked at by all runs.
        """
        if not self.ordered:
            return StandingAlone((), ())
        changes = self.every.changes
        likely = changes.likeliest(len(self.ordered)) if len(self.ordered) > 1 else None
        rather = changes.differs_rather(len(self.ordered)) if likely is not None else None
        scatters = rather is not None and likely is not None and rather.term == likely.term
        if likely is not None and not scatters:
            left = changes.without(likely)
            found = standing(left, strangers(left))
            if found.alone:
                return found
        return standing(changes, strangers(changes))

    @property
    def strange(self) -> tuple[Stranger, ...]:
        """Runs that are unlike all the others and not by a change of several, by their places."""
        return self.standing.strange

    @property
    def alone(self) -> tuple[int, ...]:
        """Places of those among them that stand alone between runs that are alike."""
        return self.standing.alone

    @cached_property
    def rest(self) -> ComparedRuns:
        """The runs but for those."""
        if not self.alone:
            return self.every
        return ComparedRuns(self.stored, self.ordered, self.every.threshold, self.alone)

    @cached_property
    def unlike_others(self) -> tuple[Stranger, ...]:
        """The strange runs by what they are another in beside what the others say that changed: of
        an effect that drifts, they have it otherwise than a drift would."""
        seen, odd = [one.change for one in self.rest.seen], [one.run for one in self.strange]
        found = []
        for one in self.strange:
            others = tuple(run for run in odd if run != one.run)
            changes = Changes(self.every.pool.silent(others)) if others else self.every.changes
            told = departures_beside(changes, one.run, seen)
            found.append(replace(one, departures=told or one.departures))
        return tuple(found)

    @property
    def fresh(self) -> tuple[KeptLook, ...]:
        """Looks that the store does not hold, or holds wrongly."""
        more = () if self.rest is self.every else self.rest.fresh
        known = {one.key for one in self.every.fresh}
        return (*self.every.fresh, *(one for one in more if one.key not in known))

    @property
    def doubted(self) -> Entry | None:
        """The run after which a kept look says what its runs do not; None where none does."""
        for course in (self.every, self.rest):
            if course.doubted is not None:
                return course.runs[course.doubted]
        return None

    def told(self, torn: int) -> Watch:
        """All of it as a result."""
        stored, case = self.stored, self.case
        alarms = [a for one in self.rest.seen for a in self._alarms(one, self.rest)]
        alarms += [] if alarms else self._alone_alarms()
        alarms += self._conventions()
        dated = all(e.run.date is not None for e in self.ordered)
        evidence, unlike = self.rest.evidence, tuple(self._unlike())
        last = float(evidence[-1]) if len(evidence) else None
        count = len(self.rest.runs)
        open_yet = not alarms and count > 1 and not unlike
        unsettled = unsettled_in(self.rest.changes, count, self._stage) if open_yet else None
        return Watch(
            verdict="alarm" if alarms else "unchanged",
            spec=SpecRead(case.spec.name, str(case.path)),
            store=str(stored.path),
            runs=tuple(self._runs()),
            alarms=tuple(alarms),
            e_value=None if last is None else math.exp(min(last, 690.0)),
            rule=WatchRule(METHOD, self.request.rate, 1.0 / self.request.rate,
                           max(len(self.ordered) - 1, 0)),
            baseline_after=stored.baselines[-1] if stored.baselines else 0,
            ordered_by="date" if dated else "adding",
            cautions=self._cautions(unlike, unsettled),
            informative=sight(case, self.rest.changes, len(self.rest.runs), self.request.rate),
            last=stored.last,
            torn=torn,
            provenance=WatchProvenance(__version__, case.spec_sha256, case.catalogs_sha256),
            unlike=unlike or None,
            unlike_rate=STRANGER_RATE if unlike else None,
            unsettled=unsettled,
        )  # fmt: skip

    def _cautions(
        self, unlike: Sequence[UnlikeOthers], unsettled: Unsettled | None
    ) -> tuple[str, ...]:
        seen = [one.change for one in self.rest.seen]
        odd = cautions(
            self.ordered, self.doubted, unlike, self.rest.changes, seen, self._stage, unsettled
        )
        return (*self.stored.left_out_words(), *odd)

    def _unlike(self) -> Iterator[UnlikeOthers]:
        """Runs that are unlike the others, but for those that a change explains."""
        for stranger in self.unlike_others:
            if self._is_explained(stranger):
                continue
            entry = self.ordered[stranger.run]
            for one in stranger.departures:
                name, sensor, stage = one.term.label
                yield UnlikeOthers(
                    entry.number, entry.run.files, name, sensor, self._stage(stage),
                    estimates(one.term, one.judged), one.log_p / math.log(10.0),
                    others_of(one.others, self._stage) or None,
                )  # fmt: skip

    def _is_explained(self, stranger: Stranger) -> bool:
        """Whether a change that is told says it: of one effect, by its name or by its day."""
        if not self.rest.seen or stranger.run in self.alone or len(stranger.departures) > 1:
            return False
        told = {one.change.term.label for one in self.rest.seen}
        begun = {self.rest.runs[one.change.k].number for one in self.rest.seen}
        own = stranger.departures[0].term.label
        return own in told or self.ordered[stranger.run].number in begun

    def _alone_alarms(self) -> Iterator[Alarm]:
        """Where what rang is of single runs, which the others before and after do not have."""
        first = self.every.first_look
        if first is None or not self.alone:
            return
        evidence = float(self.every.evidence[first - 2])
        for one in (s for s in self.unlike_others if s.run in self.alone):
            for departure in one.departures:
                change = Change(departure.term, Trend("step", one.run), departure.judged.values,
                                departure.judged.model, evidence)  # fmt: skip
                known = np.zeros_like(change.covariance)
                seen = Seen(change, one.run, one.run, first, evidence, departure.others,
                            known, known)  # fmt: skip
                found = self._alarms(seen, self.every)
                yield from (replace(alarm, alone=True) for alarm in found)

    def _stage(self, index: int) -> str:
        return self.case.spec.stages[index].name

    def _alarms(self, one: Seen, course: ComparedRuns) -> Iterator[Alarm]:
        return alarms_of(one, course.runs, self._stage, self.request.rate)

    def _conventions(self) -> Iterator[Alarm]:
        """Conventions and slips that were undone in some runs and not in the first."""
        first = self.ordered[0].run.named if self.ordered else ()
        known = {(n.effect, n.sensor, n.stage, n.words) for n in first if n.undone}
        for at, entry in enumerate(self.ordered):
            for n in entry.run.named:
                key = (n.effect, n.sensor, n.stage, n.words)
                if not n.undone or key in known:
                    continue
                known.add(key)
                since = since_of(self.ordered, at, at, at)
                yield Alarm(n.effect, n.sensor, n.stage, "convention", None, None, None, "",
                            n.words, since, "undone before anything was fitted", None,
                            entry.number, (), words=n.words)  # fmt: skip

    def _runs(self) -> Iterator[WatchedRun]:
        """Every run of every baseline, with what it tells alone beside what is named."""
        place = {e.number: k for k, e in enumerate(self.ordered)}
        looks = {e.number: k for k, e in enumerate(self.rest.runs) if k not in self.alone}
        seen = [one.change for one in self.rest.seen]
        values = run_values(self.every.changes, seen, RATE, self.alone)
        for entry in self.stored.entries:
            k, look = place.get(entry.number), looks.get(entry.number)
            known = None if not look else self.rest.evidence[look - 1]
            yield WatchedRun(
                run=entry.number,
                files=entry.run.files,
                date=entry.run.date,
                start=entry.start,
                rows=entry.run.used,
                verdict=entry.run.verdict,  # type: ignore[arg-type]  # as it was written
                named=tuple(n.words for n in entry.run.named),
                baseline=1 + sum(after < entry.number for after in self.stored.baselines),
                e_value=None if known is None else math.exp(min(known, 690.0)),
                new=entry.number > self.before,
                values=() if k is None else tuple(map(self._told, values[k])),
                left_out=True if entry.number in self.stored.left_out else None,
                checks=entry.run.checks or None,
            )

    def _told(self, one: RunParameter) -> RunValue:
        term, half = one.term, None if one.spread is None else NORMAL_95 * one.spread
        return RunValue(
            term.effect.name,
            term.sensor,
            self._stage(term.stage),
            term.effect.slopes()[one.place].name,
            one.value,
            one.spread,
            None if half is None else (one.value - half, one.value + half),
        )
