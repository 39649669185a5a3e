"""What `accept` says of a known log and of diagnoses made from its own, for several test files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from syncline_design.cli.app import app
from syncline_design.comparison import accept as acceptance
from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.comparison.acceptance import (
    NAMES,
    Acceptance,
    AssumptionName,
    AssumptionResult,
)
from syncline_design.comparison.assumptions import assumptions
from syncline_design.comparison.by_log import by_log
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.instead import InItsPlace
from syncline_design.diagnosis.noise_split import NoiseFactor, NoiseFactors
from syncline_design.diagnosis.result import (
    Diagnosis,
    Estimate,
    Rival,
)
from syncline_design.diagnosis.run import diagnose
from syncline_design.spec.case import Case
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "examples" / "hidden_latency.yaml"
LATENCY_S = 0.087  # of the position data in the example's log
ROWS = 1000


AS_SPECIFIED = {
    f"multirotor/{role}": NoiseFactors((NoiseFactor(1.0, 0.99, 1.01),)) for role in
    ("position", "attitude", "ranging")
}  # fmt: skip


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def first_rows(folder: Path) -> Path:
    """The first rows of the example's log, as a log of their own."""
    path = folder / "short.csv"
    lines = EXAMPLE.with_suffix(".csv").read_text("utf-8").splitlines(keepends=True)
    path.write_text("".join(lines[: ROWS + 1]), "utf-8")
    return path


@cache
def found_in_first_rows() -> Diagnosis:
    """Their diagnosis, made once a process."""
    with tempfile.TemporaryDirectory() as folder:
        return diagnose(load(EXAMPLE), [first_rows(Path(folder))])


def rows_of(result: Acceptance) -> dict[tuple[str, str], AssumptionResult]:
    return {(row.role, row.assumption): row for row in result.assumptions}


def judged(case: Case, found: Diagnosis) -> Iterator[tuple[tuple[str, str], Judgement]]:
    verdict = check_loaded(case, CheckSettings(monte_carlo=False))
    log = LogEvidence(found, OnPaper.beside(case, found, seed=0), case.stages[-1].choice.name)
    for one in assumptions(case, verdict):
        yield (one.role, one.name), by_log(one, log)


def seen_as(found: Diagnosis, short: Path, only: tuple[AssumptionName, ...] = NAMES,
            instead: tuple[InItsPlace, ...] = (),
            ends_s: tuple[float, float] | None = None) -> Acceptance:  # fmt: skip
    """What is said of a log whose diagnosis is this one."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            acceptance,
            "sighted",
            lambda *_: Sighted(found, instead=instead, ends_s=ends_s, factors=AS_SPECIFIED),
        )
        return accept(load(EXAMPLE), [short], AcceptSettings(only), seed=0)


def aliased(found: Diagnosis, *others: Rival) -> Diagnosis:
    """The same with a delay of the position that these explain as well."""
    (finding,) = [f for f in found.findings if f.effect == "latency"]
    return replace(found, findings=(replace(finding, aliases=others, probability=0.6),))


def rival(effect: str, sensor: str, probability: float, **figures: float) -> Rival:
    told = {
        name: Estimate(value, 0.1 * abs(value), name.rpartition("_")[2], True, "", (value, value))
        for name, value in figures.items()
    }
    return Rival(effect, sensor, "multirotor", 1.0, 0.1, probability=probability, parameters=told)
