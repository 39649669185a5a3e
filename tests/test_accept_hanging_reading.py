"""`accept` on one reading of a device that hangs while its others go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.diagnosis.frozen import Frozen, frozen
from syncline_design.diagnosis.frozen_channels import frozen_channels
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.system import measured
from syncline_design.logs.log import StageLog
from syncline_design.spec.load import load
from tests.test_accept_comes_and_goes import held
from tests.test_accept_stretches import fastest_s, files, world

RUN = ("fixed_wing_circuits", 2)


def looked_at(spec: Path, log: Path) -> Scene:
    inputs = measured(load(spec), [log])
    return scene(inputs.system, inputs.log, inputs.known)


def hanging(view: Scene, stage: StageLog | None = None) -> list[Frozen]:
    """Of a log, or of one of another stage: nothing hangs in whole."""
    if stage is not None:
        view = scene(view.system, replace(view.log, stages=(stage,)))
    assert frozen(view) == []
    return list(frozen_channels(view, []))


@pytest.mark.parametrize(
    ("column", "sensor", "reading", "lasts_s"),
    [
        ("yaw_deg", "attitude", "yaw", 3.0),
        ("position_east_m", "position", "east", 2.0),
        ("azimuth_deg", "ranging", "azimuth", 2.0),
        ("range_m", "ranging", "range", 2.0),
    ],
)
def test_one_reading_that_hangs_is_told_by_its_course(
    column: str, sensor: str, reading: str, lasts_s: float, tmp_path: Path
) -> None:
    run = world(*RUN)
    spec, log = files(tmp_path, run)
    from_s = fastest_s(run)
    view = looked_at(spec, held(log, [column], from_s, from_s + lasts_s))
    (one,) = hanging(view)
    assert (one.sensor, one.reading) == (sensor, reading)
    assert one.age_s == pytest.approx(lasts_s, abs=0.3)
    assert view.log.time_s[one.first] - view.log.time_s[0] == pytest.approx(from_s, abs=0.3)


def test_a_heading_that_hangs_breaks_its_latency_and_no_mounting(tmp_path: Path) -> None:
    """A turn of the mounting that comes and goes would fit as well as any constant."""
    run = world(*RUN)
    spec, log = files(tmp_path, run)
    from_s = fastest_s(run)
    asked = AcceptSettings(("latency", "lever_arm", "mounting", "noise"))
    log = held(log, ["yaw_deg"], from_s, from_s + 3.0)
    told = accept(load(spec), [log], asked, seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    assert [key for key, row in rows.items() if row.status == "broken"] == [("attitude", "latency")]
    assert told.groups == ()
    row = rows["attitude", "latency"]
    assert row.measured is not None
    assert row.measured.value == pytest.approx(3.0, abs=0.3)
    assert "of its yaw, while its others go on" in row.evidence


def test_readings_that_rest_by_themselves_do_not_hang(tmp_path: Path) -> None:
    """A sound log; headings in steps that are far coarser than their noise; places whose
    velocities are told in other axes."""
    view = looked_at(*files(tmp_path, world(*RUN)))
    first = view.log.stages[0]
    assert first.antenna_m is not None
    assert hanging(view) == []
    grid, angles = np.radians(20.0), first.euler_rad.copy()
    angles[:, 2] = np.round(angles[:, 2] / grid) * grid
    coarse = replace(first, euler_rad=angles)
    assert hanging(view, coarse) == []
    place, half = first.antenna_m.copy(), len(view) // 2
    place[half : half + 20, 1] = place[half, 1]  # a straight leg to the north
    swapped = first.velocity_mps[:, [1, 0, 2]]
    other = replace(first, antenna_m=place, velocity_mps=swapped)
    assert hanging(view, other) == []
