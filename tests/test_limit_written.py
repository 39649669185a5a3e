"""A requirement is shown in the unit in which the spec writes its limit, in every output."""

from __future__ import annotations

import dataclasses
import json
import re
from decimal import Decimal
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.report import numbers
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import RequirementResult, Verdict
from tests.checked import check_file

ROOT = Path(__file__).parent.parent
SPEC = (ROOT / "specs" / "usv_wire_missing.yaml").read_text(encoding="utf-8")
METRES = {"m": Decimal(1), "cm": Decimal("0.01"), "mm": Decimal("0.001"), "km": Decimal(1000)}


def verdict_of(folder: Path, limit: str) -> Verdict:
    path = folder / "own.yaml"
    path.write_text(SPEC.replace("limit: 0.25 m", f"limit: {limit}"), encoding="utf-8")
    verdict = check_file(path, CheckSettings(monte_carlo=False))
    assert isinstance(verdict, Verdict)
    return verdict


def accuracy(verdict: Verdict) -> RequirementResult:
    return next(row for row in verdict.requirements if row.kind == "accuracy")


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ").replace("\\u00a0", " ")


@pytest.mark.parametrize("limit", ["0.250 m", "25.0 cm", "2500 mm"])
def test_the_limit_stands_as_written_and_the_value_in_its_unit(tmp_path: Path, limit: str) -> None:
    row = accuracy(verdict_of(tmp_path, limit))
    assert (row.limit_written, plain(numbers.limit(row))) == (limit, limit)
    shown, unit = plain(numbers.held(row.value, row)).split()
    assert unit == limit.split()[1]
    assert row.value is not None
    assert abs(Decimal(shown) * METRES[unit] / Decimal(row.value) - 1) < Decimal("2e-3")


def test_every_text_says_it_and_json_keeps_si(tmp_path: Path) -> None:
    spec = tmp_path / "own.yaml"
    spec.write_text(SPEC.replace("limit: 0.25 m", "limit: 0.250 m"), encoding="utf-8")
    kinds = ("json", "html", "markdown", "junit", "sarif", "github")
    outputs = [word for kind in kinds for word in ("-o", f"{kind}:{tmp_path / kind}")]
    done = CliRunner().invoke(app, ["check", str(spec), *outputs])
    assert done.exit_code == 1
    texts = {kind: plain((tmp_path / kind).read_text(encoding="utf-8")) for kind in kinds}
    rows = json.loads(texts.pop("json"))["requirements"]
    held = next(row for row in rows if row["kind"] == "accuracy")
    assert (held["limit"], held["limit_written"]) == (0.25, "0.250 m")
    assert [row["kind"] for row in rows if "limit_written" in row] == ["accuracy"]
    value = f"{held['value']:.4g} m"
    for name, text in {**texts, "console": plain(done.stdout)}.items():
        text = re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL)  # charts have axes of their own
        assert "0.250 m" in text, name
        assert value in text, name
        assert not re.search(r"(limit|target|of|keeps) 250 mm", text), name


@pytest.mark.parametrize(
    "text", ["0.26 m", "0.25", "0.25 s", "0.25 m +/- 1 %", "\x1b[31m0.25 m", "<b>", ""]
)
def test_a_file_that_says_another_limit_is_shown_by_its_figure(tmp_path: Path, text: str) -> None:
    row = dataclasses.replace(accuracy(verdict_of(tmp_path, "0.25 m")), limit_written=text)
    assert plain(numbers.limit(row)) == "250 mm"
    assert plain(numbers.held(row.value, row)) == "447.4 mm"


def test_what_the_unit_would_hide_is_shown_in_its_own(tmp_path: Path) -> None:
    row = accuracy(verdict_of(tmp_path, "0.25 m"))
    assert plain(numbers.held(2.4e-6, row)) == "2.4 \N{MICRO SIGN}m"
    assert plain(numbers.held(0.0, row)) == "0 m"
    assert numbers.held(None, row) == numbers.MISSING
