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
from syncline_design.campaign.changes import Change, Changes
from syncline_design.campaign.joint import JointError
from syncline_design.campaign.looks import KeptLook, keys_of, known_first
from syncline_design.campaign.oddities import cautions
from syncline_design.campaign.pool import Pool, Term, pool_of
from syncline_design.campaign.run_values import RunParameter, run_values
from syncline_design.campaign.sight import sight
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
from syncline_design.campaign.watch_result import (
    Alarm,
    Other,
    RunValue,
    Since,
    Watch,
    WatchedRun,
    WatchProvenance,
    WatchRule,
    e_value_text,
)
from syncline_design.diagnosis.candidates import commonness
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.finding import estimate
from syncline_design.diagnosis.result import SpecRead
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.normal import NORMAL_95
from syncline_design.spec.case import Case

RATE: Final = 0.05
METHOD: Final = (
    "e-process: Bayes factors of a change of each effect from each run on, mixed; false alarms "
    "count over all looks since a baseline (Ville's inequality)"
)
AS_GOOD_NATS: Final = 2.0
RIVAL_NATS: Final = 3.0
MOST_CHANGES: Final = 4
CREDIBLE: Final = 0.95
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
        if request.files and found.fresh:  # whoever only looks again leaves the store as it is
            found = replace(found, stored=add_looks(stored, found.fresh))
        return found.told(torn)


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
class Seen:
    """A change that was seen: the best, at which look first, how sure, what else it could be."""

    change: Change
    low: int
    high: int
    first_look: int
    log_evidence: float
    others: tuple[tuple[Term, float], ...]


@dataclass(frozen=True, eq=False)
class Watching:
    """A store looked at."""

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
    def pool(self) -> Pool:
        entries = self.ordered or self.stored.entries[-1:]
        return pool_of([e.found for e in entries], [e.start for e in entries])

    @property
    def course(self) -> Array:
        """log E_n after each look, from the second run on."""
        return self.changes.course[1:]

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Of the look after each run."""
        return self._keys(self.ordered)

    def _keys(self, runs: Sequence[Entry]) -> tuple[str, ...]:
        listed = [self.pool.labels, [term.label for term in self.pool.terms]]
        return tuple(keys_of(listed, [entry.line for entry in runs]))

    @cached_property
    def kept(self) -> tuple[KeptLook, ...]:
        """What earlier looks at these runs found, as the store holds it."""
        return known_first(self.stored.looks, self.keys, len(self.pool.terms))

    @cached_property
    def doubted(self) -> int | None:
        """The run after which a kept look says what its runs do not; None where none does.

        At every call another of them is computed again.
        """
        if not self.kept:
            return None
        at = len(self.stored.entries) % len(self.kept)
        anew = _look(self.keys[at], *Changes(self.pool, self.kept).found_anew(at + 1))
        return None if anew.is_like(self.kept[at]) else at

    @cached_property
    def changes(self) -> Changes:
        return Changes(self.pool, self.kept if self.doubted is None else ())

    @cached_property
    def fresh(self) -> tuple[KeptLook, ...]:
        """Looks that the store does not hold, or holds wrongly."""
        first = len(self.kept) if self.doubted is None else 0
        places = range(first, len(self.ordered))
        return tuple(_look(self.keys[k], *self.changes.found_by(k + 1)) for k in places)

    @property
    def threshold(self) -> float:
        return -math.log(self.request.rate)

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Changes that were alarmed at any look so far, the strongest first."""
        first = next((k + 2 for k, e in enumerate(self.course) if e >= self.threshold), None)
        if first is None:
            first = self._rang
        if first is None:
            return ()
        found: list[Seen] = []
        changes, look = self.changes, len(self.ordered)
        while len(found) < MOST_CHANGES:
            at = look
            total, table = changes.log_evidence(at)
            if found and total < self.threshold:
                break
            if not found and total < math.log(2.0):  # it went back, which is a change of its own
                at = first
                total, table = changes.log_evidence(at)
            found.append(_best(changes, at, table, first, total))
            changes = changes.without(found[-1].change)
        return tuple(found)

    @cached_property
    def _rang(self) -> int | None:
        """The place from 1 of the run whose look rang when it was added, before runs of earlier
        dates came in; an alarm stays, whatever is added."""
        if self.doubted is not None:
            return None
        added = sorted(self.ordered, key=lambda entry: entry.number)
        begun = [entry.run.first_s for entry in added]
        if begun == sorted(begun):  # nothing came in late: the course is what the looks found
            return None
        for n in range(2, len(added)):
            look = self.stored.looks.get(self._keys(tuple(by_date(tuple(added[:n]))))[-1])
            if look is not None and look.log_evidence >= self.threshold:
                return 1 + self.ordered.index(added[n - 1])
        return None

    def told(self, torn: int) -> Watch:
        """All of it as a result."""
        stored, case = self.stored, self.case
        alarms = [a for one in self.seen for a in self._alarms(one)]
        alarms += self._conventions()
        dated = all(e.run.date is not None for e in self.ordered)
        last = float(self.course[-1]) if len(self.course) else None
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
            cautions=self._cautions(),
            informative=sight(case, self.changes, len(self.ordered), self.request.rate),
            last=stored.last,
            torn=torn,
            provenance=WatchProvenance(__version__, case.spec_sha256, case.catalogs_sha256),
        )  # fmt: skip

    def _cautions(self) -> tuple[str, ...]:
        seen = [one.change for one in self.seen]
        odd = cautions(self.ordered, self.doubted, self.changes, seen, self._stage)
        return (*self.stored.left_out_words(), *odd)

    def _stage(self, index: int) -> str:
        return self.case.spec.stages[index].name

    def _alarms(self, one: Seen) -> Iterator[Alarm]:
        """An alarm for each parameter of an effect that clearly changed; at least the clearest."""
        change, term = one.change, one.change.term
        slopes = term.effect.slopes()
        spread = np.sqrt(np.maximum(np.diag(change.covariance), 0.0))
        size = np.abs(change.values) / np.where(spread > 0.0, spread, np.inf)
        others = tuple(Other(*t.label[:2], self._stage(t.stage), worse) for t, worse in one.others)
        for k in np.argsort(-size):
            if size[k] < SHOWN and k != np.argmax(size):
                continue
            value, sigma = float(change.values[k]), float(spread[k])
            half = NORMAL_95 * sigma
            e_value = math.exp(min(one.log_evidence, 690.0))
            alarm_from = f"alarm from {to_digits(1.0 / self.request.rate, 3)} on"
            yield Alarm(
                effect=term.effect.name,
                sensor=term.sensor,
                stage=self._stage(term.stage),
                parameter=slopes[k].name,
                change=value,
                standard_uncertainty=sigma,
                interval95=(value - half, value + half),
                unit=slopes[k].unit,
                text=estimate(value, sigma, slopes[k].unit).text,
                since=self._since(change.k, one.low, one.high),
                evidence=f"e-value {e_value_text(e_value)}, {alarm_from}",
                e_value=e_value,
                first_run=self.ordered[one.first_look - 1].number,
                aliases=others,
            )

    def _since(self, at: int, low: int, high: int) -> Since:
        run, first, last = (self.ordered[k] for k in (at, low, high))
        return Since(run.number, run.run.files[0], run.run.date, first.number, last.number,
                     first.run.date, last.run.date)  # fmt: skip

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
                yield Alarm(n.effect, n.sensor, n.stage, "convention", None, None, None, "",
                            n.words, self._since(at, at, at), "undone before anything was fitted",
                            None, entry.number, (), words=n.words)  # fmt: skip

    def _runs(self) -> Iterator[WatchedRun]:
        """Every run of every baseline, with what it tells alone beside what is named."""
        place = {e.number: k for k, e in enumerate(self.ordered)}
        values = run_values(self.changes, [one.change for one in self.seen], RATE)
        for entry in self.stored.entries:
            k = place.get(entry.number)
            known = None if k is None or k == 0 else self.course[k - 1]
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
                left_out=True if entry.number in self.stored.left_out else None,
                values=() if k is None else tuple(map(self._told, values[k])),
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


def _best(changes: Changes, look: int, table: Array, first: int, total: float) -> Seen:
    """The likeliest change; among effects that are as good, the commonest in practice."""
    each = np.logaddexp.reduce(table, axis=0)
    close = np.flatnonzero(each >= each.max() - AS_GOOD_NATS)
    c = min(close, key=lambda i: (commonness(changes.terms[i].label), -each[i]))
    share = np.exp(table[:, c] - each[c])
    k = int(np.argmax(share)) + 1
    order = np.argsort(-share)
    needed = int(np.searchsorted(np.cumsum(share[order]), CREDIBLE)) + 1
    credible = order[:needed] + 1
    others = sorted(
        ((changes.terms[i], float(each[c] - each[i])) for i in range(len(each))
         if i != c and each[i] > each[c] - RIVAL_NATS),
        key=lambda other: other[1],
    )  # fmt: skip
    return Seen(changes.change(look, k, int(c)), int(min(credible)), int(max(credible)), first,
                total, tuple(others))  # fmt: skip


def _look(key: str, evidence: float, within: Array, between: Array) -> KeptLook:
    return KeptLook(key, evidence, tuple(map(float, within)), tuple(map(float, between)))
