"""`figures.worst_case_1sigma_m`: above whatever is found with every timestamp in its own support.

Oracles: extreme shifts listed one by one for vehicles that go straight, and a chain of its own
(SciPy rotations, closed integral of the path) climbed by L-BFGS over every single variable.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from syncline_design.model.horizon import Horizon
from syncline_design.model.system import UTC, Look, Platform, Sensor, Stage, System
from syncline_design.model.timing import (
    NO_ERROR,
    Constant,
    Empirical,
    Normal,
    TimingError,
    Uniform,
    support,
)
from syncline_design.simulation.certified import certified_worst_case_m

LEVEL = Horizon(tilt_rad=0.0)
LATE = TimingError(Uniform(-0.05, 0.0))
HOST, OTHER = "host:a", "host:b"


def quiet(role: Any, timing: TimingError, timeline: str = UTC) -> Sensor:
    return Sensor(role, role, (0.0, 0.0, 0.0), timing, timeline, (0.0, 0.0, 0.0))


def straight(*roles: Sensor | None, vehicle: str = "a", v: float = 4.0) -> Stage:
    """Goes straight at v: a relative shift s of the position costs v |s|, nothing else does."""
    return Stage(vehicle, vehicle, Platform(v, 0.0, 30.0), *roles, (0.0, 0.0, 0.0))


def largest(*variables: tuple[float, float], signs: tuple[int, ...]) -> float:
    """Largest |sum of signed variables|, each at one of its ends."""
    return max(
        abs(math.fsum(s * x for s, x in zip(signs, ends, strict=True)))
        for ends in itertools.product(*variables)
    )


def sounding(vehicle: str, v: float, near: float, far: float) -> Stage:
    """Goes straight at v with true stamps and ranges by sound, whose way nobody corrects for."""
    roles = [quiet(role, NO_ERROR) for role in ("position", "attitude", "ranging")]
    roles[2] = replace(roles[2], sound_mps=1500.0, travels=True)
    first = roles[0] if vehicle == "a" else None
    platform = Platform(v, 0.0, far, nearest_m=None if near == far else near)
    arm = (0.0, 0.0, 0.0)
    return Stage(vehicle, vehicle, platform, first, *roles[1:], arm)


@pytest.mark.parametrize("arm", [(3.0, 4.0, 0.0), None], ids=["given", "any direction"])
def test_a_long_arm_that_both_stamps_turn_alike_costs_nothing(arm: Any) -> None:
    """Only the ranging stamp errs: antenna and attitude are turned by the same angle, which takes
    the arm out; what is left is the chord of the sight alone."""
    turn, d, late = 0.8, 5.0, 0.5
    roles = [quiet("position", NO_ERROR), quiet("attitude", NO_ERROR)]
    ranging = quiet("ranging", TimingError(Uniform(-late, late)))
    position = replace(roles[0], lever_arm_m=arm)
    stage = Stage("a", "a", Platform(0.0, turn, d, 40.0), position, roles[1], ranging)
    exact = 2.0 * d * math.sin(0.5 * turn * late)
    assert certified_worst_case_m(System((stage,), {}, horizon=LEVEL)) == pytest.approx(exact)


@pytest.mark.parametrize(
    ("fixing", "own"),
    [((75.0, 75.0), (30.0, 30.0)), ((30.0, 30.0), (75.0, 75.0)), ((60.0, 60.0), (60.0, 60.0)),
     ((20.0, 90.0), (30.0, 40.0)), ((40.0, 50.0), (10.0, 120.0))],
)  # fmt: skip
def test_a_fix_that_is_old_and_an_echo_that_is_late_do_not_add_up(
    fixing: tuple[float, float], own: tuple[float, float]
) -> None:
    """What the second vehicle moves is v |2 r2 - 2 r1| / c over a grid of both distances; the
    first moves v 2 r1 / c.  Straight ways with true stamps: the bound is reached."""
    stages = (sounding("a", 2.0, *fixing), sounding("b", 3.0, *own))
    grid = itertools.product(np.linspace(*fixing, 11), np.linspace(*own, 11))
    moved = max(abs(2.0 * (other - one)) / 1500.0 for one, other in grid)
    hand = 2.0 * 2.0 * fixing[1] / 1500.0 + 3.0 * moved
    assert certified_worst_case_m(System(stages, horizon=LEVEL)) == pytest.approx(hand, rel=1e-9)


@pytest.mark.parametrize(
    ("position", "ranging", "clock", "shift_s"),
    [
        ((LATE, HOST), (LATE, HOST), None, 0.05),
        ((LATE, UTC), (TimingError(Constant(-0.05)), UTC), None, 0.05),
        # mu of the host is -50 ms, the clock 50 ms behind: the stamp is right
        ((TimingError(Constant(-0.05)), HOST), (NO_ERROR, UTC), Constant(-0.05), 0.0),
        ((TimingError(Constant(-0.05)), HOST), (NO_ERROR, UTC), Constant(0.05), 0.1),
        ((NO_ERROR, UTC), (LATE, HOST), Uniform(0.01, 0.04), 0.09),
        ((LATE, HOST), (LATE, HOST), Uniform(0.01, 0.04), 0.05),  # one clock: cancels
        ((TimingError(Normal(-0.01, 0.002)), UTC), (NO_ERROR, UTC), None, 0.016),
        ((TimingError(Empirical((-0.02, 0.003, -0.007))), UTC), (NO_ERROR, UTC), None, 0.02),
        # centred +-25 ms plus 2 ms that remain
        ((TimingError(Uniform(-0.05, 0.0), 0.002), UTC), (NO_ERROR, UTC), None, 0.027),
        ((LATE, HOST), None, Uniform(0.01, 0.04), 0.09),  # no ranging: against true time
        ((LATE, HOST), None, Uniform(-0.01, 0.04), 0.09),
    ],
)
def test_straight_ahead_by_hand(position: Any, ranging: Any, clock: Any, shift_s: float) -> None:
    roles = (
        quiet("position", *position),
        quiet("attitude", NO_ERROR),
        None if ranging is None else quiet("ranging", *ranging),
    )
    offsets = () if clock is None else ((HOST, TimingError(clock)),)
    system = System((straight(*roles),), 3.0, offsets, horizon=LEVEL)
    assert certified_worst_case_m(system) == pytest.approx(4.0 * shift_s, rel=1e-9, abs=1e-12)


def test_drift_in_holdover_widens_both_ends() -> None:
    free = TimingError(Uniform(0.04, 0.06), None, 0.03)
    stage = straight(quiet("position", LATE, HOST), None, None)
    system = System((stage,), 3.0, ((HOST, free),), horizon=LEVEL)
    by_hand = largest((-0.05, 0.0), (0.04, 0.06), (-0.03, 0.03), signs=(1, -1, -1))
    assert by_hand == pytest.approx(0.14)
    assert certified_worst_case_m(system) == pytest.approx(4.0 * by_hand)
    assert support(free) == pytest.approx((0.01, 0.09))


def test_a_chain_by_hand() -> None:
    """The second position is the first ranging's stamp against the second's, clocks apart."""
    clocks = ((HOST, TimingError(Uniform(-0.01, 0.03))), (OTHER, TimingError(Constant(0.02))))
    first = straight(
        quiet("position", NO_ERROR, HOST), quiet("attitude", NO_ERROR), quiet("ranging", LATE, HOST)
    )
    second = straight(
        None, quiet("attitude", NO_ERROR), quiet("ranging", LATE, OTHER), vehicle="b", v=7.0
    )
    one = largest((0.0, 0.0), (-0.05, 0.0), signs=(1, -1))
    two = largest((-0.05, 0.0), (-0.01, 0.03), (-0.05, 0.0), (0.02, 0.02), signs=(1, -1, -1, 1))
    system = System((first, second), 3.0, clocks, horizon=LEVEL)
    assert certified_worst_case_m(system) == pytest.approx(4.0 * one + 7.0 * two)


def moved(w: np.ndarray, s: float, v: np.ndarray) -> np.ndarray:
    """Integral of exp(S(w) u) v, u = 0 .. s, by the closed form."""
    rate = float(np.linalg.norm(w))
    if rate * abs(s) < 1e-9:
        return s * v
    a, angle = w / rate, rate * s
    side = np.cross(a, v)
    along: np.ndarray = s * v + (1 - math.cos(angle)) / rate * side
    return along + (s - math.sin(angle) / rate) * np.cross(a, side)


def inside(x: np.ndarray) -> np.ndarray:
    return x / max(1.0, float(np.linalg.norm(x)))


def between(x: float, ends: tuple[float, float]) -> float:
    return ends[0] + (ends[1] - ends[0]) * 0.5 * (1.0 + math.sin(x))


def error_m(case: dict[str, Any], x: np.ndarray) -> float:
    """|e| of one stage: every vector in its ball, every stamp between its ends."""
    v, w = case["v"] * inside(x[0:3]), case["w"] * inside(x[3:6])
    look = x[6:9] / np.linalg.norm(x[6:9])
    if "look" in case:
        az, el = (between(x[6 + k], ends) for k, ends in enumerate(case["look"]))
        look = np.array([math.cos(az) * math.cos(el), math.sin(az) * math.cos(el), -math.sin(el)])
    lean = case["tilt"] * inside(x[9:11])
    true = Rotation.from_rotvec([lean[0], lean[1], 0.0]) * Rotation.from_rotvec([0, 0, x[11]])
    m = [between(x[12 + i], ends) for i, ends in enumerate(case["ends"])]
    sp, sa = m[0] - m[2], m[1] - m[2]
    antenna = moved(w, sp, v) + Rotation.from_rotvec(w * sp).apply(case["arm"])
    yaw, pitch, roll = (true * Rotation.from_rotvec(w * sa)).as_euler("ZYX")
    turn = case["sigma_a"] * inside(x[15:18])
    hat = Rotation.from_euler("ZYX", [yaw + turn[2], pitch + turn[1], roll + turn[0]])
    az, el = math.atan2(look[1], look[0]), -math.asin(look[2])
    off = case["sigma_u"] * inside(x[18:20])
    r = case["d"] + case["sigma_r"] * math.sin(x[20])
    az, el = az + off[0], el + off[1]
    seen = r * np.array([math.cos(az) * math.cos(el), math.sin(az) * math.cos(el), -math.sin(el)])
    noise = case["sigma_p"] * inside(x[21:24])
    error = true.apply(antenna) + noise + hat.apply(case["eye"] + seen - case["arm"])
    return float(np.linalg.norm(error - true.apply(case["eye"] + case["d"] * look)))


CASES = [
    {"v": 3.0, "w": 0.5, "d": 20.0, "ends": ((-0.08, 0.0), (-0.03, 0.0), (-0.01, 0.01)),
     "arm": (1.0, 0.5, -2.0), "eye": (0.3, 0.0, 0.8), "tilt": 0.17},
    {"v": 20.0, "w": 1.0, "d": 60.0, "ends": ((-0.001, 0.0), (0.0, 0.0), (-0.03, -0.005)),
     "arm": (0.0, 0.0, -1.0), "eye": (0.0, 0.0, 0.2), "tilt": 0.3},
    {"v": 1.0, "w": 0.8, "d": 4.0, "ends": ((-0.2, -0.1), (-0.01, 0.01), (0.0, 0.0)),
     "arm": (6.0, 1.0, 0.0), "eye": (-4.0, 0.0, 1.0), "tilt": 0.0},
]  # fmt: skip


TURN = (-math.pi, math.pi)
LOOKS = [  # straight down; abeam and down, arms against it and along; steep, on a leaning vehicle
    {"look": (TURN, (-1.57, -1.4)), "arm": (0.0, 0.0, -3.0), "eye": (0.0, 0.0, 1.0), "w": 0.1},
    {"look": ((1.2, 1.8), (-0.9, -0.6)), "arm": (0.0, 9.0, 6.0), "eye": (0.0, -3.0, -2.0)},
    {"look": ((1.2, 1.8), (-0.9, -0.6)), "arm": (0.0, -9.0, -6.0), "eye": (0.0, 3.0, 2.0)},
    {"look": (TURN, (-1.57, -1.2)), "arm": (2.0, 0.0, 0.0), "eye": (0.0, 0.0, 0.0), "tilt": 0.4},
]  # fmt: skip
STEADY = {"v": 1.0, "w": 0.3, "d": 20.0, "ends": ((-0.02, 0.0), (-0.01, 0.02), (0.0, 0.0)),
          "tilt": 0.1}  # fmt: skip
CASES += [STEADY | one for one in LOOKS]


@pytest.mark.parametrize("number", range(len(CASES)))
def test_no_climb_gets_above_it_and_some_come_near(number: int) -> None:
    case = CASES[number] | {"sigma_p": 0.03, "sigma_a": 0.01, "sigma_u": 0.004, "sigma_r": 0.02}
    third = 1.0 / math.sqrt(3.0)
    timings = [TimingError(Uniform(*ends)) for ends in case["ends"]]
    sensors = (
        Sensor("p", "position", (0.03 * third,) * 3, timings[0], HOST, case["arm"]),
        Sensor("a", "attitude", (0.01 * third,) * 3, timings[1], HOST),
        Sensor("r", "ranging", (0.02, 0.004, 0.0), timings[2], HOST, case["eye"]),
    )
    stage = Stage("s", "s", Platform(case["v"], case["w"], case["d"]), *sensors)
    free = certified_worst_case_m(System((stage,), horizon=Horizon(tilt_rad=case["tilt"])))
    bound = free
    if "look" in case:
        stage = replace(stage, look=Look(*case["look"]))
        bound = certified_worst_case_m(System((stage,), horizon=Horizon(tilt_rad=case["tilt"])))
        assert bound < free if number != 5 else bound == free  # there the arms lie along the look
    case = {k: np.array(x) if k in ("arm", "eye") else x for k, x in case.items()}
    generator, best = np.random.default_rng(number), 0.0
    for _ in range(4):
        starts = generator.normal(size=(25, 24)) * 1.5
        start = max(starts, key=lambda x: error_m(case, x))
        climbed = minimize(lambda x: -error_m(case, x), start, method="L-BFGS-B",
                           options={"maxiter": 20})  # fmt: skip
        best = max(best, -climbed.fun)
    assert (0.85 if "look" in case else 0.75) * bound <= best <= bound * (1.0 + 1e-9)
