"""The re-simulation against the hidden world, effect by effect, and the way back into the spec.

The world moves antennas, turns sensors and samples true trajectories at shifted times; it shares
no formula with `effects/`.  A noise-free log with one effect has to be explained by that effect
with its true parameters.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.spec.edit import with_effects_text, write_spec
from syncline_design.spec.load import load
from tests.world import SILENT, Hidden, WorldLog, hidden, make_log, scenario

LEFT = 0.03  # share of the effect's error that second-order terms and splines may leave
TILT_LEFT = 0.06  # the tilt follows an acceleration that splines of the velocity tell

CASES: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("latency", "position", {"latency_s": 0.12}),
    ("latency", "attitude", {"latency_s": 0.08}),
    ("latency", "ranging", {"latency_s": 0.1}),
    ("clock_drift", "position", {"rate": 2e-3}),
    ("clock_drift", "attitude", {"rate": 2e-3}),
    ("timestamp_step", "position", {"step_s": 0.07, "time_s": 17.0}),
    ("timestamp_step", "attitude", {"step_s": 0.07, "time_s": 17.0}),
    ("clock_drift", "ranging", {"rate": 2e-3}),
    ("timestamp_step", "ranging", {"step_s": 0.07, "time_s": 17.0}),
    ("heading_soft_iron", "attitude", {"sin_rad": 0.02, "cos_rad": -0.01}),
    ("squat", "position", {"sinkage_m": 0.01}),
    ("tide", "position", {"rate_mps": 1e-3}),
    ("filter_lag", "position", {"time_constant_s": 0.1}),
    ("lever_arm", "position", {"x_m": 0.4, "y_m": -0.3, "z_m": 0.2}),
    ("lever_arm", "ranging", {"x_m": 0.4, "y_m": -0.3, "z_m": 0.2}),
    ("boresight", "ranging", {"x_rad": 0.02, "y_rad": -0.01, "z_rad": 0.03}),
    ("mounting", "attitude", {"x_rad": 0.02, "y_rad": -0.01, "z_rad": 0.03}),
    ("range_bias", "ranging", {"bias_m": 0.5}),
    ("range_scale", "ranging", {"scale": 0.02}),
    ("azimuth_bias", "ranging", {"bias_rad": 0.02}),
    ("elevation_bias", "ranging", {"bias_rad": 0.02}),
    ("heading_bias", "attitude", {"bias_rad": 0.03}),
    ("heading_hard_iron", "attitude", {"sin_rad": 0.02, "cos_rad": -0.01}),
    ("heading_drift", "attitude", {"rate_radps": 1e-3}),
    ("acceleration_tilt", "attitude", {"gain": 0.1}),
    ("flexure", "ranging", {"x": 0.02, "y": -0.03, "z": 0.01}),
    ("datum_offset", "target", {"north_m": 0.3, "east_m": -0.2, "down_m": 0.1}),
    ("grid_scale", "target", {"scale": 2e-3}),
    ("grid_convergence", "target", {"rotation_rad": 2e-3}),
    ("scan_distortion", "ranging", {"period_s": 0.1}),
    ("induced_heave", "position", {"x_m": 3.0, "y_m": -2.0, "z_m": 1.0}),
)
OF_VESSELS = {"induced_heave", "squat", "tide"}


@cache
def run_of(platform: str) -> WorldLog:
    return make_log(scenario(platform, 4, 40.0, 10.0), (), SILENT)


def errors(
    log: WorldLog, folder: Path, effect: str, sensor: str, values: dict[str, float]
) -> tuple[float, ...]:
    """RMS of the error [m] before and after the effect is simulated too."""
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log)
    acting = Acting(registry()[effect], sensor, 0, values)  # type: ignore[arg-type]
    return tuple(float(np.sqrt(np.mean(view.error(a) ** 2))) for a in ((), (acting,)))


@pytest.mark.parametrize(("effect", "sensor", "values"), CASES, ids=lambda v: str(v)[:20])
def test_the_world_means_the_same(
    effect: str, sensor: str, values: dict[str, float], tmp_path: Path
) -> None:
    platform = "vessel_figure_eights" if effect in OF_VESSELS else "multirotor_lines"
    fault = hidden(effect, sensor, **values)
    log = make_log(run_of(platform).run, (fault,), SILENT)
    before, after = errors(log, tmp_path, effect, sensor, values)
    assert before > 2e-3
    assert after < (TILT_LEFT if effect == "acceleration_tilt" else LEFT) * before


def test_without_effects_and_noise_nothing_is_left(tmp_path: Path) -> None:
    """What the log's decimals leave: 0.1 mm and 1e-5 deg at 40 m."""
    before, _ = errors(
        run_of("multirotor_lines"), tmp_path, "latency", "position", {"latency_s": 0}
    )
    assert before < 1e-4


def small(*effects: Hidden) -> WorldLog:
    return make_log(scenario("car_stops", 9, 60.0, 5.0), effects)


def test_written_back_the_same_log_agrees(tmp_path: Path) -> None:
    """Then the spec is right; 5 % of right ones would be found at fault, the seed is fixed."""
    log = small(hidden("latency", "position", latency_s=0.1))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    data = log.to_csv(tmp_path / "log.csv")
    first = diagnose(spec, [data])
    assert first.exit_code == 1
    loaded = load(spec)
    write_spec(with_effects_text(loaded, first.effects_entries()), tmp_path / "fixed.yaml")
    again = diagnose(tmp_path / "fixed.yaml", [data])
    assert again.verdict == "agrees"
    assert again.exit_code == 0


def test_a_position_log_ignores_the_ranging_sensors_arm(tmp_path: Path) -> None:
    """A spec with a scanner, a log against a better system: only the antenna's arm counts."""
    spec = tmp_path / "spec.yaml"
    spec.write_text(small().spec_yaml(), encoding="utf-8")
    log = make_log(scenario("car_stops", 9, 60.0, 5.0, "position"))
    assert diagnose(spec, [log.to_csv(tmp_path / "log.csv")]).verdict == "agrees"


def test_the_same_seed_gives_the_same_answer(tmp_path: Path) -> None:
    log = small(hidden("lever_arm", "position", x_m=0.1, y_m=0.1, z_m=0.0))
    (tmp_path / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    data = log.to_csv(tmp_path / "log.csv")
    texts = [
        json.dumps(diagnose(tmp_path / "spec.yaml", [data], DiagnosisSettings(seed=3)).to_json())
        for _ in range(2)
    ]
    assert texts[0] == texts[1]


def test_progress_is_told(tmp_path: Path) -> None:
    log = small()
    (tmp_path / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    seen: list[float] = []
    diagnose(
        tmp_path / "spec.yaml",
        [log.to_csv(tmp_path / "log.csv")],
        progress=lambda _, done: seen.append(done),
    )
    assert seen == sorted(seen)
    assert seen[0] == 0.0
    assert 0.7 <= seen[-1] <= 1.0
