"""The host clock: where it counts, with which sign, and from what its offset is made.

The oracle is a world with an explicit host clock: sensors sample a true trajectory, every sample
gets the stamp that its clock shows, and the system looks up by stamps what belongs together.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.choice.decide import choose
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem, selection_of
from syncline_design.choice.ranked import iter_best
from syncline_design.diagnosis.scene import scene
from syncline_design.logs.log import Log, StageLog
from syncline_design.model.budget import budget
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import Constant, Empirical, Normal, TimingError, Uniform
from syncline_design.simulation import SimulationSettings
from syncline_design.simulation.sampling import sample_errors
from syncline_design.spec.load import load
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file
from tests.plain_front import front_by_enumeration

HOST, OTHER = "host:v", "host:w"
EXACT = (0.0, 0.0, 0.0)


def one(role: str, timeline: str, age_s: float = 0.0) -> Sensor:
    """A perfect sensor whose data are `age_s` old when they are stamped: mu = -age."""
    return Sensor(role, role, EXACT, TimingError(Constant(-age_s)), timeline, EXACT)  # type: ignore[arg-type]


def stage(name: str, platform: Platform, *sensors: Sensor | None) -> Stage:
    position, attitude, ranging = sensors
    return Stage(name, name, platform, position, attitude, ranging, EXACT)


def errors(system: System, samples: int = 64) -> np.ndarray:
    return np.linalg.norm(sample_errors(system, SimulationSettings(samples=samples)), axis=1)


def paired_at(timelines: tuple[str, str], ages: tuple[float, float], clocks: dict) -> float:
    """True time between what is looked up and the moment that it is taken for [s].

    The world: both sensors sample every 10 ms; a sample of the instant t is stamped when it is
    `age` old, by a clock that then shows t + age + (host - UTC).  The system takes the reference's
    stamp at one instant and looks up, by stamp, which instant the other sensor's data show.
    """
    instants = np.arange(0.0, 40.0, 0.01)
    shows = [clocks.get(timeline, 0.0) for timeline in timelines]
    stamped = [instants + age + show for age, show in zip(ages, shows, strict=True)]
    at = 20.0
    wanted = np.interp(at, instants, stamped[1])
    return float(np.interp(wanted, stamped[0], instants)) - at


CLOCKS = [("utc", "utc"), (HOST, "utc"), ("utc", HOST), (HOST, HOST)]


@pytest.mark.parametrize("offset_s", [-0.05, 0.08])
@pytest.mark.parametrize("ages", [(0.05, 0.0), (0.0, 0.03), (0.4, 0.1)])
@pytest.mark.parametrize("timelines", CLOCKS)
def test_position_against_the_ranging_sensor(
    timelines: tuple[str, str], ages: tuple[float, float], offset_s: float
) -> None:
    """20 m/s without turning: the error is the speed times what the stamps are apart."""
    sensors = (
        one("position", timelines[0], ages[0]),
        one("attitude", timelines[1]),
        one("ranging", timelines[1], ages[1]),
    )
    clock = TimingError(Constant(offset_s))
    system = System((stage("v", Platform(20.0, 0.0, 50.0), *sensors),), 3.0, ((HOST, clock),))
    apart = paired_at(timelines, ages, {HOST: offset_s})
    np.testing.assert_allclose(errors(system), abs(20.0 * apart), atol=1e-9)


@pytest.mark.parametrize(("age_s", "offset_s"), [(0.05, -0.05), (0.05, 0.05), (0.0, 0.2)])
@pytest.mark.parametrize("timelines", CLOCKS)
def test_attitude_against_the_ranging_sensor(
    timelines: tuple[str, str], age_s: float, offset_s: float
) -> None:
    """Turning on the spot at 1 rad/s: 30 m swing by the chord of the angle in between.

    Over isotropic lines of sight the mean square of their distance from the axis is 2/3; 20 000
    draws give its root to about 0.3 %, the bound is five times that.
    """
    sensors = (
        one("position", "utc"),
        one("attitude", timelines[0], age_s),
        one("ranging", timelines[1]),
    )
    clock = TimingError(Constant(offset_s))
    system = System((stage("v", Platform(0.0, 1.0, 30.0), *sensors),), 3.0, ((HOST, clock),))
    angle = paired_at(timelines, (age_s, 0.0), {HOST: offset_s})
    rms = math.sqrt(float(np.mean(errors(system, 20_000) ** 2)))
    chord = 2.0 * 30.0 * abs(math.sin(0.5 * angle))
    assert rms == pytest.approx(chord * math.sqrt(2.0 / 3.0), rel=0.015, abs=1e-9)


@pytest.mark.parametrize(("own", "other"), [(0.03, -0.04), (-0.2, 0.1), (0.07, 0.07)])
def test_across_two_vehicles(own: float, other: float) -> None:
    """The object of the first vehicle moves on by the clocks' difference, with its sign."""
    ship = stage(
        "v",
        Platform(0.0, 0.0, 100.0),
        one("position", HOST),
        one("attitude", HOST),
        one("ranging", HOST, 0.05),
    )
    diver = stage(
        "w", Platform(3.0, 0.0, 10.0), None, one("attitude", OTHER), one("ranging", OTHER, 0.02)
    )
    clocks = ((HOST, TimingError(Constant(own))), (OTHER, TimingError(Constant(other))))
    apart = paired_at((HOST, OTHER), (0.05, 0.02), {HOST: own, OTHER: other})
    system = System((ship, diver), 3.0, clocks)
    np.testing.assert_allclose(errors(system), abs(3.0 * apart), atol=1e-9)


@pytest.mark.parametrize(("age_s", "offset_s"), [(0.05, -0.05), (0.05, 0.05), (0.0, 1.5)])
@pytest.mark.parametrize("timeline", ["utc", HOST])
def test_position_alone_against_true_time(timeline: str, age_s: float, offset_s: float) -> None:
    """Nothing cancels: an instant is looked up by its true time, the stamp is the host's."""
    clock = TimingError(Constant(offset_s))
    alone = stage("v", Platform(5.0, 0.0, 1.0), one("position", timeline, age_s), None, None)
    system = System((alone,), 3.0, ((HOST, clock),))
    apart = paired_at((timeline, "utc"), (age_s, 0.0), {HOST: offset_s})
    np.testing.assert_allclose(errors(system), abs(5.0 * apart), atol=1e-9)
    bound = age_s + (abs(offset_s) if timeline == HOST else 0.0)
    figures = budget(system)
    assert figures.tau_s == pytest.approx(bound)
    assert figures.sync_error_m == pytest.approx(5.0 * bound)
    assert figures.sync_error_per_sensor_m == pytest.approx(5.0 * bound)
    assert figures.sensors[0].tau_s == pytest.approx(bound)


def test_a_latency_meets_the_clock_with_its_sign() -> None:
    """Data 80 ms old by a known latency, clock 80 ms behind: the stamp says when it was."""
    platform = Platform(5.0, 0.0, 1.0)
    alone = stage("v", platform, one("position", HOST), None, None)
    known = EffectEntry("latency", "position", "v", (("latency_s", 0.08),))
    behind = System((alone,), 3.0, ((HOST, TimingError(Constant(-0.08))),), (known,))
    ahead = replace(behind, clock_offsets=((HOST, TimingError(Constant(0.08))),))
    np.testing.assert_allclose(errors(behind), 0.0, atol=1e-9)
    np.testing.assert_allclose(errors(ahead), 0.8, atol=1e-9)


def test_along_a_trajectory() -> None:
    """A straight manoeuvre: the same by the row-wise chain."""
    sensors = (one("position", HOST, 0.05), one("attitude", "utc"), one("ranging", "utc"))
    clock = ((HOST, TimingError(Constant(-0.05))),)
    system = System((stage("v", Platform(10.0, 0.0, 20.0), *sensors),), 3.0, clock)
    settings = SimulationSettings(samples=64, envelope="trajectory", trajectory="straight")
    found = np.linalg.norm(sample_errors(system, settings), axis=1)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)


OFFSETS: dict[str, tuple[TimingError, Callable[[np.random.Generator, int], np.ndarray]]] = {
    "uniform, one-sided": (
        TimingError(Uniform(0.0, 0.1)),
        lambda rng, n: rng.uniform(0.0, 0.1, n),
    ),
    "uniform and drift": (
        TimingError(Uniform(-0.05, 0.05), drifted_s=0.05),
        lambda rng, n: rng.uniform(-0.05, 0.05, n) + rng.uniform(-0.05, 0.05, n),
    ),
    "normal with a mean, and drift": (
        TimingError(Normal(0.06, 0.01), drifted_s=0.03),
        lambda rng, n: rng.normal(0.06, 0.01, n) + rng.uniform(-0.03, 0.03, n),
    ),
    "measured": (
        TimingError(Empirical((0.0, 0.01, 0.09))),
        lambda rng, n: rng.choice([0.0, 0.01, 0.09], n),
    ),
    "constant and drift": (
        TimingError(Constant(-0.02), drifted_s=0.03),
        lambda rng, n: -0.02 + rng.uniform(-0.03, 0.03, n),
    ),
}


@pytest.mark.parametrize("name", OFFSETS)
def test_distribution_of_the_offset(name: str) -> None:
    """Median and 95 % of |v (eps - offset)|, eps = -40 ms, against draws of the test's own.

    1 % of 95 % quantiles of 50 000 and 200 000 draws: three to five standard errors here.
    """
    error, draw = OFFSETS[name]
    alone = stage("v", Platform(10.0, 0.0, 1.0), one("position", HOST, 0.04), None, None)
    noisy = replace(alone, position=replace(one("position", HOST, 0.04), sigma=(0.01, 0.01, 0.01)))
    system = System((noisy,), 3.0, ((HOST, error),))
    rng = np.random.default_rng(11)
    apart = np.zeros((3, 200_000))
    apart[0] = 10.0 * (-0.04 - draw(rng, 200_000))
    expected = np.linalg.norm(apart + rng.normal(0.0, 0.01, apart.shape), axis=0)
    for quantile in (0.5, 0.95):
        want = float(np.quantile(expected, quantile))
        got = float(np.quantile(errors(system, 50_000), quantile))
        assert got == pytest.approx(want, rel=0.02, abs=2e-3), quantile


# ------------------------------------------------------------------ specs

TRACK = """\
syncline: 1
name: A track
catalogs: [parts.yaml]
requirements:
  - {{id: ACC-1, kind: accuracy, limit: {limit}}}
  - {{id: SYNC-1, kind: sync, limit: {sync}}}
sync_model: {model}
coverage_factor: 2
stages:
  - name: usv
    platform: {{name: u, v_max: {speed} m/s, omega_max: 20 deg/s, distance: 10 m, baseline: 1 m}}
    {clock}
    position:
      {sensors}
timestamping: {{candidates: [{methods}]}}
"""


def track(folder: Path, parts: str = "sensors: {}\n", **given: Any) -> Path:
    keys = {"limit": "3 cm", "sync": "1000", "model": "syncline", "speed": 5, "clock": ""}
    keys |= {"sensors": "sensor: ublox_f9p_rtk", "methods": "hardware"} | given
    if keys["methods"] == "hardware":
        keys["sensors"] += "\n      primitive: tov"
    (folder / "parts.yaml").write_text(parts)
    path = folder / "spec.yaml"
    path.write_text(TRACK.format(**keys))
    return path


@pytest.mark.parametrize("model", ["syncline", "per_sensor"])
def test_a_free_running_clock_fails_a_track(model: str, tmp_path: Path) -> None:
    """5 m/s and 5 ms + 20 ppm over 4 h: 1.465 m beside sqrt(3) cm, a ratio of 84.6.

    The Monte Carlo holds v |a + b|, a within 5 ms and b within 288 ms: 95 % of v times 0.2736 s,
    as |b| is uniform up to 288 ms and a adds nothing to first order.
    """
    path = track(tmp_path, clock="clock: free_running", model=model)
    found = check_file(path, CheckSettings()).to_json()
    assert found["verdict"] == "fails"
    assert found["syncline"]["tau_s"] == pytest.approx(0.29300001, rel=1e-12)
    total = 5 * (0.293 + 1e-8) + 0.01 * math.sqrt(3)
    assert found["syncline"]["total_m"] == pytest.approx(total, rel=1e-12)
    assert found["design"]["stages"][0]["roles"]["position"]["tau_s"] > 0.293
    rows = {row["id"]: row["value"] for row in found["requirements"]}
    assert rows["ACC-1"] == pytest.approx(total, rel=1e-12)
    assert rows["SYNC-1"] == pytest.approx(5 * 0.29300001 / (0.01 * math.sqrt(3)), rel=1e-12)
    quantile = found["monte_carlo"]["quantiles"]["0.95"]["value_m"]
    assert quantile == pytest.approx(5 * 0.95 * 0.288, rel=0.01)


def test_utc_stamps_do_not_care_for_the_clock(tmp_path: Path) -> None:
    path = track(tmp_path, clock="clock: free_running", methods="pps_gnss")
    found = check_file(path, CheckSettings(monte_carlo=False)).to_json()
    assert found["verdict"] == "meets"
    assert found["syncline"]["tau_s"] == 0.53e-6


Draw = dict[str, Any]


def random_parts(rng: random.Random) -> tuple[str, list[Draw], list[Draw], list[Draw]]:
    """A catalog of sensors, methods and clocks with round figures."""
    sensors = [{"id": f"s{i}", "mm": rng.randint(1, 40)} for i in range(3)]
    methods = [
        {"id": f"m{i}", "us": rng.randint(0, 3000), "line": rng.choice(["host", "host", "utc"])}
        for i in range(3)
    ]
    clocks = [
        {
            "id": f"c{i}",
            "low": rng.randint(-3000, 0),
            "high": rng.randint(0, 3000),
            "ppm": rng.choice([0, 1, 20]),
            "min": rng.choice([1, 30]),
        }
        for i in range(3)
    ]
    for thing in itertools.chain(sensors, methods, clocks):
        thing["eur"] = rng.randint(1, 9) * 10
    lines = ["sensors:"]
    lines += [
        f"  {s['id']}: {{modality: position, sigma_position: {s['mm']} mm, primitives: [pps], "
        f"cost: {s['eur']} EUR}}"
        for s in sensors
    ]
    lines += ["timestamping:"]
    lines += [
        f"  {m['id']}: {{primitives: [pps], timeline: {m['line']}, cost: {m['eur']} EUR, "
        f"error: {{distribution: uniform, low: -{m['us']} us, high: 0 us}}}}"
        for m in methods
    ]
    lines += ["clocks:"]
    lines += [
        f"  {c['id']}: {{offset: {{distribution: uniform, low: {c['low']} us, "
        f"high: {c['high']} us}}, drift: {c['ppm']} ppm, holdover: {c['min']} min, "
        f"cost: {c['eur']} EUR}}"
        for c in clocks
    ]
    return "\n".join(lines) + "\n", sensors, methods, clocks


def total_by_hand(s: Draw, m: Draw, c: Draw, speed: int) -> tuple[Decimal, Decimal]:
    """(error [m], tau / tau_crit) of one design."""
    tau = Decimal(m["us"]) / 10**6
    if m["line"] == "host":
        tau += Decimal(max(-c["low"], c["high"])) / 10**6
        tau += Decimal(c["ppm"]) / 10**6 * c["min"] * 60
    noise = Decimal(3).sqrt() * Decimal(s["mm"]) / 1000
    return noise + speed * tau, speed * tau / noise


@pytest.mark.parametrize("seed", range(12))
def test_every_road_charges_the_clock(seed: int, tmp_path: Path) -> None:
    """Random tracks: the choice, the front, the ranking and the recheck against a plain loop."""
    rng = random.Random(seed)
    parts, sensors, methods, clocks = random_parts(rng)
    speed, sync = rng.choice([1, 2, 5]), rng.choice([2, 1000])
    with localcontext(prec=50):
        table = {
            (s["id"], m["id"], c["id"]): (
                s["eur"] + m["eur"] + c["eur"],
                *total_by_hand(s, m, c, speed),
            )
            for s, m, c in itertools.product(sensors, methods, clocks)
        }
    allowed = {names: row for names, row in table.items() if row[2] < sync}
    limit = sorted(row[1] for row in table.values())[rng.randint(4, 20)]
    text = f"{float(limit) * 1000:.3f} mm"
    good = [row for row in allowed.values() if float(row[1]) <= float(text[:-3]) / 1000]
    ids = ", ".join(c["id"] for c in clocks)
    path = track(
        tmp_path, parts, limit=text, sync=sync, speed=speed,
        model=rng.choice(["syncline", "per_sensor"]),
        clock=f"clock: {{candidates: [{ids}]}}",
        sensors="candidates: [s0, s1, s2]", methods="m0, m1, m2",
    )  # fmt: skip
    loaded = load(path)
    problem = build_problem(loaded)
    for method in ("front", "enumerate", *(("milp",) if seed < 3 else ())):
        found = choose(problem, method)  # type: ignore[arg-type]
        assert isinstance(found, Choice) == bool(good), method
        if isinstance(found, Choice):
            names = selection_of(problem, found.design)
            key = (names.roles[0].sensor, names.roles[0].method, names.clocks[0].id)
            assert table[key][0] == min(row[0] for row in good), method
    cheapest: list[tuple[float, float]] = []
    for eur, metres, _ in sorted(allowed.values()):
        if not cheapest or float(metres) < cheapest[-1][1] * (1 - 1e-12):
            if cheapest and cheapest[-1][0] == eur:
                continue
            cheapest.append((eur, float(metres)))
    points = [(float(p.amount), p.error_m) for p in front(problem)]
    assert np.array(points) == pytest.approx(np.array(cheapest))
    assert points == [(float(p.amount), p.error_m) for p in front_by_enumeration(problem)]
    assert len(list(iter_best(problem))) == len(good)
    for design in itertools.islice(iter_best(problem), 4):
        names = selection_of(problem, design)
        again = recheck(loaded, names)
        key = (names.roles[0].sensor, names.roles[0].method, names.clocks[0].id)
        assert float(again.total_m) == pytest.approx(float(table[key][1]), rel=1e-15)
        assert float(again.sync_ratio) == pytest.approx(float(table[key][2]), rel=1e-15)


# ------------------------------------------------------------------ diagnosis


def circle(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity (NED) and yaw on a circle of 40 m at 0.2 rad/s."""
    a = 0.2 * t
    zero = np.zeros_like(t)
    position = 40.0 * np.stack([np.sin(a), 1.0 - np.cos(a), zero], axis=-1)
    velocity = 8.0 * np.stack([np.cos(a), np.sin(a), zero], axis=-1)
    return position, velocity, a


@pytest.mark.parametrize("offset_s", [0.06, -0.25])
def test_diagnosis_knows_the_mean_of_the_clock(offset_s: float) -> None:
    """A position log stamped by a host clock that is `offset` ahead, data 50 ms old.

    The reading that carries the stamp t was taken at t - 50 ms - offset; a spec that says so
    leaves nothing but splines, one that has the sign wrong leaves twice the offset times 8 m/s.
    """
    t = np.arange(0.0, 60.0, 0.05)
    truth, velocity, yaw = circle(t)
    reading, _, _ = circle(t - 0.05 - offset_s)
    zero = np.zeros_like(t)
    logged = StageLog(
        "v", reading, np.stack([zero, zero, yaw], -1), velocity,
        np.stack([zero, zero, zero + 0.2], -1),
    )  # fmt: skip
    log = Log("position", t, (logged,), truth, None, len(t), {})
    alone = stage("v", Platform(10.0, 1.0, 1.0), one("position", HOST, 0.05), None, None)
    ranged = replace(alone, attitude=one("attitude", "utc", 0.3), ranging=one("ranging", HOST, 0.7))
    for made in (alone, ranged):  # what did not make the log does not enter
        system = System((made,), 3.0, ((HOST, TimingError(Constant(offset_s))),))
        left = np.linalg.norm(scene(system, log).error(), axis=1)
        assert float(left[40:-40].max()) < 0.01
