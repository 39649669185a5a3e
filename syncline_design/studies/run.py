"""Run a study: reuse what is there, compute the rest, keep every case as soon as it is done."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import field
from datetime import date
from pathlib import Path

from syncline_design.choice.outcome import NoVerdict
from syncline_design.machine.deadline import Deadline, OutOfTime, in_force, within
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import read_as
from syncline_design.model.figure_text import grouped, to_digits
from syncline_design.studies.case import CaseSettings, case_keys
from syncline_design.studies.cluster import ClusterError, run_on_cluster
from syncline_design.studies.inputs import Looked, full_key
from syncline_design.studies.loading import Study, load_study
from syncline_design.studies.pool import PoolError, Result, WorkerPool, encoded_case
from syncline_design.studies.record import CaseRecord
from syncline_design.studies.result import Progress, Report, StudyResult
from syncline_design.studies.store import FOLDER, Store, StoreError

FEW_CASES = 8  # as many are done sooner than a worker process starts


class StudyError(Exception):
    """A study cannot be run as asked: no such cluster, no Dask."""


class StudyStoppedError(StudyError, NoVerdict):
    """A study could not be run to its end (no room, no processes); what is done is kept."""


@dataclass(frozen=True, slots=True)
class StudySettings:
    """How to run a study; none of it but the seed changes a result.

    workers: local processes (of a local cluster with `dask`).  store: folder of the case files;
    None: `.syncline-cases` beside the study file.  scheduler: address of a Dask scheduler.
    today: the day on which waivers are judged; None: the machine's date.  fresh: believe no case
    file that is there.
    """

    seed: int = 0
    workers: int = 2
    store: Path | None = None
    scheduler: str | None = None
    dask: bool = False
    today: date | None = None
    fresh: bool = False


def run_study(
    path: str | Path, settings: StudySettings | None = None, progress: Report | None = None
) -> StudyResult:
    """Run a study file to its end; cases whose file is there already are not computed again."""
    chosen = settings or StudySettings()
    study = load_study(path)
    return run_loaded(study, chosen, progress)


def run_loaded(
    study: Study, settings: StudySettings, progress: Report | None = None
) -> StudyResult:
    """The same for a study that was read already."""
    started = time.monotonic()
    shared = CaseSettings.now(settings.seed, settings.today)
    store = Store(settings.store or study.path.parent / FOLDER)
    run = _Run(study, settings, shared, store, started, progress)
    try:
        store.open()
        return run.finish()
    except ClusterError as error:
        raise StudyError(str(error)) from None
    except (PoolError, StoreError) as error:
        raise StudyStoppedError(str(error)) from None
    except OutOfTime:
        raise StudyStoppedError(run.out_of_time()) from None


@dataclass
class _Run:
    """One run: counts as it goes."""

    study: Study
    settings: StudySettings
    shared: CaseSettings
    store: Store
    started: float
    progress: Report | None
    retried: int = 0
    done: tuple[int, int] | None = None  # of how many
    unsettled: dict[str, CaseRecord] = field(default_factory=dict)
    looked: Looked = field(default_factory=Looked)

    def finish(self) -> StudyResult:
        cases = case_keys(self.study, self.shared)
        twins = self._twins(cases)
        keys = {index: key for index in twins if (key := self._kept(cases[index], index))}
        missing = [index for index in twins if index not in keys]
        again = len(cases) - len(twins)  # cases of equal content are computed once
        reused = len(keys) + again
        self._say(reused, len(cases), reused)
        for done, (index, encoded) in enumerate(self._records(missing), 1):
            record = read_as(CaseRecord, encoded)
            keys[index] = self._keep(cases[index], encoded, record)
            if not record.is_final:
                self.unsettled[keys[index]] = record
            self._say(reused + done, len(cases), reused)
        elapsed = time.monotonic() - self.started
        firsts = {twin: index for index, group in twins.items() for twin in group}
        placed = tuple(keys[firsts[index]] for index in range(len(cases)))
        return StudyResult(
            self.study, self.settings.seed, self.shared.today, placed, self.store, self.unsettled,
            reused, len(missing), self.retried, elapsed,
        )  # fmt: skip

    def _twins(self, cases: Sequence[str]) -> dict[int, list[int]]:
        """The first case of every content in every folder, with all that equal it."""
        groups: dict[tuple[str, str], list[int]] = {}
        for index, case_key in enumerate(cases):
            groups.setdefault((str(self._folder(index)), case_key), []).append(index)
        return {group[0]: group for group in groups.values()}

    def _folder(self, index: int) -> Path:
        return self.study.bases[self.study.case(index)[0]].path.parent

    def _kept(self, case_key: str, index: int) -> str | None:
        """The key of a record that holds for the files as they are now."""
        if self.settings.fresh:
            return None
        folder = self._folder(index)
        for sought in self.store.reads(case_key) or ((),):
            inputs = self.looked.now(sought, folder)
            key = full_key(case_key, inputs)
            record = self.store.read(key)
            if record is not None and record.inputs == inputs:
                return key
        return None

    def _keep(self, case_key: str, encoded: str, record: CaseRecord) -> str:
        """Put a record where the next run finds it, unless the same case may come out otherwise."""
        inputs = record.inputs
        key = full_key(case_key, inputs)
        if record.is_final:
            self.store.write(key, encoded)
            if inputs:
                self.store.note_reads(case_key, inputs)
        return key

    def _records(self, missing: Sequence[int]) -> Iterator[Result]:
        settings = self.settings
        if settings.dask or settings.scheduler is not None:
            yield from run_on_cluster(
                self.study, self.shared, missing, address=settings.scheduler,
                workers=settings.workers,
            )  # fmt: skip
        elif settings.workers <= 1 or len(missing) <= FEW_CASES:
            for index in missing:
                with within(Deadline()):  # its own limit alone: or its record would tell of ours
                    encoded = encoded_case(self.study, index, self.shared)
                in_force().check()
                yield index, encoded
        else:
            pool = WorkerPool(self.study, self.shared, settings.workers)
            for result in pool.run(missing):
                self.retried = pool.retried
                yield result

    def out_of_time(self) -> str:
        """How far the study came within the time limit."""
        limit = f"the time limit of {to_digits(in_force().limit_s or 0.0)} s was reached"
        if self.done is None:
            return f"{limit} before the first case"
        done, total = map(grouped, self.done)
        return f"{limit}: {done} of {total} cases are done and kept; run the study again to go on"

    def _say(self, done: int, total: int, reused: int) -> None:
        self.done = done - len(self.unsettled), total
        if self.progress is not None:
            elapsed = time.monotonic() - self.started
            self.progress(Progress(done, total, reused, elapsed, self.retried))
