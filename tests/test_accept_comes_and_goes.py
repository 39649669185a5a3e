"""`accept` on what comes and goes: delays of any size for a while, and devices that hang."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from benchmarks.accept_world import MOTIONS, Drive, Fault, write
from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.diagnosis.built import _seen as seen_in
from syncline_design.diagnosis.episodes import Episode, with_episodes
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.frozen import frozen
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.search import SearchResult
from syncline_design.diagnosis.searched import SearchedLog, slip_of
from syncline_design.diagnosis.spans import StampSpan
from syncline_design.diagnosis.stretches import stretches
from syncline_design.diagnosis.system import measured
from syncline_design.effects import plain_delay, registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Effect
from syncline_design.logs.log import Log
from syncline_design.model.system import System
from syncline_design.spec.load import load
from tests.test_accept_stretches import fastest_s, files, late, seen, settled, world
from tests.world import hidden


def held(log: Path, columns: Sequence[str], from_s: float, to_s: float) -> Path:
    """The log with what a device gave last before a time given over and over until another."""
    lines = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    at = [lines[0].index(name) for name in columns]
    first = float(lines[1][0])
    rows = [k for k in range(1, len(lines)) if from_s < float(lines[k][0]) - first < to_s]
    for k in rows:
        for column in at:
            lines[k][column] = lines[rows[0] - 1][column]
    log.write_text("\n".join(",".join(line) for line in lines) + "\n", "utf-8")
    return log


PLACES = tuple(f"position_{axis}_m" for axis in ("north", "east", "down"))
ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")


@pytest.mark.parametrize(
    ("columns", "role", "lasts_s"),
    [(PLACES, "position", 1.3), (PLACES, "position", 10.0), (ANGLES, "attitude", 5.0)],
)
def test_a_device_that_repeats_its_last_reading_breaks_its_latency(
    columns: Sequence[str], role: str, lasts_s: float, tmp_path: Path
) -> None:
    """Its data are as old as the run is long, which no constant delay nor arm fits."""
    run = world("fixed_wing_circuits", 2)
    spec, log = files(tmp_path, run)
    from_s = fastest_s(run)
    told = accept(load(spec), [held(log, columns, from_s, from_s + lasts_s)],
                  AcceptSettings(("latency", "lever_arm", "mounting")), seed=0)  # fmt: skip
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    row = rows[role, "latency"]
    assert row.status == "broken", row
    assert row.measured is not None
    assert row.measured.value == pytest.approx(lasts_s, abs=0.25)
    assert "repeats one reading" in row.evidence
    assert row.from_s == pytest.approx(from_s, abs=0.25)
    assert row.to_s == pytest.approx(from_s + lasts_s, abs=0.25)
    assert [key for key, one in rows.items() if one.status == "broken"] == [(role, "latency")]
    assert told.groups == ()


@pytest.mark.parametrize("columns", [(), ("north", "east", "down")])
def test_the_return_of_a_receiver_that_hung_is_no_speed(
    columns: Sequence[str], tmp_path: Path
) -> None:
    """Its places jump by what it missed; the velocities of the log, or none, know better."""
    run = world("fixed_wing_circuits", 2)
    spec, log = files(tmp_path, run)
    from_s = fastest_s(run)
    log = held(log, PLACES, from_s, from_s + 8.0)
    lines = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    left = [f"velocity_{axis}_mps" for axis in columns]
    kept = [k for k, name in enumerate(lines[0]) if name not in left]
    log.write_text("\n".join(",".join(line[k] for k in kept) for line in lines) + "\n", "utf-8")
    told = accept(load(spec), [log], AcceptSettings(("latency", "speed")), seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    assert rows["position", "latency"].status == "broken"
    (speed,) = [row for row in told.assumptions if row.assumption == "speed"]
    limit = run.carriers[0].v_max_mps
    assert speed.status == "holds", speed
    assert speed.measured is not None
    assert speed.measured.value is not None
    assert 0.5 * limit < speed.measured.value < limit


def test_readings_that_are_held_all_along_or_on_a_vehicle_that_rests_are_none(
    tmp_path: Path,
) -> None:
    """A log at five times the rate of its receiver, and one of a receiver that holds its place."""
    run = world("fixed_wing_circuits", 2)
    spec, log = files(tmp_path, run)
    seen = scene(*_of(spec, log))
    assert frozen(seen) == []
    first = seen.log.stages[0]
    assert first.antenna_m is not None
    every = np.arange(len(seen)) // 5 * 5
    slower = replace(first, antenna_m=first.antenna_m[every])
    assert frozen(scene(seen.system, replace(seen.log, stages=(slower,)))) == []
    rests = replace(first, antenna_m=np.where(np.arange(len(seen))[:, None] < 50,
                                              first.antenna_m[:1], first.antenna_m),
                    velocity_mps=np.where(np.arange(len(seen))[:, None] < 50, 0.0,
                                          first.velocity_mps))  # fmt: skip
    assert frozen(scene(seen.system, replace(seen.log, stages=(rests,)))) == []
    hangs = replace(rests, velocity_mps=first.velocity_mps)
    (one,) = frozen(scene(seen.system, replace(seen.log, stages=(hangs,))))
    assert (one.sensor, one.first, one.last) == ("position", 1, 49)


@pytest.mark.parametrize("creeps", [False, True])
def test_a_reading_that_trembles_hangs_and_one_that_creeps_on_does_not(
    creeps: bool, tmp_path: Path
) -> None:
    """A tenth of its noise about one place is no sound reading; a slow one that is far better than
    its figure leaves its first place behind."""
    run = world("fixed_wing_circuits", 2)
    seen = scene(*_of(*files(tmp_path, run)))
    first = seen.log.stages[0]
    assert first.antenna_m is not None
    stage = seen.system.stages[0].position
    assert stage is not None
    sigma = np.array(stage.sigma)
    place, rows = first.antenna_m.copy(), np.arange(100, 140)
    rng = np.random.default_rng(3)
    place[rows] = place[99] + 0.1 * sigma * rng.uniform(-1.0, 1.0, (len(rows), 3))
    velocity = first.velocity_mps.copy()
    if creeps:  # by a fifth of its noise a row, with velocities that say so
        step_m = 0.2 * float(np.min(sigma))
        place[rows] = place[99] + step_m * (rows - 99)[:, None] * np.eye(3)[0]
        velocity[98:142] = step_m / seen.log.interval_s * np.eye(3)[0]
    log = replace(seen.log, stages=(replace(first, antenna_m=place, velocity_mps=velocity),))
    found = [(one.sensor, one.first, one.last) for one in frozen(scene(seen.system, log))]
    assert found == ([] if creeps else [("position", 100, 139)])


def _of(spec: Path, log: Path) -> tuple[System, Log]:
    inputs = measured(load(spec), [log])
    return inputs.system, inputs.log


@pytest.mark.parametrize(("size_s", "lasts_s"), [(0.2, 1.5), (0.5, 8.0), (1.0, 10.0)])
def test_a_large_delay_for_a_while_is_sized_and_no_arm(
    size_s: float, lasts_s: float, tmp_path: Path
) -> None:
    """Velocities keep their stamps meanwhile, though in all of the log they share the places'."""
    run = world("multirotor_lines", 5, 50.0, 4.0)
    from_s = fastest_s(run)
    spec, log = files(tmp_path, run, late(size_s, from_s, from_s + lasts_s))
    told = accept(load(spec), [log], AcceptSettings(("latency", "lever_arm")), seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    row = rows["position", "latency"]
    assert row.status == "broken", row
    assert row.measured is not None
    assert row.measured.low is not None
    assert row.measured.high is not None
    assert row.measured.low < size_s < row.measured.high
    assert row.measured.high - row.measured.low < 0.2 * size_s
    assert told.groups == ()
    assert rows["position", "lever_arm"].status != "broken"


@pytest.mark.parametrize("seconds", [1.0, -2.0])
def test_whole_seconds_of_a_while_are_put_back_in_none_of_the_log(seconds: float) -> None:
    """1 s for 10 s was undone everywhere, and the rest of the log was a second early."""
    whole = plain_delay()

    def put_back(effect: Effect) -> Acting | None:
        one = Acting(effect, "position", 0, {effect.parameters[0].name: seconds})
        model = SimpleNamespace(acting=(one,), covariance=np.array([[1e-6]]))
        return slip_of(cast(SearchResult, SimpleNamespace(model=model)))

    assert put_back(StampSpan(whole, 20.0, 30.0).cut) is None
    slip = put_back(whole)
    assert slip is not None
    assert list(slip.values.values()) == [seconds]


def test_angles_that_are_late_for_a_while_turn_nothing(tmp_path: Path) -> None:
    """0.3 s for 3 s of a turn: a window of it fits a turn of the ranging sensor better."""
    run = world("fixed_wing_circuits", 2)
    at_s = fastest_s(run)
    steps = tuple(
        hidden("timestamp_step", "attitude", step_s=size, time_s=when)
        for size, when in ((0.3, at_s), (-0.3, at_s + 3.0))
    )
    spec, log = files(tmp_path, run, steps)
    told = accept(load(spec), [log], AcceptSettings(("latency", "mounting", "noise")), seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    assert [key for key, one in rows.items() if one.status == "broken"] == [("attitude", "latency")]
    figure = rows["attitude", "latency"].measured
    assert figure is not None
    assert figure.value == pytest.approx(0.3, rel=0.05)


def test_a_delay_that_was_taken_for_louder_noise_is_a_delay(tmp_path: Path) -> None:
    """Rows that one value makes up do not scatter, however loud a fit of the noise makes them."""
    run = world("multirotor_lines", 5, 50.0, 4.0)
    at_s = fastest_s(run)
    steps = tuple(
        hidden("timestamp_step", "attitude", step_s=size, time_s=when)
        for size, when in ((0.25, at_s), (-0.25, at_s + 2.0))
    )
    data, model, known = settled(*files(tmp_path, run, steps))
    sensor = next(w.sensor for w in data.structure.white if w.sensor[1] == "attitude")
    loud = Episode(sensor, at_s, at_s + 2.0, 60.0, 5.0, 100.0)
    search = SimpleNamespace(
        proposals=SimpleNamespace(free_signatures=lambda _: known, signatures=known),
        episodes=(loud,), settings=SimpleNamespace(seed=0),
    )  # fmt: skip
    louder = with_episodes(data, (loud,))
    assert ("latency", "attitude", 0) not in [
        s.label for s in stretches(louder, model, known, 0).stands if s.sure
    ]
    one = SimpleNamespace(data=louder, search=search, result=SimpleNamespace(model=model))
    first = seen_in(cast(SearchedLog, one)).stands[0]
    assert (first.label, first.sure) == (("latency", "attitude", 0), True)
    assert first.values[0] == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize("what", ["arm", "stamps"])
def test_an_arm_that_changed_once_is_no_step_of_the_stamps(what: str, tmp_path: Path) -> None:
    """A search that asks for what acts in all of a log first takes 30 cm from 60 s on for a step
    of the stamps; a step it leaves alone."""
    drive = Drive("launch", "errands", "white", 5, 100.0, 8.0)
    off = Fault(arm_m={"ranging": (0.3, 0.0, 0.0)})
    if what == "stamps":
        off = Fault(late_s={"position": 0.1})
    folders = [tmp_path / name for name in ("before", "after")]
    for folder in folders:
        folder.mkdir()
    (spec, sound), (_, changed) = (write(drive, fault, folder)
                                   for fault, folder in zip((Fault(), off), folders, strict=True)
                                   )  # fmt: skip
    lines, later = (log.read_text("utf-8").splitlines() for log in (sound, changed))
    first = next(k for k in range(1, len(lines)) if float(lines[k].split(",")[0]) > 60.0)
    sound.write_text("\n".join([*lines[:first], *later[first:]]) + "\n", "utf-8")
    data, model, known = settled(spec, sound)
    step = Acting(registry()["timestamp_step"], "position", 0, {"step_s": 0.05, "time_s": 60.0})
    stepped = fit(data, (step,), model.opened, start=model.level)
    search = SimpleNamespace(
        proposals=SimpleNamespace(free_signatures=lambda _: known, signatures=known),
        episodes=(), settings=SimpleNamespace(seed=0),
    )  # fmt: skip
    result = SimpleNamespace(model=stepped)
    one = cast(SearchedLog, SimpleNamespace(data=data, search=search, result=result))
    stands = tuple(each for each in seen_in(one).stands if each.sure)
    if what == "stamps":
        assert stands == ()
        return
    (own,) = stands
    assert {label[:2] for label in (own.label, *own.others)} >= {
        ("lever_arm", "position"), ("lever_arm", "ranging"),
    }  # fmt: skip
    assert own.from_s == pytest.approx(60.0, abs=1.0)
    assert math.hypot(*own.values) == pytest.approx(0.3, rel=0.1)


def turned_from(log: Path, share: float, size_deg: float) -> Path:
    """The log with azimuths that are too large from a share of its rows on."""
    lines = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    at = lines[0].index("azimuth_deg")
    for row in lines[1 + round(share * (len(lines) - 1)) :]:
        row[at] = f"{float(row[at]) + size_deg:.6f}"
    log.write_text("\n".join(",".join(line) for line in lines) + "\n", "utf-8")
    return log


@pytest.mark.parametrize(
    ("name", "seed", "size_deg"),
    [("car_stops", 3, 0.15), ("car_stops", 3, 0.5), ("fixed_wing_circuits", 2, 0.5)],
)
def test_azimuths_that_are_off_from_half_of_the_log_on_stand_out_from_then_on(
    name: str, seed: int, size_deg: float, tmp_path: Path
) -> None:
    """They raise the median of what short windows show, and pass for slow noise of the angles."""
    spec, log = files(tmp_path, world(name, seed))
    first = seen(spec, turned_from(log, 0.5, size_deg)).stands[0]
    assert first.sure
    assert first.noise_of == ()
    assert not first.inside
    assert first.from_s == pytest.approx(30.0, abs=1.0)
    told = {first.label[0]: first.values} | {one.label[0]: one.values for one in first.instead}
    assert "azimuth_bias" in told
    assert told["azimuth_bias"][0] == pytest.approx(math.radians(size_deg), rel=0.1)


@pytest.mark.parametrize("vehicle", ["quadrotor", "glider", "van"])
@pytest.mark.parametrize("noise", ["slow", "flicker"])
def test_slow_noise_of_a_sound_log_changes_nothing_once(
    vehicle: str, noise: str, tmp_path: Path
) -> None:
    """A memory of 25 s, or of all of the log, moves its halves apart by far more than white."""
    drive = Drive(vehicle, MOTIONS[len(vehicle) % 3], noise, 708)
    data, model, known = settled(*write(drive, Fault(), tmp_path))
    stands = stretches(data, model, known, 0).stands
    assert [s for s in stands if s.sure and not s.noise_of and s.log_p < -100.0] == []
