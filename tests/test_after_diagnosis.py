"""What a finding means for the design: by each model and simulated, over a stated horizon."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from diagnosis_samples import diagnosis
from syncline_design.cli.app import app
from syncline_design.comparison.meaning import DesignMeaning, meaning
from syncline_design.model.figure_text import format_duration
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.spec.load import load_text
from syncline_design.spec.spec import EffectChoice

ROOT = Path(__file__).resolve().parent.parent
V, W, D = 6.0, np.radians(40.0), 30.0  # m/s, rad/s, m
SIGMA_P, SIGMA_A, SIGMA_R, SIGMA_U = 0.01, np.radians(0.1), 0.02, np.radians(0.05)
SPEC = """\
syncline: 1
name: Oracle
requirements: [{id: ACC-1, kind: accuracy, limit: 0.5 m}]
HORIZONstages:
  - name: uav
    platform: {name: x, v_max: 6 m/s, omega_max: 40 deg/s, distance: 30 m, baseline: 0 m}
    position: {sensor: {modality: position, sigma_position: 1 cm, primitives: [pps]}, ERROR}
    attitude: {sensor: {modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps]}, ERROR}
    ranging:
      sensor: {modality: ranging, sigma_range: 2 cm, sigma_bearing: 0.05 deg, primitives: [pps]}
      ERROR
monte_carlo: {samples: 40000}
""".replace(
    "ERROR",
    "primitive: pps, timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}",
).replace("      primitive: pps, timestamping", "      primitive: pps\n      timestamping")


def of(effect: str, parameters: dict[str, float], horizon: str = "") -> DesignMeaning:
    text = SPEC.replace("HORIZON", f"horizon: {horizon}\n" if horizon else "")
    entry = EffectChoice(
        effect=effect, sensor="position", stage="uav", parameters=parameters, source="diagnose"
    )
    found = meaning(load_text(text, ROOT / "specs" / "x.yaml"), (entry,), seed=0)
    assert found is not None
    return found


def added(found: DesignMeaning) -> dict[str, float]:
    rows = {one.figure: one for one in found.figures}
    return {key: (one.after_m or 0.0) - (one.before_m or 0.0) for key, one in rows.items()}


def unit_vectors(rng: np.random.Generator, count: int) -> Any:
    drawn = rng.normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def simulated_quantile(latency_s: float, seed: int = 5, count: int = 400_000) -> float:
    """The 95 % quantile from the measurement equations, to first order, drawn here anew."""
    rng = np.random.default_rng(seed)
    line = unit_vectors(rng, count)
    error = latency_s * V * unit_vectors(rng, count) + SIGMA_P * rng.normal(size=(count, 3))
    error += D * np.cross(SIGMA_A * rng.normal(size=(count, 3)), line)
    error += SIGMA_R * rng.normal(size=(count, 1)) * line
    level = np.hypot(line[:, 0], line[:, 1])
    across = np.stack([-line[:, 1], line[:, 0], np.zeros(count)], axis=1) / level[:, None]
    error += D * SIGMA_U * level[:, None] * rng.normal(size=(count, 1)) * across
    error += D * SIGMA_U * rng.normal(size=(count, 1)) * np.cross(across, line)
    return float(np.quantile(np.linalg.norm(error, axis=1), 0.95))


@pytest.mark.parametrize("latency_s", [0.045, 0.12])
def test_a_latency_by_both_models_and_simulated(latency_s: float) -> None:
    found = of("latency", {"latency_s": latency_s})
    change = added(found)
    assert change["syncline_m"] == pytest.approx((V + D * W) * latency_s, rel=1e-6)
    assert change["per_sensor_m"] == pytest.approx(V * latency_s, rel=1e-6)
    rows = {one.figure: one for one in found.figures}
    for value, truth in (
        (rows["simulated_95_m"].before_m, simulated_quantile(0.0)),
        (rows["simulated_95_m"].after_m, simulated_quantile(latency_s)),
    ):
        # 40 000 samples: one standard error of the quantile is below 0.5 %; five of them
        assert value == pytest.approx(truth, rel=0.025)
    low, high = rows["simulated_95_m"].after_interval_m or (None, None)
    assert low is not None
    assert high is not None
    assert low < (rows["simulated_95_m"].after_m or 0.0) < high
    assert (change["syncline_m"] / V / latency_s) > 4.0
    assert any("per-sensor model each sensor's own" in line for line in found.text)


@pytest.mark.parametrize(
    ("horizon", "seconds", "words"),
    [
        ("", 3600.0, "Horizon: 1 h, 1 km about the origin, tilt up to 10 deg (by default"),
        ("{duration: 10 min}", 600.0, "Horizon: 10 min, 1 km about"),
        ("{duration: 90 s, extent: 250 m, tilt: 5 deg}", 90.0,
         "Horizon: 1.5 min, 250 m about the origin, tilt up to 5 deg (the spec's)"),
    ],
)  # fmt: skip
def test_a_drift_is_charged_for_the_stated_horizon(
    horizon: str, seconds: float, words: str
) -> None:
    found = of("clock_drift", {"rate": 59e-6}, horizon)
    change = added(found)
    assert change["per_sensor_m"] == pytest.approx(V * 59e-6 * seconds, rel=1e-6)
    assert change["syncline_m"] == pytest.approx((V + D * W) * 59e-6 * seconds, rel=1e-6)
    assert words in found.horizon.text
    assert words in console(on_diagnosis(diagnosis(design=found)))
    assert found.horizon.duration_s == seconds


@pytest.mark.parametrize(
    ("effect", "parameters", "words"),
    [
        ("latency", {"latency_s": 0.0871}, "87.1 ms"),
        ("clock_drift", {"rate": 59e-6}, "59 ppm"),
        ("lever_arm", {"x_m": 0.123, "y_m": -0.004, "z_m": 0.0}, "12.3 cm"),
        ("heading_drift", {"rate_radps": 1e-4}, "20.63 deg/h"),
    ],
)
def test_a_finding_in_a_spec_reads_as_it_was_found(
    effect: str, parameters: dict[str, float], words: str
) -> None:
    """The sentence of `check` about a known effect has the figures of `diagnose`'s sentence."""
    from syncline_design.diagnosis.finding import estimate, finding
    from syncline_design.effects import registry
    from syncline_design.model.known import EffectEntry
    from syncline_design.spec.known_effects import describe

    sensor = registry()[effect].sensors[0]
    units = {p.name: p.unit for p in registry()[effect].parameters}
    figures = {name: estimate(value, None, units[name]) for name, value in parameters.items()}
    found = finding(registry()[effect], sensor, "uav", figures, "clear", 1.0)
    said = describe(EffectEntry(effect, sensor, "uav", tuple(parameters.items())))
    assert words in said
    assert said[0].upper() + said[1:] == found.sentence


def test_page_and_markdown_show_all_three_beside_each_other() -> None:
    """In the unit in which the spec limits the error."""
    found = of("latency", {"latency_s": 0.045})
    data = diagnosis(design=found)
    document = on_diagnosis(data)
    for text in (html(document), markdown(document), console(document)):
        rows = re.sub(r"<[^>]+>|\\", " ", text).replace("\u00a0", " ")
        for one in found.figures:
            assert one.label.split(",")[0] in rows
            for value in (one.before_m, one.after_m):
                assert f"{value:.4g} m" in rows
        assert "Horizon: 1 h" in rows


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (3600.0, "1 h"), (5400.0, "1.5 h"), (600.0, "10 min"), (45.0, "45 s"), (100.0, "100 s"),
        (6000.0, "100 min"), (2220.0, "37 min"), (5000.25, "1.389 h"), (1e8, "27780 h"),
        (0.005, "5 ms"),
    ],
)  # fmt: skip
def test_durations_read_as_missions_are_planned(seconds: float, words: str) -> None:
    assert format_duration(seconds) == words


def test_the_spec_is_never_written_over_what_the_command_reads(tmp_path: Path) -> None:
    """Spec, log, catalog; by its name, another spelling, a symbolic and a hard link."""
    text = (ROOT / "examples" / "hidden_latency.yaml").read_text("utf-8")
    spec, log, own = tmp_path / "s.yaml", tmp_path / "log.csv", tmp_path / "own.yaml"
    spec.write_text(text + "catalogs: [own.yaml]\n", "utf-8")
    own.write_text("sensors: {}\n", "utf-8")
    shutil.copy(ROOT / "examples" / "hidden_latency.csv", log)
    (tmp_path / "sub").mkdir()
    (tmp_path / "soft.yaml").symlink_to(spec)
    os.link(log, tmp_path / "hard.yaml")
    before = {path: path.read_bytes() for path in (spec, log, own)}
    spelt = tmp_path / "sub" / ".." / "s.yaml"
    for target in (spec, log, own, spelt, tmp_path / "soft.yaml", tmp_path / "hard.yaml"):
        done = CliRunner().invoke(
            app, ["diagnose", str(spec), str(log), "--write-spec", str(target)]
        )
        assert done.exit_code == 2, (target, done.stderr)
        assert done.stdout == ""
        assert str(target) in done.stderr
        assert {path: path.read_bytes() for path in before} == before
    assert (tmp_path / "soft.yaml").is_symlink()


def test_tails_that_no_budget_can_hold_are_said_and_not_charged() -> None:
    """1.5 degrees of freedom have no standard deviation: no figure, no verdict, the reason."""
    found = of("heavy_tails", {"degrees_of_freedom": 1.5, "outlier_rate": 0.0})
    assert found.after.verdict == "indeterminate"
    assert "with them, it could not be decided" in found.text[0]
    assert "no standard deviation" in found.text[1]
    assert [one.after_m for one in found.figures] == [None, None, None]
    assert found.before.verdict == "meets"
    json.dumps(found.to_json(), allow_nan=False)
    assert "Horizon: 1 h" in console(on_diagnosis(diagnosis(design=found)))
