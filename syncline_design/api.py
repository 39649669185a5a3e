"""What the commands do, as functions: `import syncline_design as sd; sd.check("specs/own.yaml")`.

Each takes what its command takes and returns a result as data; `time_limit_s` binds all of it, and
`seed` is that of every random number in it.  BadInput names everything that is wrong with a file;
OutOfTime (a NoVerdict) says that the time was over before anything could be concluded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from syncline_design.machine.deadline import NoVerdict, OutOfTime, within_s
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, load

if TYPE_CHECKING:
    from syncline_design.choice.outcome import Road
    from syncline_design.choice.table import ResourceName
    from syncline_design.comparison.difference import Difference
    from syncline_design.comparison.meaning import DiagnosisAndDesign
    from syncline_design.paper.reproduce import Reproduction
    from syncline_design.simulation import Simulation
    from syncline_design.studies import Progress, StudyResult
    from syncline_design.verdict.optimise import Optimisation
    from syncline_design.verdict.tree import Verdict

__all__ = [
    "BadInput",
    "Case",
    "NoVerdict",
    "OutOfTime",
    "check",
    "diagnose",
    "diff",
    "load",
    "optimize",
    "reproduce",
    "simulate",
    "study",
]

SpecOrPath = str | Path | Case  # a spec file, or one that was loaded before


def _case(spec: SpecOrPath) -> Case:
    return spec if isinstance(spec, Case) else load(spec)


def check(
    spec: SpecOrPath, *, seed: int = 0, method: Road = "auto", time_limit_s: float | None = None,
    monte_carlo: bool = True, today: date | None = None,
) -> Verdict:  # fmt: skip
    """The verdict on a spec.

    monte_carlo: whether to simulate (a requirement of that kind stays undecided without).  today:
    the day on which waivers are judged; None: the machine's date.
    """
    from syncline_design.verdict.verify import CheckSettings, check_loaded

    settings = CheckSettings(seed, method, monte_carlo=monte_carlo, today=today)
    with within_s(time_limit_s):
        return check_loaded(_case(spec), settings)


def optimize(
    spec: SpecOrPath, *, best: int = 1, every: bool = False, pareto: bool = False,
    resource: ResourceName = "cost", seed: int = 0, method: Road = "auto",
    time_limit_s: float | None = None,
) -> Optimisation:  # fmt: skip
    """The best designs of a spec, proven, and what they hinge on.

    best: how many designs that differ in a sensor; every: in anything.  pareto: the exact front of
    `resource` against the error too.
    """
    from syncline_design.verdict import optimise

    settings = optimise.OptimizeSettings(best, pareto, resource, method, seed=seed, every=every)
    with within_s(time_limit_s):
        return optimise.optimize(_case(spec), settings).result


def simulate(
    spec: SpecOrPath, *, seed: int = 0, samples: int | None = None, workers: int | None = None,
    time_limit_s: float | None = None,
) -> Simulation:  # fmt: skip
    """The nonlinear chain of a spec (its best design where something is open) simulated."""
    from syncline_design.verdict.simulated_spec import simulate_spec

    with within_s(time_limit_s):
        return simulate_spec(_case(spec), seed, samples, workers).result


def diagnose(
    spec: SpecOrPath, logs: Sequence[str | Path] = (), *, seed: int = 0,
    false_alarm_rate: float = 0.05, max_effects: int = 4, time_limit_s: float | None = None,
) -> DiagnosisAndDesign:  # fmt: skip
    """Where measured logs disagree with a spec, what is missing in it, what that means for it.

    logs: files; none: those that the spec names.
    """
    from syncline_design import diagnosis
    from syncline_design.comparison.meaning import as_measured, meaning, with_design

    settings = diagnosis.DiagnosisSettings(seed, false_alarm_rate, max_effects)
    with within_s(time_limit_s):
        case = _case(spec)
        found = diagnosis.diagnose(as_measured(case, seed), logs, settings)
        means = meaning(case, found.effects_entries(), seed)
        return with_design(found, means)


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

    settings = studies.StudySettings(seed, workers, store, scheduler, dask, today, fresh)
    with within_s(time_limit_s):
        return studies.run_study(path, settings, progress)


def diff(
    old: str | Path, new: str | Path, *, seed: int = 0, time_limit_s: float | None = None
) -> Difference:
    """What changed between two specs, or two verdicts written as JSON."""
    from syncline_design.comparison import diff as comparison
    from syncline_design.verdict.verify import CheckSettings

    with within_s(time_limit_s):
        return comparison.diff(old, new, CheckSettings(seed))


def reproduce(*, seed: int = 0, time_limit_s: float | None = None) -> Reproduction:
    """Every table and figure of the paper computed anew, beside what is printed."""
    from syncline_design.paper import reproduce as paper

    with within_s(time_limit_s):
        return paper.reproduce(seed=seed)
