"""Several logs of one system taken together: `diagnose --joint`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from syncline_design.campaign.adding import content_hash, run_of
from syncline_design.campaign.kept import Run
from syncline_design.campaign.naming import NamedTogether, Naming
from syncline_design.campaign.pool import Pool, pool_of
from syncline_design.campaign.store import (
    Entry,
    Stored,
    add_run,
    demand_known,
    demand_system,
    read_store,
)
from syncline_design.campaign.telling import Told, tell
from syncline_design.campaign.twice import is_same
from syncline_design.campaign.unlike import unlike_logs
from syncline_design.diagnosis.consequence import promise_of
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.settings import DiagnosisSettings, SearchProgress, silent
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.deadline import in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case


class JointError(ValueError):
    """Logs that cannot be taken together as asked; the text says what was expected and found."""


@dataclass(frozen=True, slots=True)
class JointRequest:
    """Logs, each a run; starts: which start of the system each is of, None for one of its own.

    store: the file that keeps what the logs say, with what it holds already.
    """

    logs: tuple[Path, ...]
    starts: tuple[str, ...] | None = None
    store: Path | None = None


def starts_of(text: str, logs: int) -> tuple[str, ...]:
    """`1,1,2` as one name a log; JointError where there are more or fewer."""
    found = tuple(part.strip() for part in text.split(","))
    if not all(found):
        raise JointError(f"--starts {text}: expected a name for each log, such as 1,1,2, "
                         "found an empty one")  # fmt: skip
    if len(found) != logs:
        raise JointError(f"--starts {text}: expected {logs} names, one a log, in their order, "
                         f"found {len(found)}")  # fmt: skip
    return found


def diagnose_joint(
    case: Case,
    request: JointRequest,
    settings: DiagnosisSettings | None = None,
    progress: SearchProgress = silent,
) -> Diagnosis:
    """What several logs say together.

    Raises BadInput for a spec, a log or a store that cannot be used, JointError for a request that
    cannot be met.  A log is in the store once its statistics are; a kill loses none before it.
    """
    settings = settings or DiagnosisSettings()
    with one_thread():
        system = pinned_system(case)
        stored = None if request.store is None else read_store(request.store)
        if stored is not None:
            demand_system(stored, system, case.spec.name)
        if not request.logs and stored is None:
            raise JointError("--joint: no log; expected logs, one a run, or a --store with runs")
        _demand_different(request, stored)
        promise = promise_of(case)
        entries = list(stored.entries) if stored is not None else []
        before = len(entries)
        for k, path in enumerate(request.logs):
            share = k / len(request.logs)
            in_force().doing(f"reading {path.name}")
            progress(f"log {k + 1} of {len(request.logs)}", share)
            run = run_of(case, [path], settings, promise)
            start = None if request.starts is None else request.starts[k]
            _demand_unlike(run, entries, path)
            if request.store is not None:
                add_run(request.store, case.spec.name, system, run, start, stored)
            number = len(entries) + 1
            entries.append(Entry(number, start or f"#{number}", run, run.statistics()))
        progress("taking the logs together", 1.0)
        return _together(case, request, settings, stored, entries, before)


def _together(
    case: Case,
    request: JointRequest,
    settings: DiagnosisSettings,
    stored: Stored | None,
    entries: Sequence[Entry],
    before: int,
) -> Diagnosis:
    left_out = {} if stored is None else stored.left_out
    entries = [one for one in entries if one.number not in left_out]
    if not entries:
        raise JointError("--joint: every run of the store is left out; expected one that counts")
    pool, named = _named(entries, settings)
    unlike = unlike_logs(pool, [one.scoped.term for one in named.terms])
    odd = tuple((entries[one.run], one) for one in unlike)
    if odd:
        apart = {entry.number for entry, _ in odd}
        entries = [one for one in entries if one.number not in apart]
        pool, named = _named(entries, settings)
    last = None if request.store is None else read_store(request.store, stored)
    return tell(Told(case, settings, tuple(entries), before, pool, named,
                     last, 0 if stored is None else stored.torn, odd))  # fmt: skip


def _named(entries: Sequence[Entry], settings: DiagnosisSettings) -> tuple[Pool, NamedTogether]:
    """Runs side by side, and what they name together."""
    pool = pool_of([one.found for one in entries], [one.start for one in entries])
    naming = Naming(pool, settings.false_alarm_rate, settings.max_effects, settings.exclude_effects)
    return pool, naming.named()


def _demand_different(request: JointRequest, stored: Stored | None) -> None:
    """Refuse a log that is given twice, or that the store holds, before it is read."""
    known: dict[str, Path] = {}
    for path in request.logs:
        digest = content_hash([path])
        if digest in known:
            raise JointError(f"{path}: the same log as {known[digest]}; expected each run once")
        known[digest] = path
    if stored is not None:
        for digest, path in known.items():
            demand_known(stored, digest, [path])


def _demand_unlike(run: Run, entries: Sequence[Entry], path: Path) -> None:
    """Refuse a log whose statistics are another's: the same rows in another format."""
    found = run.statistics()
    for one in entries:
        if is_same(found, one.found):
            raise JointError(
                f"{path}: holds the same rows as run {one.number} ({', '.join(one.run.files)}); "
                "expected each run once"
            )
