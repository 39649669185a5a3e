"""The Syncline against the paper's printed figures, mpmath, and a slow obvious implementation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from operator import attrgetter
from statistics import NormalDist
from typing import Any

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncline_design.model import normal
from syncline_design.model.budget import Budget, budget, lever_arm_m
from syncline_design.model.known import Known
from syncline_design.model.pairing import largest
from syncline_design.model.quantity import Dimension, parse_quantity
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import Constant, Normal, TimingError, Uniform
from tests.paper_systems import DEG, platform_of, sensor_of, survey

# A slow obvious implementation at 50 digits, written from the paper alone.

NOISE = st.floats(1e-4, 2.0)
ANGLE = st.floats(1e-6, 0.05)
SPEED = st.floats(0.01, 50.0)
RATE = st.floats(0.001, 6.0)
RANGE = st.floats(0.5, 2000.0)
TAU = st.floats(0.0, 0.2)
OFFSET = st.floats(0.0, 0.05)


@st.composite
def chains(draw: st.DrawFn, stages: int | None = None) -> System:
    count = draw(st.integers(1, 4)) if stages is None else stages

    def one(role: RoleName, first: float | None = None) -> Sensor:
        kind = NOISE if role == "position" else ANGLE
        sigma = (draw(kind) if role != "ranging" else draw(NOISE), draw(kind), draw(kind))
        timeline = draw(st.sampled_from(["utc", "host:a", "host:b"]))
        return Sensor(f"{role}-sensor", role, sigma, TimingError(Constant(-draw(TAU))), timeline)

    made = [
        Stage(
            f"stage{i}",
            f"vehicle{i}",
            Platform(draw(SPEED), draw(RATE), draw(RANGE), draw(st.floats(0.0, 20.0))),
            one("position") if i == 0 else None,
            one("attitude"),
            one("ranging"),
        )
        for i in range(count)
    ]
    offsets = tuple((f"host:{name}", TimingError(Constant(draw(OFFSET)))) for name in "ab")
    return System(tuple(made), clock_offsets=offsets)


def obvious(system: System) -> dict[str, mpmath.mpf]:
    """Roof, rate, tau, both sync errors and totals, term by term at 50 digits."""
    exact = mpmath.mpf

    def norm(values: Sequence[float]) -> mpmath.mpf:
        return mpmath.sqrt(sum(exact(value) ** 2 for value in values))

    clock = {name: abs(exact(e.distribution.value_s)) for name, e in system.clock_offsets}  # type: ignore[union-attr]
    clock["utc"] = exact(0)

    def apart(a: Sensor, b: Sensor) -> mpmath.mpf:
        tau = sum(abs(exact(s.timing.distribution.value_s)) for s in (a, b))  # type: ignore[union-attr]
        return tau + (0 if a.timeline == b.timeline else clock[a.timeline] + clock[b.timeline])

    sensor, rate, per_sensor, taus = exact(0), exact(0), exact(0), []
    lever_rate, lever_per_sensor = exact(0), exact(0)
    before: Sensor | None = system.stages[0].position
    sensor += norm(before.sigma)  # type: ignore[union-attr]
    for stage in system.stages:
        v, w, d, b = (
            exact(getattr(stage.platform, key))
            for key in ("v_max_mps", "omega_max_radps", "distance_m", "baseline_m")
        )
        attitude, ranging = stage.attitude, stage.ranging
        assert attitude is not None
        assert ranging is not None
        assert before is not None
        sensor += norm(attitude.sigma) * d + ranging.sigma[0] + norm(ranging.sigma[1:]) * d
        rate += v + d * w
        taus += [apart(before, ranging), apart(attitude, ranging)]
        per_sensor += v * taus[-2] + d * w * taus[-1]
        lever_rate += v + b * w + d * w
        lever_per_sensor += (v + b * w) * taus[-2] + d * w * taus[-1]
        before = ranging
    return {
        "sensor_error_m": sensor,
        "sync_rate_mps": rate,
        "tau_s": max(taus),
        "tau_crit_s": sensor / rate,
        "sync_error_m": rate * max(taus),
        "sync_error_per_sensor_m": per_sensor,
        "total_m": sensor + rate * max(taus),
        "total_per_sensor_m": sensor + per_sensor,
        "lever_arm.sync_rate_mps": lever_rate,
        "lever_arm.tau_crit_s": sensor / lever_rate,
        "lever_arm.total_m": sensor + lever_rate * max(taus),
        "lever_arm.total_per_sensor_m": sensor + lever_per_sensor,
    }


def agree_with_obvious(system: System) -> None:
    with mpmath.workdps(50):
        result = budget(system)
        for key, value in obvious(system).items():
            found = attrgetter(key)(result)
            assert found == pytest.approx(float(value), rel=1e-13, abs=1e-300), key


@given(chains())
def test_budget_agrees_with_the_obvious_implementation(system: System) -> None:
    agree_with_obvious(system)


@given(chains(stages=3))
def test_three_stage_chain_agrees_with_the_obvious_implementation(system: System) -> None:
    agree_with_obvious(system)


# Properties


@given(chains())
def test_ledgers_add_up_and_per_sensor_is_never_larger(system: System) -> None:
    result = budget(system, Known({}, (("bias", "stage0", 0.25),)))
    for model in ("syncline", "per_sensor"):
        terms = result.ledger_of(model)  # type: ignore[arg-type]
        total = result.total(model)  # type: ignore[arg-type]
        assert math.fsum(term.value_m for term in terms) == pytest.approx(total, rel=1e-13)
        assert math.fsum(term.share for term in terms) == pytest.approx(1.0, rel=1e-13)
        sync = math.fsum(term.value_m for term in terms if term.kind == "sync")
        assert sync == pytest.approx(result.sync_error(model), rel=1e-13, abs=1e-300)  # type: ignore[arg-type]
    assert result.total_per_sensor_m <= result.total_m * (1 + 1e-14)
    assert result.systematic_m == 0.25
    assert math.fsum(row.sensor_error_m for row in result.stages) == (
        pytest.approx(result.sensor_error_m, rel=1e-13)
    )


@given(chains(), st.floats(0.01, 100.0))
def test_another_unit_of_length_scales_lengths_and_leaves_times(
    system: System, factor: float
) -> None:
    def scaled(sensor: Sensor | None) -> Sensor | None:
        if sensor is None or sensor.role == "attitude":
            return sensor
        a, b, c = sensor.sigma
        if sensor.role == "position":
            return dataclasses.replace(sensor, sigma=(a * factor, b * factor, c * factor))
        return dataclasses.replace(sensor, sigma=(a * factor, b, c))

    stages = tuple(
        dataclasses.replace(
            stage,
            platform=Platform(
                stage.platform.v_max_mps * factor,
                stage.platform.omega_max_radps,
                stage.platform.distance_m * factor,
                stage.platform.baseline_m * factor,
            ),
            position=scaled(stage.position),
            ranging=scaled(stage.ranging),
        )
        for stage in system.stages
    )
    before, after = budget(system), budget(dataclasses.replace(system, stages=stages))
    assert after.total_m == pytest.approx(before.total_m * factor, rel=1e-12)
    assert after.total_per_sensor_m == pytest.approx(before.total_per_sensor_m * factor, rel=1e-12)
    assert after.tau_crit_s == pytest.approx(before.tau_crit_s, rel=1e-12)
    assert after.lever_arm.tau_crit_s == pytest.approx(before.lever_arm.tau_crit_s, rel=1e-12)
    assert after.sync_ratio == pytest.approx(before.sync_ratio, rel=1e-12)


@given(chains(), st.sampled_from(["v_max_mps", "omega_max_radps", "distance_m"]))
def test_faster_or_farther_is_never_better(system: System, key: str) -> None:
    first, *rest = system.stages
    platform = dataclasses.replace(first.platform, **{key: getattr(first.platform, key) * 1.5})
    worse = dataclasses.replace(
        system, stages=(dataclasses.replace(first, platform=platform), *rest)
    )
    assert budget(worse).total_m >= budget(system).total_m
    assert budget(worse).total_per_sensor_m >= budget(system).total_per_sensor_m


@given(chains(), st.sampled_from(["position", "attitude", "ranging"]), st.floats(0.0, 0.1))
def test_more_timestamp_error_is_never_better(system: System, role: RoleName, more: float) -> None:
    before = budget(system)
    after = budget(system, Known({("stage0", role): more}))
    assert after.tau_s >= before.tau_s
    assert after.total_m >= before.total_m
    assert after.sync_ratio >= before.sync_ratio
    assert after.lever_arm.total_per_sensor_m >= before.lever_arm.total_per_sensor_m
    row = next(row for row in after.sensors if row.stage == "stage0" and row.role == role)
    old = next(row for row in before.sensors if row.stage == "stage0" and row.role == role)
    assert row.tau_s == pytest.approx(old.tau_s + more, rel=1e-12)


# Timelines and shapes of systems, by hand


def single(position: Sensor, attitude: Sensor | None, ranging: Sensor | None) -> Stage:
    return Stage("uav", "uav", platform_of("fixed_wing"), position, attitude, ranging)


def test_sensors_on_one_timeline_share_its_offset_and_others_add_both() -> None:
    """Host 1 ms off UTC: the pair on the host does not see it, the pair across does."""
    tau = TimingError(Uniform(-2e-6, 2e-6))
    stage = single(
        sensor_of("f9p_rtk", tau, timeline="utc"),
        sensor_of("mru5", tau, timeline="host:uav"),
        sensor_of("vux1", tau, timeline="host:uav"),
    )
    clocks = (("host:uav", TimingError(Normal(0.4e-3, 0.2e-3))),)
    result = budget(System((stage,), clock_offsets=clocks))
    assert [pair.offset_s for pair in result.pairs] == pytest.approx([1e-3, 0.0], rel=1e-12)
    assert [pair.tau_s for pair in result.pairs] == pytest.approx([1.004e-3, 4e-6], rel=1e-12)
    assert result.tau_s == pytest.approx(1.004e-3, rel=1e-12)
    assert result.sync_error_per_sensor_m == pytest.approx(
        21 * 1.004e-3 + 100 * 77.9 * DEG * 4e-6, rel=1e-12
    )
    assert budget(System((stage,))).tau_s == pytest.approx(4e-6, rel=1e-12)


def test_two_vehicles_under_water_add_both_clocks() -> None:
    system = survey("small_sv")
    host = [
        dataclasses.replace(
            stage,
            ranging=dataclasses.replace(stage.ranging, timeline=f"host:{stage.vehicle}"),  # type: ignore[type-var]
        )
        for stage in system.stages
    ]
    clocks = (
        ("host:vessel", TimingError(Uniform(-1e-6, 1e-6))),
        ("host:auv", TimingError(Uniform(-21.6e-3, 21.6e-3))),
    )
    result = budget(System(tuple(host), clock_offsets=clocks))
    crossing = next(p for p in result.pairs if p.stage == "auv" and p.role == "position")
    assert crossing.sensor == "usbl7000"
    assert crossing.reference == "sonic2026"
    assert crossing.tau_s == pytest.approx(1e-3 + 0.0 + 1e-6 + 21.6e-3, rel=1e-12)


def test_stage_without_ranging_locates_itself_only() -> None:
    """d = 0, rate v_max, sensor error sigma_p; attitude is shown but does not enter."""
    stage = single(
        sensor_of("f9p_rtk", TimingError(Uniform(-1e-3, 0.0)), timeline="host:uav"),
        sensor_of("mru5", TimingError(Constant(5.0))),
        None,
    )
    clocks = (("host:uav", TimingError(Constant(1.0))),)
    result = budget(System((stage,), clock_offsets=clocks))
    assert result.tau_s == 1.001  # true time is on UTC: the clock does not cancel
    assert result.sync_rate_mps == 21.0
    assert result.stages[0].distance_m == 0.0
    assert result.sensor_error_m == pytest.approx(0.01 * math.sqrt(3))
    assert result.total_m == pytest.approx(0.01 * math.sqrt(3) + 21.0 * 1.001)
    assert result.total_m == result.total_per_sensor_m
    assert [term.term for term in result.ledger] == ["sigma_p", "v_max*tau"]
    assert [row.ratio for row in result.sensors] == pytest.approx([1.001 / 824.8e-6, 0.0], rel=1e-3)


def test_nothing_moves() -> None:
    still = Stage(
        "tripod", "tripod", Platform(0.0, 0.0, 10.0, 1.0),
        sensor_of("f9p_rtk", TimingError(Constant(1.0))),
        sensor_of("mru5", TimingError(Constant(1.0))),
        sensor_of("vux1", TimingError(Constant(1.0))),
    )  # fmt: skip
    result = budget(System((still,)))
    assert result.tau_crit_s == math.inf
    assert result.sync_ratio == 0.0
    assert result.total_m == result.sensor_error_m
    assert not result.lever_arm.differs


def test_turning_alone_moves_an_antenna_on_a_lever_arm() -> None:
    turning = Stage(
        "tripod", "tripod", Platform(0.0, 1.0, 10.0, 2.0),
        sensor_of("f9p_rtk", TimingError(Constant(1e-3))),
        sensor_of("mru5", TimingError(Constant(0.0))),
        sensor_of("vux1", TimingError(Constant(0.0))),
    )  # fmt: skip
    position = budget(System((turning,))).sensors[0]
    assert position.tau_crit_s == math.inf
    assert position.tau_crit_lever_arm_s == pytest.approx(0.01 * math.sqrt(3) / 2.0)
    assert lever_arm_m(turning, first=True) == 2.0


def test_one_sensor_past_its_own_tau_crit_decides_the_sync_ratio() -> None:
    """1 ms against the RTK receiver's 0.825 ms; the system's tau_crit is 5.6 ms."""
    stage = single(
        sensor_of("f9p_rtk", TimingError(Constant(1e-3))),
        sensor_of("ellipse", TimingError(Constant(0.0))),
        sensor_of("alpha_prime", TimingError(Constant(0.0))),
    )
    result = budget(System((stage,)))
    assert result.tau_crit_s == pytest.approx(5.5753e-3, abs=5e-7)
    assert result.tau_s < result.tau_crit_s
    assert result.sync_ratio == pytest.approx(1e-3 / 824.786e-6, rel=1e-6)


def test_without_any_noise_no_timestamp_error_is_free() -> None:
    exact = TimingError(Constant(0.0))
    perfect = Sensor("perfect", "position", (0.0, 0.0, 0.0), exact)
    stage = single(perfect, sensor_of("mru5", exact), sensor_of("vux1", exact))
    result = budget(System((stage,)))
    assert result.sensors[0].tau_crit_s == 0.0
    assert result.sensors[0].ratio == math.inf
    assert not result.sync_ratio < 1.0


@pytest.mark.parametrize("order", [(math.nan, 1.0), (1.0, math.nan)])
def test_nan_is_the_largest_whatever_the_order(order: tuple[float, float]) -> None:
    assert math.isnan(largest(order))


def test_nan_timing_reaches_every_verdict_figure() -> None:
    stage = single(
        sensor_of("f9p_rtk", TimingError(Constant(1e-3))),
        sensor_of("mru5", TimingError(Constant(math.nan))),
        sensor_of("vux1", TimingError(Constant(0.0))),
    )
    result = budget(System((stage,)))
    for figure in (result.tau_s, result.total_m, result.total_per_sensor_m, result.sync_ratio):
        assert math.isnan(figure)
    assert not result.sync_ratio < 1.0


def numbers(value: Any) -> list[float]:
    """All numbers of a nested dataclass."""
    if dataclasses.is_dataclass(value):
        return [n for f in dataclasses.fields(value) for n in numbers(getattr(value, f.name))]
    if isinstance(value, tuple):
        return [n for item in value for n in numbers(item)]
    return [value] if isinstance(value, float) else []


def test_results_are_plain_floats_whatever_comes_in() -> None:
    length, angle = Dimension.LENGTH, Dimension.ANGLE
    sigma = tuple(parse_quantity(f"{n} cm", length) for n in (1, 1, 2))
    bearing = (parse_quantity("1 cm", length), *(parse_quantity("0.006 deg", angle),) * 2)
    tilt = (parse_quantity("0.002 deg", angle),) * 3
    exact = TimingError(Uniform(parse_quantity("-1 ms", Dimension.TIME), 0.0))
    stage = Stage(
        "uav",
        "uav",
        Platform(
            parse_quantity("21 m/s", Dimension.SPEED),
            parse_quantity("77.9 deg/s", Dimension.ANGULAR_RATE),
            parse_quantity("100 m", length),
            parse_quantity("1 m", length),
        ),
        Sensor("p", "position", sigma, exact),  # type: ignore[arg-type]
        Sensor("a", "attitude", tilt, exact),
        Sensor("r", "ranging", bearing, exact),
    )
    alone = dataclasses.replace(stage, ranging=None)
    for result in (budget(System((stage,))), budget(System((alone,)))):
        assert isinstance(result, Budget)
        assert {type(number) for number in numbers(result)} == {float}


@pytest.mark.parametrize("fault", ["empty", "twins", "gap", "second", "no position", "no attitude"])
def test_a_chain_that_makes_no_sense_is_refused(fault: str) -> None:
    first, second = survey("small_sv").stages
    stages = {
        "empty": (),
        "twins": (first, dataclasses.replace(second, name="vessel")),
        "gap": (dataclasses.replace(first, ranging=None), second),
        "second": (first, dataclasses.replace(second, position=first.position)),
        "no position": (dataclasses.replace(first, position=None), second),
        "no attitude": (first, dataclasses.replace(second, attitude=None)),
    }[fault]
    with pytest.raises(ValueError, match=r"stage|chain"):
        budget(System(stages))


def test_effects_on_unknown_stages_or_of_the_wrong_sign_are_refused() -> None:
    system = survey("small_sv")
    with pytest.raises(ValueError, match="do not exist"):
        budget(system, Known({("vesel", "position"): 1e-3}))
    with pytest.raises(ValueError, match="do not exist"):
        budget(system, Known({}, (("bias", "ship", 1e-3),)))
    with pytest.raises(ValueError, match="negative"):
        budget(system, Known({("vessel", "position"): -1e-3}))
    with pytest.raises(ValueError, match="negative"):
        budget(system, Known({}, (("bias", "auv", -1e-3),)))


def test_constants_of_the_normal_distribution_are_its_quantiles() -> None:
    """Against the standard library's inverse; those with few digits to all that they have."""
    quantile = NormalDist().inv_cdf
    assert pytest.approx(quantile(0.975), rel=1e-15) == normal.NORMAL_95
    assert pytest.approx(quantile(0.9995), rel=1e-14) == normal.NORMAL_999
    assert round(quantile(0.95), 4) == normal.NEARLY_ALL
    assert round(quantile(0.75), 4) == normal.HALF_WITHIN
    assert round(1.0 / quantile(0.75), 4) == normal.OF_MEDIAN_DEVIATION
