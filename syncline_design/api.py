"""What the commands do, as functions: `import syncline_design as sd; sd.check("specs/own.yaml")`.

Each takes what its command takes and returns a result as data; `time_limit_s` binds all of it, and
`seed` is that of every random number in it.  BadInput names everything that is wrong with a file;
OutOfTime (a NoVerdict) says that the time was over before anything could be concluded; ValueError
names an argument that its command would refuse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from syncline_design.machine import arguments
from syncline_design.machine.deadline import NoVerdict, OutOfTime, within_s
from syncline_design.machine.notebooks import draw_with
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, load

if TYPE_CHECKING:
    from syncline_design.auditing.result import Audit
    from syncline_design.campaign.joint import JointRequest
    from syncline_design.campaign.watch_result import Watch
    from syncline_design.choice.option import ResourceName
    from syncline_design.choice.outcome import Road
    from syncline_design.clocks.study import TimingSettings
    from syncline_design.comparison.accept import AcceptSettings
    from syncline_design.comparison.acceptance import Acceptance
    from syncline_design.comparison.clock_meaning import TimingAndSpec
    from syncline_design.comparison.diff_result import Diff
    from syncline_design.comparison.meaning import DiagnosisAndDesign
    from syncline_design.diagnosis import Diagnosis
    from syncline_design.paper.reproduce import Reproduction
    from syncline_design.planning.telling import PlanRun
    from syncline_design.simulation import Simulation
    from syncline_design.studies import Progress, StudyResult
    from syncline_design.verdict.figure_front import FigureKind
    from syncline_design.verdict.optimization import Optimization
    from syncline_design.verdict.tree import Verdict

__all__ = [
    "BadInput",
    "Case",
    "NoVerdict",
    "OutOfTime",
    "accept",
    "audit",
    "check",
    "diagnose",
    "diff",
    "load",
    "optimize",
    "plan",
    "reproduce",
    "simulate",
    "study",
    "timing",
    "watch",
]

SpecOrPath = str | Path | Case  # a spec file, or one that was loaded before


def _drawn(result: object) -> str | None:
    """A result as HTML, when a notebook asks for it."""
    from syncline_design.report.notebook import shown

    return shown(result)


draw_with(_drawn)


def _case(spec: SpecOrPath) -> Case:
    return spec if isinstance(spec, Case) else load(arguments.path("spec", spec))


def _seed(seed: int) -> int:
    return arguments.whole("seed", seed, 0)


def _road(road: Road, method: Road | None) -> Road:
    """The road that is asked for, by its present name or by the one it had before."""
    from syncline_design.choice.outcome import ROAD_NAMES

    asked = road if method is None else method
    arguments.word("road" if method is None else "method", asked, ROAD_NAMES)
    return asked


def _limited(time_limit_s: float | None) -> AbstractContextManager[object]:
    """The time limit in force, once it is such as the commands take."""
    given = time_limit_s is not None
    return within_s(arguments.amount("time_limit_s", time_limit_s, 0.0) if given else None)


def _entries(named: str | Sequence[str]) -> tuple[str, ...]:
    return (named,) if isinstance(named, str) else tuple(dict.fromkeys(named))


def _files(logs: str | Path | Sequence[str | Path]) -> list[Path]:
    """One log or several, as paths."""
    named = [logs] if isinstance(logs, str | Path) else logs
    return [arguments.path("logs", one) for one in named]


def check(
    spec: SpecOrPath, *, seed: int = 0, road: Road = "auto", time_limit_s: float | None = None,
    monte_carlo: bool = True, today: date | None = None, baseline: str | Path | None = None,
    method: Road | None = None,
) -> Verdict:  # fmt: skip
    """The verdict on a spec.

    baseline: an earlier verdict as JSON; its exit code is then 0 where nothing got worse.

    road: to the proof of the best design; `method` is its earlier name.  monte_carlo: whether to
    simulate (a requirement of that kind stays undecided without).  today: the day on which waivers
    are judged; None: the machine's date.
    """
    from syncline_design.comparison.verdict_file import read_verdicts
    from syncline_design.verdict.baseline import against
    from syncline_design.verdict.settings import CheckSettings
    from syncline_design.verdict.verify import check_loaded

    road = _road(road, method)
    arguments.day("today", today)
    settings = CheckSettings(_seed(seed), road, monte_carlo=monte_carlo, today=today)
    with _limited(time_limit_s):
        earlier = None if baseline is None else read_verdicts(Path(baseline))
        verdict = check_loaded(_case(spec), settings)
    return verdict if earlier is None else against(verdict, earlier, str(baseline))


def optimize(
    spec: SpecOrPath, *, best: int = 1, every: bool = False, pareto: bool = False,
    resource: ResourceName = "cost", seed: int = 0, road: Road = "auto",
    time_limit_s: float | None = None, why_not: str | Sequence[str] = (),
    against: FigureKind | None = None, method: Road | None = None,
) -> Optimization:  # fmt: skip
    """The best designs of a spec, proven, and what they hinge on.

    best: how many designs that differ in a sensor; every: in anything.  pareto: the exact front of
    `resource` against the error too, or `against` another figure of it (worst_case, thu, tvu, rmse,
    quantile).  why_not: entries to answer for.
    """
    from syncline_design.choice.options import RESOURCES
    from syncline_design.verdict.figure_front import FIGURES
    from syncline_design.verdict.optimization import OptimizeSettings
    from syncline_design.verdict.optimize import optimize as optimized

    best = arguments.whole("best", best, 1)
    arguments.word("resource", resource, RESOURCES)
    road = _road(road, method)
    if against is not None:
        arguments.word("against", against, FIGURES)
    settings = OptimizeSettings(
        best,
        pareto,
        resource,
        against,
        road,
        seed=_seed(seed),
        every=every,
        why_not=_entries(why_not),
    )
    with _limited(time_limit_s):
        return optimized(_case(spec), settings).result


def simulate(
    spec: SpecOrPath, *, seed: int = 0, samples: int | None = None, workers: int | None = None,
    time_limit_s: float | None = None,
) -> Simulation:  # fmt: skip
    """The nonlinear chain of a spec (its best design where something is open) simulated."""
    from syncline_design.verdict.simulated_spec import simulate_spec

    if samples is not None:
        samples = arguments.whole("samples", samples, 1)
    if workers is not None:
        workers = arguments.whole("workers", workers, 1)
    with _limited(time_limit_s):
        return simulate_spec(_case(spec), _seed(seed), samples, workers).result


def diagnose(
    spec: SpecOrPath, logs: str | Path | Sequence[str | Path] = (), *, seed: int = 0,
    false_alarm_rate: float = 0.05, max_effects: int = 8, joint: bool = False,
    starts: Sequence[str] | None = None, store: str | Path | None = None,
    time_limit_s: float | None = None,
) -> DiagnosisAndDesign:  # fmt: skip
    """Where measured logs disagree with a spec, what is missing in it, what that means for it.

    logs: a file or several; none: those that the spec names.  joint: each file is a run of the
    same system; starts: the start of the system that each is of; store: the file that keeps what
    each says, with what it holds already.
    """
    from syncline_design import diagnosis
    from syncline_design.campaign.joint import diagnose_joint
    from syncline_design.comparison.meaning import meaning, with_design
    from syncline_design.planning.next_drive import next_drive
    from syncline_design.verdict.pinned import as_measured

    seed = _seed(seed)
    rate = arguments.amount("false_alarm_rate", false_alarm_rate, *arguments.FALSE_ALARM_RATES)
    most = arguments.whole("max_effects", max_effects, 0, arguments.MOST_EFFECTS)
    files = _files(logs)
    settings = diagnosis.DiagnosisSettings(seed, rate, most)
    with _limited(time_limit_s):
        case = _case(spec)
        pinned = as_measured(case, seed)
        if joint:
            request = _joint(files, starts, store)
            found = diagnose_joint(pinned, request, settings)
        else:
            found = diagnosis.diagnose(pinned, files, settings)
        means = meaning(case, found.effects_entries(), seed)
        return with_design(replace(found, plan=next_drive(pinned, found)), means)


def _joint(
    files: Sequence[Path], starts: Sequence[str] | None, store: str | Path | None
) -> JointRequest:
    from syncline_design.campaign.joint import JointRequest, starts_of

    named = None if starts is None else starts_of(",".join(map(str, starts)), len(files))
    kept = None if store is None else arguments.path("store", store)
    return JointRequest(tuple(files), named, kept)


def plan(
    spec: SpecOrPath, *, reach: str | None = None, separate: tuple[str, str] | None = None,
    diagnosis: Diagnosis | None = None, minutes: float = 10.0,
    flown: str | Path | Sequence[str | Path] = (), seed: int = 0, time_limit_s: float | None = None,
) -> PlanRun:  # fmt: skip
    """The test drive that tells what is asked: `result` is the plan as data, `path` its waypoints.

    reach: "latency(position)=1 ms, lever_arm(position)=1 cm".  separate: two effects to tell apart,
    the first as "latency(position)=100 ms" where its size is known, the second one or several.
    diagnosis: what one could not tell apart.  flown: a log held against what is asked.
    """
    from syncline_design.planning import run, setup, wanted
    from syncline_design.planning.fixed_targets import fixed_targets
    from syncline_design.verdict.pinned import as_measured

    seed = _seed(seed)
    least = arguments.amount("minutes", minutes, 0.0)
    pairs = () if separate is None else wanted.separate_of(*separate)
    asked = wanted.PlanWanted(() if reach is None else wanted.reach_of(reach), pairs)
    files = tuple(_files(flown))
    with _limited(time_limit_s):
        case = as_measured(_case(spec), seed)
        fixed = fixed_targets(case)
        return run.plan(case, setup.PlanRequest(asked, diagnosis, least, files, seed, fixed))


def study(
    path: str | Path, *, seed: int = 0, workers: int = 2, store: Path | None = None,
    scheduler: str | None = None, dask: bool = False, fresh: bool = False,
    today: date | None = None, time_limit_s: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> StudyResult:  # fmt: skip
    """A trade study run to its end; what an earlier run left in the store is not done again.

    With workers, call it under `if __name__ == "__main__":`, as they import the calling script.
    """
    from syncline_design import studies

    file = arguments.path("path", path)
    workers = arguments.whole("workers", workers, 1)
    arguments.day("today", today)
    settings = studies.StudySettings(_seed(seed), workers, store, scheduler, dask, today, fresh)
    with _limited(time_limit_s):
        return studies.run_study(file, settings, progress)


def diff(
    old: str | Path, new: str | Path, *, seed: int = 0, time_limit_s: float | None = None
) -> Diff:
    """What changed between two specs, or two verdicts written as JSON."""
    from syncline_design.comparison import diff as comparison
    from syncline_design.verdict.settings import CheckSettings

    files = arguments.path("old", old), arguments.path("new", new)
    with _limited(time_limit_s):
        return comparison.diff(*files, CheckSettings(_seed(seed)))


def timing(
    logs: str | Path | Sequence[str | Path], settings: TimingSettings | None = None, *,
    spec: SpecOrPath | None = None, seed: int = 0, time_limit_s: float | None = None,
) -> TimingAndSpec:  # fmt: skip
    """What logs of a clock bear out of its error, over sessions, with a stated claim.

    settings: `syncline_design.clocks.study.TimingSettings`.  spec: say what it means for it too.
    """
    from syncline_design.clocks.study import TimingSettings, study_logs
    from syncline_design.comparison.clock_meaning import timing_meaning, with_spec

    chosen, seed, files = settings or TimingSettings(), _seed(seed), _files(logs)
    with _limited(time_limit_s):
        found = study_logs(files, chosen)
        if spec is None:
            return with_spec(found.timing, None)
        means = timing_meaning(_case(spec), found, chosen.kind, "measured", seed)
        return with_spec(found.timing, means)


def audit(
    logs: str | Path | Sequence[str | Path], *, spec: SpecOrPath | None = None, seed: int = 0,
    time_limit_s: float | None = None,
) -> Audit:  # fmt: skip
    """Every fault of the stamps in logs, by name; spec: hold the streams against its tau_crit."""
    from syncline_design.auditing.run import audit as audit_files
    from syncline_design.comparison.stamp_meaning import held_against

    seed, files = _seed(seed), _files(logs)
    with _limited(time_limit_s):
        found = audit_files(files)
        return found if spec is None else held_against(found, _case(spec), seed)


def accept(
    spec: SpecOrPath, logs: str | Path | Sequence[str | Path],
    settings: AcceptSettings | None = None, *, seed: int = 0, time_limit_s: float | None = None,
) -> Acceptance:  # fmt: skip
    """Whether logs of the built system bear out what the verdict on a spec rests on.

    settings: `syncline_design.comparison.accept.AcceptSettings`.
    """
    from syncline_design.comparison import accept as acceptance

    files, seed = _files(logs), _seed(seed)
    with _limited(time_limit_s):
        return acceptance.accept(_case(spec), files, settings, seed=seed)


def watch(
    store: str | Path, spec: SpecOrPath, logs: str | Path | Sequence[str | Path] = (), *,
    false_alarm_rate: float = 0.05, seed: int = 0, time_limit_s: float | None = None,
) -> Watch:  # fmt: skip
    """Add a run, of one file or several, to those of a system, and say what changed since when.

    store: the file that keeps what each run says.  false_alarm_rate: over all looks at it.
    """
    from syncline_design.campaign import watching
    from syncline_design.diagnosis import DiagnosisSettings
    from syncline_design.verdict.pinned import as_measured

    rate = arguments.amount("false_alarm_rate", false_alarm_rate, *arguments.FALSE_ALARM_RATES)
    seed, kept = _seed(seed), arguments.path("store", store)
    request = watching.WatchRequest(kept, tuple(_files(logs)), rate)
    with _limited(time_limit_s):
        case = as_measured(_case(spec), seed)
        return watching.watch(case, request, DiagnosisSettings(seed=seed))


def reproduce(*, seed: int = 0, time_limit_s: float | None = None) -> Reproduction:
    """Every table and figure of the paper computed anew, beside what is printed."""
    from syncline_design.paper import reproduce as paper

    with _limited(time_limit_s):
        return paper.reproduce(seed=_seed(seed))
