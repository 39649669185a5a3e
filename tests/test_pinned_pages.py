"""Every page whose figures rest on a spec names its content, the catalogs', and the seed."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import pytest

import syncline_design as sd
from clock_logs import tracking, write
from syncline_design.comparison.acceptance import Acceptance, AcceptedSpec
from syncline_design.report.document import Document, Facts, Span
from syncline_design.report.on_acceptance import on_acceptance
from syncline_design.report.on_audit import on_audit
from syncline_design.report.on_diff import on_diff
from syncline_design.report.on_simulation import on_simulation
from syncline_design.report.on_timing import on_timing

SPECS = Path(__file__).resolve().parent.parent / "specs"
TRACK = SPECS / "position_track.yaml"
HASH = hashlib.sha256(TRACK.read_bytes()).hexdigest()


def pins(document: Document) -> dict[str, str]:
    """The last lines of a report."""
    (last,) = [one for one in document.sections if one.title == "Provenance"]
    (facts,) = [node for node in last.nodes if isinstance(node, Facts)]
    return {name: told.text if isinstance(told, Span) else str(told) for name, told in facts.pairs}


@pytest.mark.parametrize("seed", [0, 7])
def test_a_simulation_is_pinned(seed: int) -> None:
    found = pins(on_simulation(sd.simulate(TRACK, samples=500, seed=seed)))
    catalogs = sd.load(TRACK).catalogs_sha256
    wanted = {"Spec, SHA-256": HASH, "Catalogs, SHA-256": catalogs, "Seed": str(seed)}
    assert wanted.items() <= found.items()
    assert found["syncline-design"] == sd.__version__


def test_both_sides_of_a_difference_are_pinned(tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    text = TRACK.read_text("utf-8").replace("limit: 3 cm", "limit: 4 cm")
    assert text != TRACK.read_text("utf-8")
    other.write_text(text, "utf-8")
    found = pins(on_diff(sd.diff(TRACK, other)))
    assert found["Before: Spec, SHA-256"] == HASH
    assert found["Now: Spec, SHA-256"] == hashlib.sha256(other.read_bytes()).hexdigest()
    assert found["Now: Seed"] == "0"


def test_an_acceptance_is_pinned() -> None:
    verdict = sd.check(TRACK, monte_carlo=False)
    spec = AcceptedSpec(verdict.name, verdict.file, verdict.verdict, verdict.provenance)
    result = Acceptance(
        verdict="holds", spec=spec, asked=(), assumptions=(), evidence=(), notes=(),
        version=sd.__version__, seed=0,
    )  # fmt: skip
    assert pins(on_acceptance(result))["Spec, SHA-256"] == HASH


def stamps(folder: Path) -> Path:
    """Messages at 10 Hz that are received a millisecond after their stamps."""
    rows = [f"{1.7e9 + 0.1 * k:.6f},{1.7e9 + 0.1 * k + 1e-3:.6f}" for k in range(200)]
    return write(folder / "position.csv", ["stamp_s,receive_s", *rows])


def clock(folder: Path) -> Path:
    """A morning of a clock that is half a microsecond late, give or take."""
    times = [1.7e9 + 16.0 * k for k in range(120)]
    late = [5e-7 + 1e-7 * math.sin(k) for k in range(120)]
    return write(folder / "tracking.log", tracking(times, late))


@pytest.mark.parametrize("seed", [0, 7])
def test_what_is_held_against_a_spec_is_pinned_by_it(tmp_path: Path, seed: int) -> None:
    wanted = {
        "Spec file": str(TRACK), "Spec, SHA-256": HASH, "Seed": str(seed),
        "Catalogs, SHA-256": sd.load(TRACK).catalogs_sha256, "syncline-design": sd.__version__,
    }  # fmt: skip
    assert pins(on_audit(sd.audit(stamps(tmp_path), spec=TRACK, seed=seed))) == wanted
    timed = pins(on_timing(sd.timing(clock(tmp_path), spec=TRACK, seed=seed)))
    assert wanted.items() <= timed.items()


def test_what_no_spec_was_asked_for_is_pinned_by_the_version(tmp_path: Path) -> None:
    assert pins(on_audit(sd.audit(stamps(tmp_path)))) == {"syncline-design": sd.__version__}
    assert pins(on_timing(sd.timing(clock(tmp_path)))) == {"syncline-design": sd.__version__}
