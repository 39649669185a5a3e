"""Figures as files of their own, the designs around a front, who stamps whom."""

from __future__ import annotations

import struct
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

import report_samples as samples
from syncline_design.choice.table import Problem
from syncline_design.cli.app import app
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.rendered import chart_files
from syncline_design.report.verdict_charts import clocks_chart
from syncline_design.spec.load import load_text
from syncline_design.verdict import cloud as clouds
from syncline_design.verdict.named import CloudDesign
from syncline_design.verdict.settings import CheckSettings, build_of

NAMES = {"ledger", "timing", "histogram", "clocks", "syncline", "choice"}
SPEC = samples.PINNED.replace("monte_carlo: {samples: 2000}\n", "").replace(
    "  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 0.30 m}\n", ""
)


def run(*words: object) -> tuple[int, str]:
    found = CliRunner().invoke(app, ["check", *map(str, words)])
    return found.exit_code, " ".join(found.output.split())


def test_each_figure_is_a_file_that_stands_alone() -> None:
    documents = {"": on_verdict(samples.fixed_wing())}
    drawings = dict(chart_files(documents, "svg"))
    pictures = dict(chart_files(documents, "png"))
    assert set(drawings) == {f"{name}.svg" for name in NAMES}
    assert set(pictures) == {f"{name}.png" for name in NAMES}
    for name, content in drawings.items():
        root = ElementTree.fromstring(content)
        width, height = (float(root.attrib[key].removesuffix("pt")) for key in ("width", "height"))
        assert b"var(" not in content
        assert b"<text" in content  # words stay words
        picture = pictures[name.replace("svg", "png")]
        assert picture.startswith(b"\x89PNG")
        assert struct.unpack(">II", picture[16:24]) == (int(3 * width), int(3 * height))
    assert chart_files(documents, "svg")[0][1] == drawings["ledger.svg"]  # the same every time


def test_folders_of_figures_are_written_and_refused(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC, encoding="utf-8")
    both = tmp_path / "both"
    code, said = run(spec, "-q", "-o", f"svg:{both}", "-o", f"png:{both}/")
    assert (code, said) == (1, "")
    names = sorted(path.name for path in both.iterdir())
    kinds = ("clocks", "histogram", "ledger", "syncline", "timing")
    assert names == sorted(f"{name}.{kind}" for name in kinds for kind in ("svg", "png"))
    for wrong, word in (
        ("svg", "expected svg:FOLDER"),
        ("png:-", "expected png:FOLDER"),
        (f"svg:{spec}", "is no folder"),
        (f"png:{spec}/in", "not a folder"),
    ):
        code, said = run(spec, "-q", "-o", wrong)
        assert code == 2, wrong
        assert word in said


def test_figures_of_several_specs_keep_apart(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "spec.yaml").write_text(SPEC, encoding="utf-8")
    out = tmp_path / "figures"
    run(tmp_path / "one" / "spec.yaml", tmp_path / "two" / "spec.yaml", "-q", "-o", f"svg:{out}")
    names = {path.name for path in out.iterdir()}
    assert {"spec-ledger.svg", "spec-2-ledger.svg"} <= names
    assert len(names) == 10


def undominated(found: tuple[CloudDesign, ...]) -> list[tuple[float, float]]:
    """Cheapest with each error, by comparing all with all."""
    kept = {(one.cost, one.error_m) for one in found if not one.breaks}
    return sorted(
        (cost, error) for cost, error in kept
        if not any(c <= cost and e <= error and (c, e) != (cost, error) for c, e in kept)
    )  # fmt: skip


def problem_of(monte_carlo: bool) -> Problem:
    return build_of(CheckSettings(1, monte_carlo=monte_carlo))(
        load_text(samples.OPEN, samples.FILE)
    )


@pytest.mark.parametrize("simulated", [False, True])
def test_the_front_is_that_of_all_designs_around_it(simulated: bool) -> None:
    """The solver's front against plain comparison of every design; no dot lies below it."""
    verdict = samples.fixed_wing() if simulated else samples.checked(samples.OPEN, False)
    assert verdict.choice is not None
    problem, points = problem_of(simulated), verdict.choice.front or ()
    found = clouds.cloud(problem, points)
    assert len(found) == problem.combinations == int(verdict.spec.combinations or "0")
    front = sorted((one.cost or 0.0, one.error_m) for one in points)
    assert undominated(found) == [pytest.approx(point, rel=1e-12) for point in front]
    assert any(one.breaks == (clouds.SIMULATED,) for one in found) == simulated


def test_of_many_designs_some_are_drawn_each_once(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(False)
    every = clouds.cloud(problem)
    monkeypatch.setattr(clouds, "MOST", 20)
    some = clouds.cloud(problem)
    assert len(some) == 20
    assert set(some) <= set(every)
    assert some == clouds.cloud(problem)


def test_every_arrow_ends_at_the_clock_of_its_timeline() -> None:
    """A chain: a GNSS by UTC aboard the vessel, the rest by their hosts, each with its tau."""
    verdict = samples.two_stages()
    assert verdict.design is not None
    (chart,) = clocks_chart(verdict)
    told = chart.draw().told  # type: ignore[union-attr]
    by_sensor = {one.says["Sensor"]: one for one in told}
    ends = {"UTC": set(), "the host clock": set()}  # type: ignore[var-annotated]
    for stage, role, one in verdict.design.roles:
        says = by_sensor[f"{stage.name} \u00b7 {role}: {one.name}"].says
        ends[says["In the time of"]].add(one.timeline)
        assert says["Stamped by"] == one.timestamping_name
        assert says["\u03c4"].split("\u00a0")[0] == f"{_scaled(one.tau_s):.4g}"
    assert ends == {"UTC": {"utc"}, "the host clock": {"host"}}
    for clock in verdict.design.clocks:
        assert by_sensor[f"host clock of {clock.vehicle}"].says["Stamped by"] == clock.name


def _scaled(tau_s: float) -> float:
    """In the largest of s, ms, us, ns in which it is 1 or more."""
    return next(tau_s * k for k in (1.0, 1e3, 1e6, 1e9) if tau_s * k >= 0.9995)
