"""`diagnose` on logs from the hidden world: the quick part of the study in docs/study.md.

Seeds are fixed, so a run is repeatable; the error rates said below are those of a fresh choice of
seeds if the diagnosis keeps its promises.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from tests.world import CHAIN, Hidden, Noise, WorldLog, hidden, make_log, scenario
from tests.world.streams import write_streams

Document = dict[str, Any]
PLATFORMS = ("multirotor_lines", "fixed_wing_circuits", "car_stops", "vessel_figure_eights")


def ask(log: WorldLog, folder: Path, exclude: tuple[str, ...] = (), **csv: Any) -> Document:
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    data = log.to_csv(folder / "log.csv", **csv)
    document: Document = diagnose(
        spec, [data], DiagnosisSettings(exclude_effects=exclude)
    ).to_json()
    return document


def named(finding: Document) -> set[tuple[str, str]]:
    own = {(finding["effect"], finding["sensor"])}
    return own | {(a["effect"], a["sensor"]) for a in finding["aliases"]}


def short(platform: str, seed: int, *effects: Hidden, noise: Noise | None = None) -> WorldLog:
    return make_log(scenario(platform, seed, 80.0, 5.0), effects, noise)


def test_clean_logs_are_left_alone(tmp_path: Path) -> None:
    """4 logs at 5 %: more than 1 named comes in 1.4 % of choices of seeds."""
    wander = Noise(wander_share=0.6, wander_time_s=10.0)
    logs = [short(platform, 7) for platform in PLATFORMS[:2]]
    logs += [short(platform, 7, noise=wander) for platform in PLATFORMS[2:]]
    verdicts = [ask(log, tmp_path)["verdict"] for log in logs]
    assert sum(verdict != "agrees" for verdict in verdicts) <= 1, verdicts


CLEAR = (
    ("multirotor_lines", hidden("latency", "position", latency_s=0.06)),
    ("car_stops", hidden("lever_arm", "position", x_m=0.12, y_m=-0.08, z_m=0.1)),
    ("vessel_figure_eights", hidden("boresight", "ranging", x_rad=0.006, y_rad=-0.005, z_rad=0.01)),
    ("fixed_wing_circuits", hidden("timestamp_step", "position", step_s=0.03, time_s=42.0)),
    ("car_stops", hidden("frame_convention", "attitude", convention="yaw_sign")),
)


@pytest.mark.parametrize(("platform", "effect"), CLEAR)
def test_a_clear_effect_is_named_and_measured(
    platform: str, effect: Hidden, tmp_path: Path
) -> None:
    """Effects at twenty bounds and more; |z| < 5 is missed once in 1.7 million."""
    document = ask(short(platform, 31, effect), tmp_path)
    assert document["verdict"] == "explained"
    assert [(effect.effect, effect.sensor) in named(f) for f in document["findings"]] == [True]
    finding = document["findings"][0]
    if finding["effect"] != effect.effect or effect.effect == "frame_convention":
        return
    for name, value in effect.parameters:
        found = finding["parameters"][name]
        if found["standard_uncertainty"] is not None:
            assert abs(found["value"] - float(value)) < 5.0 * found["standard_uncertainty"], name
    assert document["gap"]["closed_fraction"] > 0.9


def test_constant_speed_cannot_tell_latency_from_a_forward_arm(tmp_path: Path) -> None:
    log = short("constant_speed_eights", 3, hidden("latency", "position", latency_s=0.03))
    (finding,) = ask(log, tmp_path)["findings"]
    assert {("latency", "position"), ("lever_arm", "position")} <= named(finding)
    assert finding["separated_by"]


def test_an_effect_that_is_not_in_the_dictionary_stays_unexplained(tmp_path: Path) -> None:
    fault = hidden("heading_hard_iron", "attitude", sin_rad=0.015, cos_rad=0.01)
    log = short("multirotor_lines", 12, fault)
    document = ask(log, tmp_path, exclude=("heading_hard_iron",))
    assert document["verdict"] == "unexplained"
    assert document["remaining"]["unexplained"] is True


def test_wgs84_log_gives_the_same_answer(tmp_path: Path) -> None:
    log = short("car_stops", 5, hidden("latency", "position", latency_s=0.08))
    local = ask(log, tmp_path)["findings"]
    earth = ask(log, tmp_path, geodetic=(63.4, 10.4, 55.0))["findings"]
    assert [f["effect"] for f in local] == [f["effect"] for f in earth] == ["latency"]
    found = [f[0]["parameters"]["latency_s"] for f in (local, earth)]
    assert abs(found[0]["value"] - found[1]["value"]) < 0.1 * found[0]["standard_uncertainty"]


def test_sensors_at_their_own_rates_are_merged(tmp_path: Path) -> None:
    run = scenario("multirotor_lines", 8, 60.0, 5.0)
    fault = hidden("latency", "position", latency_s=0.08)
    spec = tmp_path / "spec.yaml"
    spec.write_text(make_log(run).spec_yaml(), encoding="utf-8")
    files = write_streams(run, tmp_path, (fault,))
    document = diagnose(spec, files, DiagnosisSettings()).to_json()
    assert document["findings"][0]["effect"] == "latency"
    found = document["findings"][0]["parameters"]["latency_s"]
    assert found["value"] == pytest.approx(0.08, abs=0.004)


def test_a_chain_names_the_stage(tmp_path: Path) -> None:
    run = scenario(CHAIN, 4, 120.0, 5.0)
    document = ask(make_log(run, (hidden("latency", "attitude", "auv", latency_s=0.15),)), tmp_path)
    first = document["findings"][0]
    assert ("latency", "attitude") in named(first)
    assert first["stage"] == "auv"
