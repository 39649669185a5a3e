"""`accept` on a device of which some readings are late and the others keep their time.

The logs are of the tests' own world: the columns of some angles are those of a second log of the
same run in which the whole attitude is late.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.late_part import LatePart, late_part
from syncline_design.diagnosis.reading_parts import ReadingPart, put_back
from syncline_design.diagnosis.run import diagnose
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_accept_late_rows import accepted
from tests.test_accept_stretches import world
from tests.world import Hidden, Noise, Scenario, hidden, make_log
from tests.world.worldlog import write_columns

TURNS = ("multirotor_lines", 9, 80.0, 8.0)
CIRCLES = ("fixed_wing_circuits", 2, 80.0, 8.0)


def late_columns(
    folder: Path,
    run: Scenario,
    names: tuple[str, ...],
    delay_s: float,
    noise: Noise | None = None,
    device: str = "attitude",
) -> tuple[Path, Path]:
    """Spec and log of which some columns are those of a device that is late."""
    sound = make_log(run, (), noise)
    late = make_log(run, (hidden("latency", device, latency_s=delay_s),), noise)
    columns = dict(sound.columns) | {name: late.columns[name] for name in names}
    spec = folder / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    return spec, write_columns(folder / "log.csv", columns)


def told(spec: Path, log: Path) -> LatePart | None:
    inputs = measured(load(spec), [log])
    return late_part(inputs, inputs.log, inputs.log)


@pytest.mark.parametrize("delay_s", [0.1, 0.4, -0.05])
@pytest.mark.parametrize("run", [TURNS, CIRCLES])
def test_a_heading_that_is_late_alone_is_told_by_its_delay(
    run: tuple[str, int, float, float], delay_s: float, tmp_path: Path
) -> None:
    found = told(*late_columns(tmp_path, world(*run), ("yaw_deg",), delay_s))
    assert found is not None
    assert found.fault.readings == "yaw"
    assert found.fault.spread is not None
    value = found.fault.acting.values["latency_s"]
    assert abs(value - delay_s) < 3.0 * found.fault.spread < 0.03


def test_a_level_that_is_late_alone_is_no_early_heading(tmp_path: Path) -> None:
    """Roll and pitch late by 100 ms are, but for a delay of all, a heading that is early."""
    found = told(*late_columns(tmp_path, world(*CIRCLES), ("roll_deg", "pitch_deg"), 0.1))
    assert found is not None
    assert found.fault.readings == "roll and pitch"
    assert found.fault.acting.values["latency_s"] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("delay_s", [0.15, -0.1])
@pytest.mark.parametrize(
    ("axes", "name"), [(("down",), "height"), (("north", "east"), "north and east")]
)
def test_places_of_which_some_are_late_alone_are_told(
    axes: tuple[str, ...], name: str, delay_s: float, tmp_path: Path
) -> None:
    columns = tuple(f"position_{axis}_m" for axis in axes)
    found = told(*late_columns(tmp_path, world(*TURNS), columns, delay_s, None, "position"))
    assert found is not None
    assert found.fault.readings == name
    assert found.fault.acting.sensor == "position"
    assert found.fault.spread is not None
    value = found.fault.acting.values["latency_s"]
    assert abs(value - delay_s) < 3.0 * found.fault.spread < 0.03


@pytest.mark.parametrize(
    "what",
    [
        (),
        (hidden("latency", "attitude", latency_s=0.1),),
        (hidden("latency", "position", latency_s=0.1),),
        (hidden("mounting", "attitude", x_rad=0.0, y_rad=0.02, z_rad=0.05),),
        (hidden("lever_arm", "position", x_m=0.3, y_m=0.0, z_m=0.2),),
        (hidden("noise_understated", "position", factor=3.0),),
        (hidden("heading_drift", "attitude", rate_radps=1e-4),),
    ],
)
@pytest.mark.parametrize("run", [TURNS, CIRCLES])
def test_what_all_angles_share_is_no_delay_of_some(
    run: tuple[str, int, float, float], what: tuple[Hidden, ...], tmp_path: Path
) -> None:
    made = make_log(world(*run), what)
    spec = tmp_path / "spec.yaml"
    spec.write_text(made.spec_yaml(), "utf-8")
    assert told(spec, write_columns(tmp_path / "log.csv", made.columns)) is None


@pytest.mark.parametrize("run", [TURNS, CIRCLES])
@pytest.mark.parametrize("memory_s", [0.1, 0.5])
def test_a_filter_of_all_angles_is_no_delay_of_some(
    run: tuple[str, int, float, float], memory_s: float, tmp_path: Path
) -> None:
    """It delays quick angles (roll, pitch) by less than slow ones."""
    made = make_log(world(*run))
    columns = dict(made.columns)
    keep = np.exp(-np.diff(columns["time_s"]) / memory_s)
    for name in ("roll_deg", "pitch_deg", "yaw_deg"):
        own = np.unwrap(columns[name], period=360.0)
        for k, share in enumerate(keep):
            own[k + 1] = share * own[k] + (1.0 - share) * own[k + 1]
        columns[name] = np.mod(own + 180.0, 360.0) - 180.0
    spec = tmp_path / "spec.yaml"
    spec.write_text(made.spec_yaml(), "utf-8")
    assert told(spec, write_columns(tmp_path / "log.csv", columns)) is None


def test_a_late_heading_breaks_the_attitudes_latency_alone(tmp_path: Path) -> None:
    """Noise of a sound attitude it was, beside a delay of 64 ms."""
    answer = accepted(*late_columns(tmp_path, world(*CIRCLES), ("yaw_deg",), 0.1))
    rows = {(row.role, row.assumption): row for row in answer.assumptions}
    assert [key for key, row in rows.items() if row.status == "broken"] == [("attitude", "latency")]
    assert answer.groups == ()
    row = rows["attitude", "latency"]
    assert "in yaw alone" in row.evidence
    assert row.measured is not None
    assert row.measured.low is not None
    assert row.measured.high is not None
    assert row.measured.low < 0.1 < row.measured.high < row.measured.low + 0.03


def test_a_diagnosis_names_the_angle_and_nothing_beside(tmp_path: Path) -> None:
    spec, log = late_columns(tmp_path, world(*TURNS), ("yaw_deg",), 0.05)
    found = diagnose(load(spec), [log])
    (finding,) = [f for f in found.findings if f.material]
    assert (finding.effect, finding.sensor) == ("latency", "attitude")
    assert finding.sentence.endswith("in yaw alone")
    assert found.verdict == "explained"


def test_angles_are_put_back_across_half_a_turn(tmp_path: Path) -> None:
    """Against the columns of the sound log: as noisy as both, and not off by turns."""
    spec, path = late_columns(tmp_path, world(*CIRCLES), (), 0.25)
    kept = measured(load(spec), [path]).log
    late = late_columns(tmp_path, world(*CIRCLES), ("yaw_deg",), 0.25)[1]
    back, known = put_back(measured(load(spec), [late]).log, ReadingPart("attitude", (2,)), 0.25)
    off = back.stages[0].euler_rad[known, 2] - kept.stages[0].euler_rad[known, 2]
    off = np.angle(np.exp(1j * off))
    assert np.sum(~known) <= 3
    assert np.max(np.abs(off)) < 0.02
