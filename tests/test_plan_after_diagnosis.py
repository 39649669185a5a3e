"""The drive that a diagnosis ends with: what tells its class, or that nothing does."""

from __future__ import annotations

import itertools
import json
import shlex
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.diagnosis.same_system import description
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects import registry
from syncline_design.machine import deadline
from syncline_design.machine.records import read_as
from syncline_design.planning import next_drive
from syncline_design.report.diagnoses import render_diagnose
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests.planned_specs import call
from tests.world.hidden import hidden
from tests.world.noise import Noise
from tests.world.scenarios import scenario
from tests.world.worldlog import make_log


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A straight line at one speed, 30 ms of GNSS latency hidden in it: spec and log."""
    folder = tmp_path_factory.mktemp("straight")
    line = scenario("straight_constant_speed", 3, 40.0, 10.0)
    log = make_log(line, (hidden("latency", "position", latency_s=0.03),), Noise())
    spec = folder / "line.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    return spec, log.to_csv(folder / "line.csv")


@pytest.fixture(scope="module")
def diagnosed(straight: tuple[Path, Path]) -> Path:
    """What `diagnose` says of that line: its JSON, and its text beside it."""
    spec, log = straight
    result = spec.parent / "line.json"
    done = CliRunner().invoke(
        app, ["diagnose", str(spec), str(log), "--max-effects", "1", "-o", f"json:{result}"]
    )
    assert done.exit_code == 1
    result.with_suffix(".txt").write_text(done.stdout, encoding="utf-8")
    return result


def test_a_diagnosis_with_a_class_ends_with_the_drive_that_tells(
    straight: tuple[Path, Path], diagnosed: Path
) -> None:
    spec, result = straight[0], diagnosed
    data = json.loads(result.read_text("utf-8"))
    jsonschema.validate(data, result_schema("diagnosis"))
    named = {(f["effect"], f["sensor"]): f for f in data["findings"]}
    aliases = {a["effect"] for f in named.values() for a in f["aliases"]}
    assert {"latency", "lever_arm"} <= {name for name, _ in named} | aliases
    drive = data["plan"]
    assert drive["reached"]
    assert drive["first"] != drive["second"]
    assert drive["command"].startswith("syncline-design plan ")
    assert drive["command"].removeprefix("syncline-design ")[:30] in " ".join(
        result.with_suffix(".txt").read_text("utf-8").split()
    )
    words = shlex.split(drive["command"])[2:]
    whole = call(*words, "-o", "json:-")
    assert whole.exit_code == 0
    assert [leg["words"] for leg in json.loads(whole.stdout)["legs"]] == [
        leg.partition(": ")[2] for leg in drive["legs"]
    ]
    from_file = call(spec, "--diagnosis", result, "-o", "json:-")
    assert data["system"] == json.loads(json.dumps(description(pinned_system(load(spec)))))
    assert "cautions" not in json.loads(from_file.stdout)
    pairs = json.loads(from_file.stdout)["pairs"]
    assert pairs[0]["sizes"]["latency_s"] == pytest.approx(0.03, rel=0.1)
    assert all(pair["separated"] for pair in pairs)


def test_the_drive_is_the_same_however_busy_the_machine_is(
    straight: tuple[Path, Path], diagnosed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock on which every look at it is an hour later."""
    found = read_as(DiagnosisAndDesign, diagnosed.read_bytes())
    hours = itertools.count(0.0, 3600.0)
    monkeypatch.setattr(deadline.time, "monotonic", lambda: next(hours))
    assert next_drive.next_drive(load(straight[0]), found) == found.plan


def test_a_diagnosis_without_a_drive_says_why_and_prints_the_command_that_looks_for_one(
    straight: tuple[Path, Path], diagnosed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, _ = straight
    found = read_as(DiagnosisAndDesign, diagnosed.read_bytes())
    case = load(spec)
    monkeypatch.setattr(next_drive, "MOST_JUDGED", 0)
    late = next_drive.next_drive(case, found)
    assert late is not None
    assert (late.legs, late.minutes, late.reached) == ((), None, False)
    *words, asked, rivals = shlex.split(late.command)
    assert words == ["syncline-design", "plan", str(spec), "--separate"]
    assert asked.startswith("latency(position)=30")
    assert "lever_arm(position)" in rivals.split(", ")
    words = render_diagnose("markdown", replace(found, plan=late)).replace("\\", "")
    assert "No drive that does was found among those that a diagnosis looks at" in words
    assert late.command in words
    jsonschema.validate(replace(found, plan=late).to_json(), result_schema("diagnosis"))


def test_a_drive_of_more_than_some_hours_is_none_and_no_manoeuvre_is_promised(
    straight: tuple[Path, Path], diagnosed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = read_as(DiagnosisAndDesign, diagnosed.read_bytes())
    arm = next(r for r in whole.findings[0].aliases if r.effect == "lever_arm")
    found = replace(whole, findings=(replace(whole.findings[0], aliases=(arm,)),))
    monkeypatch.setattr(next_drive, "LONGEST_S", 1.0)
    drive = next_drive.next_drive(load(straight[0]), found)
    assert drive is not None
    assert (drive.minutes, drive.legs) == (None, ())
    assert drive.why_none is not None
    assert drive.why_none.startswith("No test drive of this platform of up to 1 s was found")
    words = render_diagnose("markdown", replace(found, plan=drive)).replace("\\", "")
    assert "It takes" not in words
    assert "To separate them" not in words
    assert "No drive that does was found." in words


def test_a_class_that_no_drive_tells_is_said_to_be_one(
    straight: tuple[Path, Path], diagnosed: Path
) -> None:
    """Two lever arms of one rigid body shift every row alike, whatever is driven."""
    spec, _ = straight
    found = read_as(DiagnosisAndDesign, diagnosed.read_bytes())
    arms = ("lever_arm", "position"), ("lever_arm", "ranging")
    one, other = (
        replace(r, effect=effect, sensor=sensor)
        for (effect, sensor), r in zip(arms, [found.findings[0].aliases[0]] * 2, strict=True)
    )
    (size,) = found.findings[0].parameters.values()
    sizes = {p.name: size for p in registry()["lever_arm"].slopes()}
    alone = replace(
        found.findings[0], effect=one.effect, sensor=one.sensor, parameters=sizes, aliases=(other,)
    )
    ends = next_drive.next_drive(load(spec), replace(found, findings=(alone,)))
    assert ends is not None
    assert ends.why_none is not None
    assert "No drive of this platform can tell lever_arm(position) from lever_arm(ranging)" in (
        ends.why_none
    )
    assert ends.legs == ()
    assert ends.alike == ("lever_arm(ranging)",)
    said = render_diagnose("markdown", replace(found, findings=(alone,), plan=ends))
    words = said.replace("\\", "")
    assert "No drive can: on every leg of this platform they make the same error." in words
    assert "that does was found" not in words


def test_a_flown_log_that_the_platform_cannot_have_made_is_said_to_be_odd(
    straight: tuple[Path, Path], tmp_path: Path
) -> None:
    """Some vehicle's log with a spec of another, ten times slower one."""
    fast = tmp_path / "fast.yaml"
    text = straight[0].read_text("utf-8")
    speed = next(line for line in text.splitlines() if "v_max:" in line).split("v_max:")[1]
    own = speed.split(",")[0].split("m/s")[0].strip()
    fast.write_text(text.replace(f"v_max: {own} m/s", "v_max: 0.5 m/s"), encoding="utf-8")
    done = call(fast, "--reach", "latency(position)=100 ms", "--flown", straight[1], "-o", "json:-")
    flown = json.loads(done.stdout)["flown"]
    assert any("the spec's v_max is 0.5 m/s" in one for one in flown["cautions"])


def test_several_flown_drives_tell_what_all_of_them_do(
    straight: tuple[Path, Path], tmp_path: Path
) -> None:
    """Of one parameter 1 / sigma^2 adds up; a drive that is given twice is no second one."""
    spec, first = straight
    line = scenario("straight_constant_speed", 3, 25.0, 10.0)
    second = make_log(line, (), Noise()).to_csv(tmp_path / "second.csv")

    def flown(*logs: Path) -> dict:
        options = [word for log in logs for word in ("--flown", log)]
        done = call(spec, "--reach", "latency(position)=100 ms", *options, "-o", "json:-")
        return dict(json.loads(done.stdout)["flown"])

    alone, both = [flown(log) for log in (first, second)], flown(first, second)
    (key,) = both["sigma"]
    known = sum(one["sigma"][key] ** -2 for one in alone)
    assert both["sigma"][key] == pytest.approx(known**-0.5, rel=1e-6)
    assert both["files"] == [first.name, second.name]
    assert both["rows"] == sum(one["rows"] for one in alone)
    twice = call(spec, "--reach", "latency(position)=100 ms", "--flown", first, "--flown", first)
    assert twice.exit_code == 2
    assert f"{first.name} is the drive of {first.name}" in twice.output
