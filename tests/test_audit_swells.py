"""Streams without a rhythm whose receipts come later for a while: a busy host, or a clock set back.

Every world is written down here: when a sensor measured, by how much its clock went back meanwhile,
how much longer its messages took.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit
from syncline_design.auditing.series import Array
from tests.test_audit_clocks import counted, even, names, written

LENGTH_S = 90.0
BEGIN_S, END_S = 31.0, 36.0
Course = Callable[[Array], Array]  # of 1 at most, from 0 to 1 of a stretch
SWELLS: dict[str, Course] = {
    "round": lambda x: np.sin(np.pi * x),
    "steep": lambda x: np.minimum(1.0, 8.0 * np.minimum(x, 1.0 - x)),
    "at once": lambda x: np.ones(x.size),
}


def events(rate: float, seed: int) -> Array:
    rng = np.random.default_rng([1601, seed])
    when = np.cumsum(rng.gamma(2.0, 0.5 / rate, int(1.3 * rate * LENGTH_S)))
    return np.asarray(when[when < LENGTH_S])


def swollen(
    t: Array, most_s: float, how: str, begin_s: float = BEGIN_S, end_s: float = END_S
) -> Array:
    x = (t - begin_s) / (end_s - begin_s)
    return np.where((x > 0.0) & (x < 1.0), most_s * SWELLS[how](np.clip(x, 0.0, 1.0)), 0.0)


def meanwhile(t: Array) -> Array:
    return np.where((t >= BEGIN_S) & (t < END_S), 1.0, 0.0)


def came(t: Array, seed: int, longer: Array | float = 0.0) -> Array:
    """Receipts in order, after 30 ms, a delay with a tail, and what a load adds."""
    rng = np.random.default_rng([1602, seed])
    return np.maximum.accumulate(t + 0.03 + rng.gamma(2.0, 1e-3, t.size) + longer)


def rows(folder: Path, streams: dict[str, tuple[Array, Array]]) -> dict[str, StreamAudit]:
    paths = [written(folder / f"{name}.csv", *both) for name, both in streams.items()]
    return {row.name: row for row in audit(paths).streams}


def undecided(row: StreamAudit) -> bool:
    return any("stamps went back by" in words for words in row.cannot_show)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("most_s", [0.012, 0.04, 0.12])
@pytest.mark.parametrize("how", SWELLS)
def test_a_load_of_the_host_is_no_step_of_events(
    tmp_path: Path, how: str, most_s: float, seed: int
) -> None:
    sensors = {"imu": even(50.0, LENGTH_S)}
    sensors |= {"laser": events(20.0, seed), "radar": events(12.0, seed)}
    streams = {
        name: (t, came(t, 10 * seed + k, swollen(t, most_s, how)))
        for k, (name, t) in enumerate(sensors.items())
    }
    found = rows(tmp_path, streams)
    assert {name: names(row) for name, row in found.items()} == {name: [] for name in sensors}
    assert not any(undecided(row) for row in found.values())
    for name in ("laser", "radar"):  # the load is in the bound as it is in that of the even stream
        stamp, receive = streams[name]
        assert found[name].residual_s.bound == pytest.approx(np.ptp(receive - stamp), rel=0.05)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("back_s", [0.04, 0.06])
@pytest.mark.parametrize("load", ["none", "earlier", "later"])
def test_events_whose_clock_goes_back_for_a_while_are_named(
    tmp_path: Path, load: str, back_s: float, seed: int
) -> None:
    """Beside an even stream that is quiet then, or whose load is of another time."""
    at = {"none": 80.0, "earlier": 12.0, "later": END_S + 9.0}[load]
    most_s = 0.0 if load == "none" else back_s
    imu, laser = even(50.0, LENGTH_S), events(20.0, seed)
    found = rows(tmp_path, {
        "imu": (imu, came(imu, seed, swollen(imu, most_s, "round", at, at + 5.0))),
        "laser": (laser - back_s * meanwhile(laser),
                  came(laser, seed + 50, swollen(laser, most_s, "round", at, at + 5.0))),
    })  # fmt: skip
    assert names(found["imu"]) == []
    (step,) = counted(found["laser"])
    assert step.fault == "step"
    assert step.from_s == pytest.approx(BEGIN_S, abs=0.3)
    assert step.to_s == pytest.approx(END_S, abs=0.3)
    assert step.parameters["seconds"] == pytest.approx(-back_s, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_of_another_size_than_the_load_is_named(tmp_path: Path, seed: int) -> None:
    imu, laser = even(50.0, LENGTH_S), events(20.0, seed)
    found = rows(tmp_path, {
        "imu": (imu, came(imu, seed, swollen(imu, 0.015, "steep"))),
        "laser": (laser - 0.05 * meanwhile(laser),
                  came(laser, seed + 50, swollen(laser, 0.015, "steep"))),
    })  # fmt: skip
    assert names(found["imu"]) == []
    assert names(found["laser"]) == ["step"]


@pytest.mark.parametrize("seed", range(3))
def test_one_clock_that_stamps_both_is_no_load(tmp_path: Path, seed: int) -> None:
    """The even stream's stamps leave their rhythm: its receipts are not later."""
    imu, laser = even(50.0, LENGTH_S), events(20.0, seed)
    found = rows(tmp_path, {
        name: (t - 0.05 * meanwhile(t), came(t, seed + k))
        for k, (name, t) in enumerate({"imu": imu, "laser": laser}.items())
    })  # fmt: skip
    assert {name: names(row) for name, row in found.items()} == {"imu": ["step"], "laser": ["step"]}


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("how", SWELLS)
@pytest.mark.parametrize("seed", range(3))
def test_events_alone_do_not_tell_a_load_from_their_clock(
    tmp_path: Path, seed: int, how: str, beside: bool
) -> None:
    """Nor beside other events, which one clock may have stamped as well."""
    sensors = {"laser": events(20.0, seed)} | ({"radar": events(15.0, seed)} if beside else {})
    streams = {
        name: (t, came(t, seed + 20 * k, swollen(t, 0.04, how)))
        for k, (name, t) in enumerate(sensors.items())
    }
    found = rows(tmp_path, streams)
    assert {name: names(row) for name, row in found.items()} == {name: [] for name in sensors}
    stamp, receive = streams["laser"]
    assert found["laser"].residual_s.bound == pytest.approx(np.ptp(receive - stamp), rel=0.05)
    if how == "at once":
        assert undecided(found["laser"])


@pytest.mark.parametrize("seed", range(4))
def test_stamps_that_fall_tell_that_their_clock_went_back(tmp_path: Path, seed: int) -> None:
    """Alone, too: no message is measured before the one that came before it."""
    t = np.sort(np.append(events(20.0, seed), [BEGIN_S - 0.01, BEGIN_S + 0.01]))
    found = rows(tmp_path, {"laser": (t - 0.05 * meanwhile(t), came(t, seed))})
    (step,) = counted(found["laser"])
    assert step.parameters["seconds"] == pytest.approx(-0.05, rel=0.1)
    assert not undecided(found["laser"])


@pytest.mark.parametrize("seed", range(3))
def test_no_transport_brings_messages_sooner(tmp_path: Path, seed: int) -> None:
    t = events(20.0, seed)
    found = rows(tmp_path, {"laser": (t + 0.05 * meanwhile(t), came(t, seed))})
    (step,) = counted(found["laser"])
    assert step.parameters["seconds"] == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("left_s", [4.0, 8.0, 20.0])
@pytest.mark.parametrize("shared", [True, False])
def test_what_lasts_to_the_end_of_the_log(
    tmp_path: Path, shared: bool, left_s: float, seed: int
) -> None:
    """A load of one bus with an even stream on it, or the events' own clock; others are quiet."""
    sensors = {"imu": 50.0, "gnss": 10.0, "odometer": 25.0}
    streams = {}
    for k, (name, rate) in enumerate(sensors.items()):
        t = even(rate, LENGTH_S)
        load = 0.04 * np.clip((t - LENGTH_S + left_s) / 0.3, 0.0, 1.0)
        streams[name] = (t, came(t, seed + k, load if shared and name == "imu" else 0.0))
    t = events(20.0, seed)
    load = 0.04 * np.clip((t - LENGTH_S + left_s) / 0.3, 0.0, 1.0)
    own = 0.04 * (t > LENGTH_S - left_s)
    streams["laser"] = (t, came(t, seed, load)) if shared else (t - own, came(t, seed))
    found = rows(tmp_path, streams)
    assert names(found["laser"]) == ([] if shared else ["step"])
    assert all(names(found[name]) == [] for name in sensors)
