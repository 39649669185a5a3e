"""Two logs with a latency of opposite sign: each has its value, and none is told for both.

Oracle: the values that the logs were made with, and Cramer-Rao bounds of the hidden world.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.cli.app import app
from syncline_design.diagnosis.consequence import Weights
from syncline_design.model.known import EffectEntry
from syncline_design.spec.load import load
from tests.world import hidden, make_log, scenario

LATE_S = (0.014, -0.013)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("disagree")
    for k, late in enumerate(LATE_S):
        run = scenario("multirotor_lines", 6000 + k, 30.0, 5.0)
        log = make_log(run, (hidden("latency", "position", latency_s=late),))
        log.to_csv(folder / f"log{k}.csv")
        (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    return folder


def test_each_log_has_its_value_and_no_common_one_is_told(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged: list[float] = []
    own = Weights.material

    def material(self: Weights, size_m: float, entry: EffectEntry) -> bool:
        judged.extend(float(value) for _, value in entry.parameters)
        return own(self, size_m, entry) and False

    logs = tuple(folder / f"log{k}.csv" for k in range(2))
    monkeypatch.setattr(Weights, "material", material)
    (found,) = diagnose_joint(load(folder / "spec.yaml"), JointRequest(logs)).findings
    assert (found.effect, found.scope) == ("latency", "log")
    assert found.per_log is not None
    for one, true in zip(found.per_log, LATE_S, strict=True):
        told = one.parameters["latency_s"]
        assert abs(float(told.value) - true) < 4.0 * (told.standard_uncertainty or 0.0) < 5e-3
        assert any(value == pytest.approx(float(told.value)) for value in judged[-2:])
        assert one.file in found.sentence
        assert told.text.lstrip("-").split()[0] in found.sentence
    low, high = sorted(float(one.parameters["latency_s"].value) * 1e3 for one in found.per_log)
    first, last = found.parameters["latency_s"].text.split(" to ")
    assert float(first.split()[0]) == pytest.approx(low, abs=0.06)
    assert float(last.split()[0]) == pytest.approx(high, abs=0.06)


def test_the_words_have_no_figure_that_nobody_can_use(folder: Path) -> None:
    arguments = ["diagnose", *(str(folder / n) for n in ("spec.yaml", "log0.csv", "log1.csv"))]
    said = " ".join(CliRunner().invoke(app, [*arguments, "--joint"]).output.split())
    assert "The logs disagree, another value in every log: log0.csv: position data are" in said
    assert "younger than their stamps" in said
    spreads = [float(part.split()[0]) for part in said.split("± ")[1:]]
    assert max(spreads) < 100.0  # of milliseconds and microseconds none is 13440
