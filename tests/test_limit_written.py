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


# a quarter of a metre beside a word for a limit, in another unit; bare it may be a tick of an axis
OTHERWISE = re.compile(r"(limit|target|of|keeps|at|from|where|is) (250 mm|25 cm|0\.25 m\b)", re.I)


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
    document = json.loads(texts.pop("json"))
    rows = document["requirements"]
    within = document["monte_carlo"]["probability_within_target"]
    assert (within["target_m"], within["limit_written"]) == (0.25, "0.250 m")
    held = next(row for row in rows if row["kind"] == "accuracy")
    assert (held["limit"], held["limit_written"]) == (0.25, "0.250 m")
    assert [row["kind"] for row in rows if "limit_written" in row] == ["accuracy"]
    value = f"{held['value']:.4g} m"
    for name, text in {**texts, "console": plain(done.stdout)}.items():
        assert "0.250 m" in text, name
        assert value in text, name
        assert not OTHERWISE.search(text), name
    charts = re.findall(r"<svg.*?</svg>", texts["html"], flags=re.DOTALL)
    said = [chart for chart in charts if "limit 0.250 m" in chart or "limit is 0.250 m" in chart]
    assert len(said) == 3  # the Syncline, the ledger, the distribution


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


ODD = """\
syncline: 1
name: odd units
requirements:
  - {id: ACC-1, kind: accuracy, limit: 25.0 cm}
  - {id: MASS-1, kind: mass, limit: 1900 g}
  - {id: COST-1, kind: cost, limit: 40000.00 EUR}
monte_carlo: {samples: 500}
stages:
  - name: usv
    platform: usv
    position: {sensor: ublox_f9p_rtk, primitive: tov, timestamping: gpio}
    attitude: {candidates: [sbg_ellipse, sbg_apogee], timestamping: gpio}
    ranging: {sensor: velodyne_hdl32e, primitive: pps, timestamping: gpio}
"""
STUDY = """\
study: 1
name: odd units
base: [odd.yaml]
grid: {"requirements[ACC-1].limit": [25.0 cm, 5.00 cm]}
check: {monte_carlo: false}
"""
COMMANDS = {
    "check": ["check", "odd.yaml", "--explain", "ACC-1"],
    "optimize": ["optimize", "odd.yaml", "--why-not", "sbg_apogee", "--pareto"],
    "refused": ["optimize", "tight.yaml", "--why-not", "sbg_ellipse"],
    "infeasible": ["check", "tight.yaml"],
    "diff": ["diff", "odd.yaml", "tight.yaml"],
    "study": ["study", "study.yaml", "--workers", "1"],
}
FORMATS = {
    "check": ("html", "markdown", "junit", "sarif", "github", "svg"),
    "infeasible": ("html", "markdown", "junit", "sarif", "github"),
    "diff": ("html", "markdown", "github"),
    "study": ("html", "markdown", "junit"),  # notices are of cases that fail alone
}
ELSE = re.compile(
    r"(?<![\d.])(250 mm|0\.25 m|25 cm|0\.250 m|5 cm|50 mm|0\.05 m|1\.9 kg|1900\.0|0\.5 kg)(?![\w/])"
)


def _texts(name: str, folder: Path) -> dict[str, str]:
    """What a command prints and writes, a text a format; the ticks of axes taken out."""
    formats = FORMATS.get(name, ("html",))
    outputs = [word for kind in formats for word in ("-o", f"{kind}:{folder / name}-{kind}")]
    done = CliRunner().invoke(app, [*COMMANDS[name], *outputs])
    assert done.exit_code in (0, 1), done.output
    texts = {"console": done.stdout}
    for kind in formats:
        path = folder / f"{name}-{kind}"
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        texts[kind] = "\n".join(file.read_text(encoding="utf-8") for file in files)
    ticks = re.compile(r'<g id="[^"]*(?:x|y)tick_\d+">.*?</text>', re.DOTALL)
    return {kind: plain(ticks.sub("", text)) for kind, text in texts.items()}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_says_a_limit_as_the_spec_does(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("odd.yaml").write_text(ODD, encoding="utf-8")
    tight = ODD.replace("25.0 cm", "5.00 cm").replace("1900 g", "500 g")
    Path("tight.yaml").write_text(tight, encoding="utf-8")
    Path("study.yaml").write_text(STUDY, encoding="utf-8")
    limit = "5.00 cm" if "tight.yaml" in COMMANDS[name] else "25.0 cm"
    for kind, text in _texts(name, tmp_path).items():
        assert limit in text, kind
        assert not [m.group() for m in ELSE.finditer(re.sub(r"\s+", " ", text))], kind
