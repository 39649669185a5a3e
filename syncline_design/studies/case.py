"""One case of a study: its key, and the record that the check of it leaves."""

from __future__ import annotations

import contextlib
import hashlib
import platform
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from importlib import metadata
from pathlib import Path
from typing import Any

from syncline_design import __version__
from syncline_design.machine.deadline import NoVerdict, within_s
from syncline_design.machine.input_files import ReplacedInputError, noting
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.simulation import SimulationError
from syncline_design.spec.case import Case
from syncline_design.spec.keys import plain
from syncline_design.spec.load import BadInput, without_simulated
from syncline_design.spec.yaml_text import Flaw
from syncline_design.studies.inputs import canonical, inputs_of
from syncline_design.studies.loading import Base, Study
from syncline_design.studies.record import SCHEMA, CaseFigures, CasePoint, CaseRecord, lost
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.syncline_figures import SynclineFigures
from syncline_design.verdict.tree import FileProblem, Verdict

# Layers that a check cannot import: they show its results.
ABOVE_CHECKS = ("__main__.py", "cli", "comparison", "diagnosis", "logs", "paper", "report")


@dataclass(frozen=True, slots=True)
class CaseSettings:
    """What every case of a run shares besides the study itself."""

    seed: int
    today: date
    engine: str  # hash of the package's sources
    libraries: tuple[str, ...] = ()  # what computes besides: names with versions

    @classmethod
    def now(cls, seed: int, today: date | None) -> CaseSettings:
        """Settings of a run that starts now."""
        return cls(seed, today or date.today(), engine_sha256(), libraries())


LIBRARIES = ("numpy", "scipy", "cvxpy", "highspy", "pydantic", "PyYAML", "pymap3d")


def libraries() -> tuple[str, ...]:
    """The interpreter and the libraries whose arithmetic or reading enters a verdict."""
    found = [f"python {platform.python_version()} {platform.machine()}"]
    for name in LIBRARIES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found.append(f"{name} {metadata.version(name)}")
    return tuple(found)


def engine_sha256() -> str:
    """Hash of the sources that a check runs through: other code, other cases."""
    digest = hashlib.sha256()
    root = Path(__file__).resolve().parent.parent
    for file in sorted(root.rglob("*.py")):
        if file.relative_to(root).parts[0] in ABOVE_CHECKS:
            continue
        digest.update(file.relative_to(root).as_posix().encode())
        digest.update(b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def case_keys(study: Study, settings: CaseSettings) -> list[str]:
    """The content address of every case, in order: equal content, equal key.

    SHA-256 over the base spec's text, its catalogs, what is set in it, how it is checked, the
    seed, this version with the libraries below it and, where waivers expire, the day.  Other files
    that a case reads come in when it is known which (`inputs.full_key`).
    """
    heads = [_head(study, base, settings) for base in study.bases]
    return [_key(heads, study, index) for index in range(len(study))]


def _head(study: Study, base: Base, settings: CaseSettings) -> str:
    check = study.check
    return canonical(
        {
            "schema": SCHEMA,
            "version": __version__,
            "engine": settings.engine,
            "spec": base.document.sha256,
            "catalogs": base.catalogs.sha256(),
            "libraries": settings.libraries,
            "seed": settings.seed,
            "method": check.method,
            "time_limit_s": None if check.time_limit is None else float(check.time_limit),
            "monte_carlo": simulates(study, base),
            "today": settings.today.isoformat() if base.has_waivers else None,
        }
    )


def _key(heads: list[str], study: Study, index: int) -> str:
    base, chosen = study.case(index)
    paths = study.bases[base].paths
    settings = sorted((list(map(str, paths[key])), plain(value)) for key, value in chosen)
    content = heads[base] + canonical(settings)
    return hashlib.sha256(content.encode("ascii")).hexdigest()


def simulates(study: Study, base: Base) -> bool:
    """Whether cases of a base run Monte Carlo: as the study says, else where it is required."""
    asked = study.check.monte_carlo
    return bool(base.simulated) if asked is None else asked


def check_case(study: Study, index: int, settings: CaseSettings) -> CaseRecord:
    """The record of one case; what goes wrong inside it is part of the record.

    `inputs`: the files that it read besides spec and catalogs, with what was in them.
    """
    place, chosen = study.case(index)
    base = study.bases[place]
    with noting() as found:
        record = _judged(study, base, chosen, settings)
    return replace(record, inputs=inputs_of(found, base.path.parent))


def _judged(
    study: Study, base: Base, chosen: Sequence[tuple[str, Any]], settings: CaseSettings
) -> CaseRecord:
    try:
        case = base.load(chosen)
        return _checked(study, base, case, settings)
    except ReplacedInputError:
        raise
    except BadInput as bad:
        return CaseRecord(verdict="refused", problems=tuple(map(_problem, bad.problems)))
    except (NoVerdict, SimulationError) as error:
        return lost(str(error))
    except Exception as error:  # one broken case must not take the others with it
        return lost(f"{type(error).__name__}: {error}")


def _checked(study: Study, base: Base, case: Case, settings: CaseSettings) -> CaseRecord:
    # only where a case is computed: a study whose cases are all there starts at once
    from syncline_design.verdict.settings import CheckSettings
    from syncline_design.verdict.verify import check_loaded

    simulated = simulates(study, base)
    left_out = () if simulated else base.simulated
    check = study.check
    wanted = CheckSettings(
        seed=settings.seed, road=check.method, monte_carlo=simulated, today=settings.today,
        brief=True,
    )  # fmt: skip
    with within_s(None if check.time_limit is None else float(check.time_limit)):
        verdict = check_loaded(without_simulated(case) if left_out else case, wanted)
    return _record(verdict, left_out)


def _problem(problem: Flaw) -> FileProblem:
    message = str(problem).partition(": ")[2].removeprefix(f"{problem.path}: ")
    return FileProblem(problem.file, problem.line, problem.column, problem.path, message)


def _record(verdict: Verdict, left_out: tuple[str, ...]) -> CaseRecord:
    """What a study keeps of a verdict."""
    choice = verdict.choice or ChoiceResult()
    return CaseRecord(
        verdict=verdict.verdict,
        requirements=verdict.requirements,
        design=verdict.design,
        syncline=None if verdict.syncline is None else _figures(verdict.syncline),
        front=tuple(CasePoint(p.cost, p.error_m) for p in choice.front or () if p.cost is not None),
        infeasibility=verdict.infeasibility,
        not_simulated=left_out,
        provisional=choice.proof is not None and not choice.proof.optimal,
    )


def _figures(whole: SynclineFigures) -> CaseFigures:
    return CaseFigures(
        whole.model, whole.sensor_error_m, whole.sync_rate_mps, whole.tau_s, whole.tau_crit_s,
        whole.sync_error_m, whole.systematic_error_m, whole.total_m,
    )  # fmt: skip
