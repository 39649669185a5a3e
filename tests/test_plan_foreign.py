"""A plan says, or refuses, where the diagnosis that it is given is not of this system."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from diagnosis_samples import diagnosis
from syncline_design.cli.app import app
from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.diagnosis.result import Rival, SlowNoise
from syncline_design.diagnosis.same_system import description
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.records import read_as
from syncline_design.planning.from_diagnosis import asked_of, cautions_of, foreign_words
from syncline_design.planning.run import plan
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.wanted import PlanError, PlanWanted, separate_of
from syncline_design.spec.load import load

STAMPED = "timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
CAR = f"""\
syncline: 1
name: car with lidar
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: car
    platform: {{v_max: 9 m/s, omega_max: 50 deg/s, distance: 40 m, baseline: 0.5 m}}
    position: {{sensor: {{modality: position, type: gnss, sigma_position: [12 mm, 12 mm, 20 mm],
      primitives: [pps]}}, primitive: pps, {STAMPED}, lever_arm: [0.25 m, 0 m, -0.4 m]}}
    attitude: {{sensor: {{modality: attitude, type: ins, sigma_attitude: 0.03 deg,
      primitives: [pps]}}, primitive: pps, {STAMPED}}}
    ranging: {{sensor: {{modality: ranging, type: lidar, sigma_range: 2 cm, sigma_bearing: 0.02 deg,
      primitives: [pps]}}, primitive: pps, {STAMPED}}}
"""
SPREAD = "sigma_position: [12 mm, 12 mm, 20 mm]"
LISTED = "effects: [{effect: latency, sensor: position, parameters: {latency_s: 87 ms}}]\n"


def spec(folder: Path, text: str = CAR, name: str = "car.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def made_with(path: Path) -> DiagnosisAndDesign:
    """The sample's diagnosis as one of this spec, written and read back."""
    found = diagnosis(system=description(pinned_system(load(path))))
    return read_as(DiagnosisAndDesign, json.dumps(found.to_json()))


def test_a_diagnosis_of_this_system_is_taken_without_a_word(tmp_path: Path) -> None:
    case = load(spec(tmp_path))
    found, system = made_with(case.path), pinned_system(case)
    assert [pair.first.text for pair in asked_of(system, found).pairs] == ["latency(position)"]
    assert cautions_of(case, system, found) == ()
    renamed = load(spec(tmp_path, CAR.replace("name: car with", "name: van with"), "van.yaml"))
    assert cautions_of(renamed, pinned_system(renamed), found) == ()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (SPREAD, "sigma_position: [12 mm, 12 mm, 30 mm]",
         "its sigma, down: 20 mm in the diagnosis, 30 mm in the spec"),
        ("lever_arm: [0.25 m", "lever_arm: [0.3 m",
         "lever arm, forward: 250 mm in the diagnosis, 300 mm in the spec"),
        ("low: -10 ns", "low: -20 ns", "at least: -10 ns in the diagnosis, -20 ns in the spec"),
    ],
)  # fmt: skip
def test_a_diagnosis_of_what_measures_otherwise_is_refused(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    found = made_with(spec(tmp_path))
    other = pinned_system(load(spec(tmp_path, CAR.replace(old, new), "other.yaml")))
    with pytest.raises(PlanError, match="of another system") as refused:
        asked_of(other, found)
    assert said in str(refused.value)


def test_the_command_refuses_it_with_the_spec_that_it_was_made_with(tmp_path: Path) -> None:
    written = tmp_path / "d.json"
    written.write_text(json.dumps(made_with(spec(tmp_path)).to_json()), encoding="utf-8")
    other = spec(tmp_path, CAR.replace(SPREAD, "sigma_position: 1 m"), "other.yaml")
    done = CliRunner().invoke(app, ["plan", str(other), "--diagnosis", str(written)])
    assert done.exit_code == 2
    words = " ".join(done.stderr.split())
    assert words.startswith("syncline-design: --diagnosis: it is of another system (")
    assert "12 mm in the diagnosis, 1 m in the spec" in words
    assert "Diagnose the log with this spec" in words


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CAR.replace("v_max: 9", "v_max: 4"), "v_max: 9 m/s in the diagnosis, 4 m/s in the spec"),
        (CAR + LISTED, "the listed effects: () in the diagnosis, (effect latency"),
    ],
)
def test_what_is_driven_otherwise_or_known_since_is_taken_and_said(
    tmp_path: Path, text: str, said: str
) -> None:
    found = made_with(spec(tmp_path))
    case = load(spec(tmp_path, text, "other.yaml"))
    assert asked_of(pinned_system(case), found).pairs
    (caution,) = cautions_of(case, pinned_system(case), found)
    assert said in caution
    assert "The drive is for the spec as it is now." in caution


def test_a_diagnosis_that_does_not_say_what_it_is_of_is_taken_with_a_caution(
    tmp_path: Path,
) -> None:
    case = load(spec(tmp_path))
    system, found = pinned_system(case), diagnosis()
    assert asked_of(system, found).pairs
    (caution,) = cautions_of(case, system, found)
    assert "is taken on trust" in caution
    same = replace(found, provenance=replace(found.provenance, spec_sha256=case.spec_sha256))
    assert cautions_of(case, system, same) == ()


@pytest.mark.parametrize(
    "noise",
    [{"white_factor": {"boat/position": 1.0}}, {"slow": {"car/depth": SlowNoise((0.5,), (9.0,))}}],
)
def test_noise_of_a_sensor_that_the_spec_has_not_is_refused(
    tmp_path: Path, noise: dict[str, object]
) -> None:
    """Left alone, the plan would take the spec's noise for it, and call it the diagnosis's."""
    found = diagnosis()
    other = replace(found, noise=replace(found.noise, **noise))  # type: ignore[arg-type]
    with pytest.raises(PlanError, match="sensors of this spec, which are car/attitude, car/posit"):
        asked_of(pinned_system(load(spec(tmp_path))), other)


def test_what_the_diagnosis_names_and_the_system_cannot_have_is_left_out_and_said(
    tmp_path: Path,
) -> None:
    """A car's lidar may sag, though a car that keeps level hardly shows it; it has no sound speed.
    Both were refused, and the whole diagnosis with them."""
    case = load(spec(tmp_path, CAR.replace("baseline: 0.5 m", "baseline: 0.5 m, motion: ground")))
    rivals = tuple(Rival(name, "ranging", "car", 0.9, 0.4) for name in ("flexure", "sound_speed"))
    found = diagnosis(system=description(pinned_system(case)))
    asked = replace(found, findings=(replace(found.findings[0], aliases=rivals),))
    setup = Setup.begun(case, PlanRequest(diagnosis=asked))
    told = [one.candidate.effect.name for one in setup.world.every]
    assert "flexure" in told
    assert "sound_speed" not in told
    assert [pair.names[1] for pair in setup.goal.pairs] == ["flexure(ranging)"]
    assert list(foreign_words(setup.foreign)) == [
        "The diagnosis names what does not apply to this system, left out here: "
        "sound_speed(ranging)."
    ]
    assert Setup.begun(case, PlanRequest()).foreign == ()
    typed = PlanRequest(PlanWanted((), separate_of("latency(position)", "sound_speed(ranging)")))
    with pytest.raises(PlanError, match=r"sound_speed\(ranging\) does not apply to stage 'car'"):
        Setup.begun(case, typed)


def test_the_words_stand_in_the_plan(tmp_path: Path) -> None:
    case = load(spec(tmp_path))
    found = diagnosis(system=description(pinned_system(case)))
    rivals = (*found.findings[0].aliases, Rival("sound_speed", "ranging", "car", 0.9, 0.4))
    asked = replace(found, findings=(replace(found.findings[0], aliases=rivals),))
    result = plan(case, PlanRequest(diagnosis=asked, line_plans=False)).result
    assert result.reached
    assert any("left out here: sound_speed(ranging)" in one for one in result.cautions or ())
