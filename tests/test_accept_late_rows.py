"""`accept` on rows that are late by far more than motion carries on, for a while or here and there.

The logs are of the tests' own world: the columns of a device are those of a second log of the same
run in which all of them are late, in the rows that are to be.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.comparison.acceptance import Acceptance
from syncline_design.diagnosis.late_runs import Late, late_by_turns, late_runs
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_accept_stretches import world
from tests.world import Hidden, Noise, Scenario, hidden, make_log
from tests.world.trajectory import Array
from tests.world.worldlog import write_columns

AXES = ("north", "east", "down")
OF = {
    "position": [f"position_{axis}_m" for axis in AXES],
    "attitude": ["roll_deg", "pitch_deg", "yaw_deg"],
    "ranging": ["range_m", "azimuth_deg", "elevation_deg"],
}
RATES = [f"rate_{axis}_degps" for axis in "xyz"]
Mask = Callable[[Array], Array]
RUN = ("multirotor_lines", 9, 80.0, 8.0)


def during(from_s: float, to_s: float) -> Mask:
    return lambda time_s: (time_s > from_s) & (time_s < to_s)


def here_and_there(share: float, seed: int) -> Mask:
    return lambda time_s: np.random.default_rng(seed).random(len(time_s)) < share


def mixed(
    folder: Path, device: str, delay_s: float, rows: Mask, noise: Noise | None = None,
    rates: bool = True,
) -> tuple[Path, Path]:  # fmt: skip
    """Spec and log of which a device is late in some rows; rates: whether those go with angles."""
    run = world(*RUN)
    sound = make_log(run, (), noise)
    late = make_log(run, (hidden("latency", device, latency_s=delay_s),), noise)
    columns = dict(sound.columns)
    at = rows(columns["time_s"] - columns["time_s"][0])
    for name in [*OF[device], *(RATES if device == "attitude" and rates else [])]:
        columns[name] = np.where(at, late.columns[name], columns[name])
    spec = folder / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    return spec, write_columns(folder / "log.csv", columns)


def looked_at(spec: Path, log: Path) -> tuple[Scene, list[tuple[Late, ...]]]:
    inputs = measured(load(spec), [log])
    view = scene(inputs.system, inputs.log, inputs.known)
    return view, late_runs(view, np.zeros(len(view), bool))


def accepted(spec: Path, log: Path) -> Acceptance:
    asked = AcceptSettings(("latency", "lever_arm", "mounting", "noise"))
    return accept(load(spec), [log], asked, seed=0)


def broken_alone(told: Acceptance, device: str, delay_s: float) -> None:
    """One row is broken, with an interval that holds the truth, and no group."""
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    broken = [key for key, row in rows.items() if row.status == "broken"]
    assert broken == [(device, "latency")], told.broken_by
    assert told.groups == ()
    figure = rows[device, "latency"].measured
    assert figure is not None
    assert figure.low is not None
    assert figure.high is not None
    assert figure.low - 1e-3 < delay_s < figure.high + 1e-3
    assert figure.high - figure.low < 0.1 * delay_s


@pytest.mark.parametrize(
    ("delay_s", "from_s", "to_s", "rates"),
    [(0.5, 30.0, 33.0, True), (1.0, 30.0, 36.0, True), (0.7, 40.0, 50.0, False)],
)
def test_angles_that_are_late_by_much_for_a_while_are_no_noise_of_others(
    delay_s: float, from_s: float, to_s: float, rates: bool, tmp_path: Path
) -> None:
    """What turned in the last of that time is in no row; noise of places fitted as well."""
    told = accepted(*mixed(tmp_path, "attitude", delay_s, during(from_s, to_s), rates=rates))
    broken_alone(told, "attitude", delay_s)
    row = next(r for r in told.assumptions if (r.role, r.assumption) == ("attitude", "latency"))
    assert row.from_s == pytest.approx(from_s, abs=0.5)
    assert row.to_s == pytest.approx(to_s, abs=0.5)


def test_ranges_of_another_second_break_their_latency(tmp_path: Path) -> None:
    """Eight rows that are older than they last: two seconds late for one."""
    broken_alone(accepted(*mixed(tmp_path, "ranging", 2.0, during(40.0, 41.0))), "ranging", 2.0)


@pytest.mark.parametrize("device", ["position", "attitude", "ranging"])
def test_single_rows_that_are_late_are_no_noise(device: str, tmp_path: Path) -> None:
    """One row in twenty by 200 ms: of every fit louder noise, of whichever sensor."""
    spec, log = mixed(tmp_path, device, 0.2, here_and_there(0.05, 3))
    told = accepted(spec, log)
    broken_alone(told, device, 0.2)
    (text,) = [row.evidence for row in told.assumptions if row.status == "broken"]
    assert "of the rows, here and there" in text


def growing(folder: Path, run: Scenario, from_s: float, most_s: float) -> tuple[Path, Path]:
    """A spec and a log whose places are late from then on, by more and more for half a minute."""
    sound = make_log(run)
    time_s = sound.columns["time_s"] - sound.columns["time_s"][0]
    since = time_s - from_s
    delay_s = np.where((since > 0.0) & (since < 30.0), since / 30.0 * most_s, 0.0)
    columns = dict(sound.columns)
    for name in OF["position"]:
        columns[name] = np.interp(time_s - delay_s, time_s, columns[name])
    spec = folder / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    return spec, write_columns(folder / "log.csv", columns)


def test_a_delay_that_grows_is_told_by_the_largest_that_acted(tmp_path: Path) -> None:
    """From nothing to 0.6 s in half a minute; its mean acted nowhere long."""
    spec, log = growing(tmp_path, world(*RUN), 20.0, 0.6)
    _, found = looked_at(spec, log)
    assert all(one.sensor == "position" for (one,) in found)
    assert any(one.ends_s is not None for (one,) in found)
    told = accept(load(spec), [log], AcceptSettings(("latency",)), seed=0)
    (row,) = [row for row in told.assumptions if row.status == "broken"]
    assert row.measured is not None
    assert row.measured.value == pytest.approx(0.6, abs=0.02)
    assert "grows from" in row.evidence


def test_many_late_rows_are_no_witness_of_each_other(tmp_path: Path) -> None:
    """One row in eight: those too small to be far off are no sound ones."""
    spec, log = mixed(tmp_path, "attitude", 0.2, here_and_there(0.125, 8))
    _, found = looked_at(spec, log)
    ((one,),) = found
    assert (one.sensor, one.single) == ("attitude", True)
    assert abs(one.delay_s - 0.2) < 3.0 * one.spread_s < 0.02


def test_late_rows_that_chance_puts_side_by_side_are_single_rows(tmp_path: Path) -> None:
    """Six of nine in one place are dense enough for a while, in which no delay fits the others."""
    scattered, dense = here_and_there(0.06, 2), [0, 1, 3, 5, 6, 8]

    def rows(time_s: Array) -> Array:
        at = scattered(time_s) & ~during(36.0, 44.0)(time_s)
        at[np.searchsorted(time_s, 40.0) + np.array(dense)] = True
        return at

    spec, log = mixed(tmp_path, "ranging", 0.2, rows)
    view, found = looked_at(spec, log)
    ((one,),) = found
    assert (one.sensor, one.single) == ("ranging", True)
    time_s = view.log.time_s - view.log.time_s[0]
    assert np.sum(during(39.9, 41.2)(time_s[one.rows])) >= len(dense) - 1
    assert abs(one.delay_s - 0.2) < 3.0 * one.spread_s < 0.02


def test_a_delay_that_grows_begins_before_it_is_far_off(tmp_path: Path) -> None:
    """What is left of its beginning would be something else (an arm that comes and goes)."""
    run = world("fixed_wing_circuits", 2, 80.0, 8.0)
    view, found = looked_at(*growing(tmp_path, run, 30.0, 0.3))
    time_s = view.log.time_s - view.log.time_s[0]
    ((one,),) = found
    assert one.ends_s is not None
    assert one.ends_s[0] == pytest.approx(0.0, abs=0.01)
    assert one.delay_s == pytest.approx(0.3, abs=0.01)
    assert time_s[one.rows[0]] == pytest.approx(30.0, abs=0.5)


def test_what_is_no_delay_is_none(tmp_path: Path) -> None:
    """Noise twenty times as loud for a while, or here and there."""
    run = world(*RUN)
    rng = np.random.default_rng(5)
    sound = make_log(run)
    time_s = sound.columns["time_s"] - sound.columns["time_s"][0]
    spec = tmp_path / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    for at in (during(30.0, 40.0)(time_s), here_and_there(0.1, 4)(time_s)):
        columns = dict(sound.columns)
        for name in OF["position"]:
            columns[name] = columns[name] + at * rng.normal(0.0, 1.0, len(time_s))
        view, found = looked_at(spec, write_columns(tmp_path / "log.csv", columns))
        assert np.max(np.abs(np.nan_to_num(view.error()))) > 1.0
        assert found == []


@pytest.mark.parametrize(
    ("what", "device"),
    [
        (hidden("lever_arm", "position", x_m=0.8, y_m=0.3, z_m=0.0), "position"),
        (hidden("mounting", "attitude", x_rad=0.0, y_rad=0.1, z_rad=0.4), "attitude"),
        (hidden("latency", "position", latency_s=0.8), "position"),
    ],
)
def test_what_goes_on_to_the_end_of_a_log_is_left_to_the_search(
    what: Hidden, device: str, tmp_path: Path
) -> None:
    """It may be built in and have changed once, or be a step of stamps, which breaks `timing`."""
    run = world(*RUN)
    sound, off = make_log(run), make_log(run, (what,))
    at = sound.columns["time_s"] - sound.columns["time_s"][0] > 60.0
    columns = dict(sound.columns)
    for name in OF[device]:
        columns[name] = np.where(at, off.columns[name], columns[name])
    spec = tmp_path / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    view, found = looked_at(spec, write_columns(tmp_path / "log.csv", columns))
    assert np.median(np.linalg.norm(np.nan_to_num(view.error())[at], axis=1)) > 0.5
    assert found == []


def by_turns(period: int, first: int) -> Mask:
    return lambda time_s: np.arange(len(time_s)) % period == first


@pytest.mark.parametrize("device", ["position", "attitude", "ranging"])
@pytest.mark.parametrize(("period", "delay_s"), [(2, 0.05), (3, 0.08)])
def test_rows_that_are_late_by_turns_are_told_by_their_device(
    device: str, period: int, delay_s: float, tmp_path: Path
) -> None:
    view, _ = looked_at(*mixed(tmp_path, device, delay_s, by_turns(period, 1)))
    (one,) = late_by_turns(view, np.zeros(len(view), bool))
    assert one.sensor == device
    assert np.array_equal(one.rows, np.arange(len(view))[1::period])
    assert abs(one.delay_s - delay_s) < 3.0 * one.spread_s < 0.02


def test_every_second_place_that_is_late_breaks_its_latency_alone(tmp_path: Path) -> None:
    """In half of the log: 10 ms late in all of it, and three times as noisy, it was."""
    told = accepted(*mixed(tmp_path, "position", 0.05, by_turns(2, 1)))
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    assert [key for key, row in rows.items() if row.status == "broken"] == [("position", "latency")]
    figure = rows["position", "latency"].measured
    assert figure is not None
    assert figure.low is not None
    assert figure.high is not None
    assert figure.low < 0.05 < figure.high < figure.low + 0.02
    assert "single rows" in rows["position", "latency"].evidence


def test_rows_of_one_delay_take_no_turns(tmp_path: Path) -> None:
    """A sound log, one that is late as a whole, for a while, and here and there."""
    for at, delay_s in (
        (during(0.0, 0.0), 0.1), (during(-1.0, 1e9), 0.1), (during(30.0, 40.0), 0.1),
        (here_and_there(0.2, 6), 0.2),
    ):  # fmt: skip
        view, _ = looked_at(*mixed(tmp_path, "position", delay_s, at))
        assert late_by_turns(view, np.zeros(len(view), bool)) == ()


def test_every_second_reading_that_scatters_takes_no_turns(tmp_path: Path) -> None:
    sound = make_log(world(*RUN))
    rng = np.random.default_rng(5)
    columns = dict(sound.columns)
    at = np.arange(len(columns["time_s"])) % 2
    for name in OF["position"]:
        columns[name] = columns[name] + at * rng.normal(0.0, 0.3, len(at))
    spec = tmp_path / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    view, _ = looked_at(spec, write_columns(tmp_path / "log.csv", columns))
    assert late_by_turns(view, np.zeros(len(view), bool)) == ()
