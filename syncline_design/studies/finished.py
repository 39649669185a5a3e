"""A finished study: its cases, read back from their files when asked for, and what they come to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import field
from datetime import date
from functools import cached_property
from typing import Any, get_args

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.keys import label
from syncline_design.studies.definition import MeetsWhen
from syncline_design.studies.loading import Study
from syncline_design.studies.record import CaseRecord, CaseWord, StudyWord
from syncline_design.studies.store import Store, StoreError

VERDICTS: tuple[CaseWord, ...] = get_args(CaseWord)
EXIT_CODES: dict[StudyWord, int] = {"meets": 0, "fails": 1, "indeterminate": 3}


@dataclass(frozen=True, slots=True)
class CaseResult:
    """One case: where it stands, what was set, and the record of its check."""

    number: int  # from 1
    base: int
    file: str
    name: str  # of the base spec
    currency: str
    settings: tuple[tuple[str, Any], ...]
    record: CaseRecord

    @property
    def verdict(self) -> CaseWord:
        """meets, fails, infeasible, refused or indeterminate."""
        return self.record.verdict

    @property
    def labels(self) -> dict[str, str]:
        """Key path to value as the tables show it."""
        return {key: label(value) for key, value in self.settings}


@dataclass(frozen=True, slots=True)
class _End:
    """How a case ended: verdict, what was not simulated, whether a waiver was made use of, which
    were over."""

    verdict: CaseWord
    not_simulated: tuple[str, ...]
    waived: bool
    expired_waivers: tuple[str, ...]


@dataclass(frozen=True)
class Finished:
    """A finished study; iterate `cases()` for its results, in the order of the study."""

    study: Study
    seed: int
    today: date
    keys: tuple[str, ...] = field(repr=False)
    store: Store = field(repr=False)
    unsettled: dict[str, CaseRecord] = field(repr=False)  # by key: no verdict this time
    reused: int
    computed: int
    retried: int
    elapsed_s: float

    @property
    def judged_on(self) -> str | None:
        """The day on which waivers were judged; None where no base has one."""
        return self.today.isoformat() if any(b.has_waivers for b in self.study.bases) else None

    def __len__(self) -> int:
        return len(self.keys)

    def case(self, index: int) -> CaseResult:
        """One case by its index, from 0."""
        place, settings = self.study.case(index)
        base, record = self.study.bases[place], self._record(index)
        currency = base.currency if record.design is None else record.design.currency
        return CaseResult(index + 1, place, str(base.path), base.name, currency, settings, record)

    def _record(self, index: int) -> CaseRecord:
        key = self.keys[index]
        record = self.unsettled.get(key) or self.store.read(key)
        if record is None:
            file = self.store.path(key)
            raise StoreError(f"{file}: this case's file is gone or damaged; run the study again")
        return record

    def cases(self) -> Iterator[CaseResult]:
        """Every case in order; only one of them is in memory at a time."""
        return (self.case(index) for index in range(len(self.keys)))

    @cached_property
    def _ends(self) -> Counter[_End]:
        """How often cases ended how: every record read once."""
        records = map(self._record, range(len(self.keys)))
        return Counter(
            _End(one.verdict, one.not_simulated, bool(one.waived), one.expired_waivers)
            for one in records
        )

    @cached_property
    def counts(self) -> dict[CaseWord, int]:
        """How many cases ended how."""
        found = dict.fromkeys(VERDICTS, 0)
        for end, count in self._ends.items():
            found[end.verdict] += count
        return found

    @property
    def waived(self) -> int:
        """How many cases meet although a waived requirement is missed."""
        return sum(count for end, count in self._ends.items() if end.waived)

    @property
    def expired_waivers(self) -> tuple[str, ...]:
        """Requirements that some case misses and whose waiver is over."""
        return tuple(sorted({i for end in self._ends for i in end.expired_waivers}))

    @property
    def not_simulated(self) -> tuple[str, ...]:
        """Requirements that no case decided because the study leaves Monte Carlo out."""
        return tuple(sorted({i for end in self._ends for i in end.not_simulated}))

    @property
    def verdict(self) -> StudyWord:
        """meets, fails or indeterminate, by the study's `meets_when`.

        all: every case meets; any: at least one does; decided: every case got an answer.
        """
        return study_verdict(self.counts, self.study.meets_when)

    @property
    def exit_code(self) -> int:
        """0 meets, 1 does not, 3 no verdict."""
        return EXIT_CODES[self.verdict]


def study_verdict(counts: Mapping[CaseWord, int], meets_when: MeetsWhen) -> StudyWord:
    """The verdict of a study from how its cases ended."""
    failed = counts["fails"] + counts["infeasible"] + counts["refused"]
    if meets_when == "any":
        if counts["meets"]:
            return "meets"
        return "indeterminate" if counts["indeterminate"] else "fails"
    if meets_when == "decided":
        return "indeterminate" if counts["indeterminate"] else "meets"
    if failed:
        return "fails"
    return "indeterminate" if counts["indeterminate"] else "meets"
