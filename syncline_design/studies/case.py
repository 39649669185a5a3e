"""One case of a study: its key, and the record that the check of it leaves."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from importlib import metadata
from pathlib import Path
from typing import Any

from syncline_design import __version__
from syncline_design.machine.input_files import ReplacedInputError, noting
from syncline_design.spec.case import Case
from syncline_design.spec.keys import plain
from syncline_design.spec.load import BadInput, without_simulated
from syncline_design.spec.yaml_text import Problem
from syncline_design.studies.inputs import inputs_of
from syncline_design.studies.loading import Base, Study

Json = dict[str, Any]
SCHEMA = "syncline-design/study-case/v1"
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


def canonical(data: Any) -> str:
    """JSON of one form only: sorted keys, no spaces, ASCII, no NaN."""
    return json.dumps(
        data, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False
    )


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


def check_case(study: Study, index: int, settings: CaseSettings) -> Json:
    """The record of one case; what goes wrong inside it is part of the record.

    `inputs`: the files that it read besides spec and catalogs, with what was in them.
    """
    place, chosen = study.case(index)
    base = study.bases[place]
    with noting() as found:
        record = _judged(study, base, chosen, settings)
    inputs = inputs_of(found, base.path.parent)
    return record | {"inputs": inputs} if inputs else record


def _judged(
    study: Study, base: Base, chosen: Sequence[tuple[str, Any]], settings: CaseSettings
) -> Json:
    from syncline_design.choice.outcome import NoVerdict
    from syncline_design.simulation import SimulationError

    try:
        case = base.load(chosen)
        return _checked(study, base, case, settings)
    except ReplacedInputError:
        raise
    except BadInput as bad:
        return {"verdict": "refused", "problems": [_problem_json(p) for p in bad.problems]}
    except (NoVerdict, SimulationError) as error:
        return {"verdict": "indeterminate", "reason": str(error)}
    except Exception as error:  # one broken case must not take the others with it
        return {"verdict": "indeterminate", "reason": f"{type(error).__name__}: {error}"}


def _checked(study: Study, base: Base, case: Case, settings: CaseSettings) -> Json:
    from syncline_design.verdict.verify import CheckSettings, check_loaded

    simulated = simulates(study, base)
    left_out = () if simulated else base.simulated
    check = study.check
    verdict = check_loaded(
        without_simulated(case) if left_out else case,
        CheckSettings(
            seed=settings.seed,
            method=check.method,
            time_limit_s=None if check.time_limit is None else float(check.time_limit),
            monte_carlo=simulated,
            today=settings.today,
        ),
    ).to_json()
    record = _record(verdict, left_out)
    proof = (verdict.get("choice") or {}).get("proof") or {}
    if proof.get("optimal") is False:  # as far as this machine came within the time limit
        record["provisional"] = True
    return record


def _problem_json(problem: Problem) -> Json:
    return {
        "file": problem.file,
        "line": problem.line,
        "column": problem.column,
        "path": problem.path,
        "message": str(problem).partition(": ")[2],
    }


_SYNCLINE = (
    "model", "sensor_error_m", "sync_rate_mps", "tau_s", "tau_crit_s", "sync_error_m",
    "systematic_error_m", "total_m",
)  # fmt: skip


def _record(verdict: Json, left_out: tuple[str, ...]) -> Json:
    """What a study keeps of a verdict: all that its tables and findings need, no more."""
    syncline = verdict.get("syncline")
    record: Json = {
        "verdict": verdict["verdict"],
        "requirements": verdict.get("requirements") or [],
        "design": verdict.get("design"),
        "syncline": None if syncline is None else {k: syncline.get(k) for k in _SYNCLINE},
        "front": [
            {"cost": point["cost"], "error_m": point["error_m"]}
            for point in (verdict.get("choice") or {}).get("front") or []
        ],
        "infeasibility": verdict.get("infeasibility"),
        "not_simulated": list(left_out),
    }
    if verdict.get("reason"):
        record["reason"] = verdict["reason"]
    return record


def is_final(record: Json) -> bool:
    """Whether the same case would come out the same again: not after a time limit or a crash."""
    if record.get("provisional"):
        return False
    return not (record["verdict"] == "indeterminate" and record.get("reason"))
