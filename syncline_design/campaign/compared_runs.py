"""Runs in their order with what was found at every look at them: whether it rang, and by what."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.looks import KeptLook, keys_of, known_first
from syncline_design.campaign.pool import Pool, pool_of
from syncline_design.campaign.seen import Seen, seen_changes
from syncline_design.campaign.store import Entry, Stored, by_date
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """Runs of one baseline, in the order in which they are compared; threshold: log of the evidence
    [nat] that rings.  apart: places of runs that keep their place and say nothing here."""

    stored: Stored
    runs: tuple[Entry, ...]
    threshold: float
    apart: tuple[int, ...] = ()

    @cached_property
    def pool(self) -> Pool:
        entries = self.runs or self.stored.entries[-1:]
        whole = pool_of([e.found for e in entries], [e.start for e in entries])
        return whole.silent(self.apart) if self.apart else whole

    @property
    def evidence(self) -> Array:
        """log E_n after each look, from the second run on."""
        return self.changes.course[1:]

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Of the look after each run."""
        return self._keys(self.runs)

    def _keys(self, runs: Sequence[Entry]) -> tuple[str, ...]:
        listed = [self.pool.labels, [term.label for term in self.pool.terms]]
        apart = {self.runs[k].number for k in self.apart}
        lines = [entry.line + (" apart" if entry.number in apart else "") for entry in runs]
        return tuple(keys_of(listed, lines))

    @cached_property
    def kept(self) -> tuple[KeptLook, ...]:
        """What earlier looks at these runs found, as the store holds it."""
        return known_first(self.stored.looks, self.keys, len(self.pool.terms))

    @cached_property
    def doubted(self) -> int | None:
        """The run after which a kept look says what its runs do not; None where none does.

        At every call another of them is computed again, and the last where nothing follows it: the
        answer is mostly its own.
        """
        if not self.kept:
            return None
        last = len(self.kept) - 1
        tried = {len(self.stored.entries) % len(self.kept)}
        tried |= {last} if len(self.kept) == len(self.runs) else set()
        for at in sorted(tried):
            anew = _look(self.keys[at], *Changes(self.pool, self.kept).found_anew(at + 1))
            if not anew.is_like(self.kept[at]):
                return at
        return None

    @cached_property
    def changes(self) -> Changes:
        return Changes(self.pool, self.kept if self.doubted is None else ())

    @cached_property
    def fresh(self) -> tuple[KeptLook, ...]:
        """Looks that the store does not hold, or holds wrongly."""
        first = len(self.kept) if self.doubted is None else 0
        places = range(first, len(self.runs))
        return tuple(_look(self.keys[k], *self.changes.found_by(k + 1)) for k in places)

    @cached_property
    def first_look(self) -> int | None:
        """The first look that rang, by the place from 1 of its run; None where none did."""
        rang = (k + 2 for k, e in enumerate(self.evidence) if e >= self.threshold)
        return next(rang, self._rang)

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Changes that were alarmed at any look so far, in the order of the runs."""
        first = self.first_look
        return () if first is None else seen_changes(self.changes, first, self.threshold)

    @property
    def _rang(self) -> int | None:
        """The place from 1 of the run whose look rang when it was added, before runs of earlier
        dates came in; an alarm stays, whatever is added."""
        if self.doubted is not None:
            return None
        added = sorted(self.runs, key=lambda entry: entry.number)
        begun = [entry.run.first_s for entry in added]
        if begun == sorted(begun):  # nothing came in late: the course is what the looks found
            return None
        for n in range(2, len(added)):
            look = self.stored.looks.get(self._keys(tuple(by_date(tuple(added[:n]))))[-1])
            if look is not None and look.log_evidence >= self.threshold:
                return 1 + self.runs.index(added[n - 1])
        return None


def _look(key: str, evidence: float, within: Array, between: Array) -> KeptLook:
    return KeptLook(key, evidence, tuple(map(float, within)), tuple(map(float, between)))
