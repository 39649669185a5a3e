"""Exact slopes of the statistical figures: against complex steps through plain formulas of their
own, against differences, and the closed form of the error against the row-wise chain."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from scipy.linalg import expm

from syncline_design.model.horizon import Horizon
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Look, System
from syncline_design.model.timing import Normal, TimingError
from syncline_design.simulation.ascent import Ascent, FreeVector, Index
from syncline_design.simulation.lattice import POINTS
from syncline_design.simulation.propagation import Law, propagation
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import AXES, Wanted, _ascent
from tests.test_statistical_figures import ALL, boat, chain, lidar

Z95 = NormalDist().inv_cdf(0.95)


def changed(system: System, place: int, platform: dict[str, object], **stage: object) -> System:
    """One stage with other figures."""
    old = system.stages[place]
    new = replace(old, platform=replace(old.platform, **platform), **stage)  # type: ignore[arg-type]
    return replace(system, stages=(*system.stages[:place], new, *system.stages[place + 1 :]))


def several() -> list[System]:
    """Chains; distances from near to far; looks; noise that follows range and beam."""
    low = Look(azimuth=(-1.0, 2.0), elevation=(-1.2, 0.3))
    shaped = chain(5).stages[1].ranging
    assert shaped is not None
    shaped = replace(
        shaped,
        range_shape=((1.0, 0.5), (30.0, 1.5), (80.0, 4.0)),
        range_by_beam=((0.0, 1.0), (1.0, 1.4), (3.0, 3.0)),
        bearing_by_beam=((0.2, 1.0), (1.5, 2.0)),
    )
    return [
        chain(0),
        changed(chain(2), 1, {"nearest_m": 5.0}),
        changed(chain(3), 1, {"nearest_m": 2.0}, look=low),
        changed(chain(4), 0, {}, look=Look(azimuth=None, elevation=(-0.9, 1.0))),
        changed(chain(5), 1, {"nearest_m": 4.0}, ranging=shaped),
        changed(chain(6), 1, {}, transponder_lever_arm_m=None),
        boat((0.02, 0.03, 0.05), TimingError(Normal(0.01, 0.02))),
    ]


def inside(situations: Situations, seed: int, count: int) -> np.ndarray:
    """Points at random, off the rims of what may be shorter than 1."""
    point = situations.starting_points(seed, count)
    for block in situations.blocks:
        if block.kind == "ball":
            point[block.rows] *= 0.7
    return point


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("one_mission", [False, True])
def test_the_closed_form_is_the_chain(place: int, one_mission: bool) -> None:
    """Error and slopes of its noise at random points and nodes, to rounding."""
    situations = Situations(several()[place], one_mission)
    point, nodes = inside(situations, place, 20), situations.nodes(31)
    rows: list[np.ndarray] = []
    mean = situations._run(point, nodes, (rows, np.arange(20 * 31)))
    found = situations.moments(point, nodes)
    np.testing.assert_allclose(found.mean_m, mean, rtol=0.0, atol=1e-12 * np.max(np.abs(mean)))
    slopes = np.concatenate(rows, axis=2).reshape(20, 31, 3, -1)
    largest = np.max(np.abs(slopes))
    np.testing.assert_allclose(found.slopes_m, slopes, rtol=0.0, atol=1e-13 * largest)
    errors = situations.errors_m(point, nodes)
    np.testing.assert_allclose(errors, mean, rtol=0.0, atol=1e-12 * np.max(np.abs(mean)))


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("one_mission", [False, True])
def test_slopes_are_those_of_central_differences(place: int, one_mission: bool) -> None:
    """Six figures and one held against a limit that follows the distance, both laws."""
    situations = Situations(several()[place], one_mission)
    wanted = (*ALL, Wanted("3d", 0.99, rule=(0.2, 0.05)))
    point, of = inside(situations, 3, 7), np.arange(7)
    for law in (propagation(situations), Law(situations, "averaged", situations.nodes(31))):
        ascent = _ascent(law, wanted)
        assert ascent.slopes is not None
        found, step = ascent.slopes(point, of), 1e-6
        for row in range(situations.size):
            shift = step * np.eye(situations.size)[:, [row]]
            more, less = (ascent.objective(point + s * shift, of) for s in (1.0, -1.0))
            scale = 1e-12 + np.max(np.abs(found), axis=0)
            assert np.all(np.abs((more - less) / (2.0 * step) - found[row]) < 2e-7 * scale)


def skew(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def plain_figure(situations: Situations, point: np.ndarray, wanted: Wanted) -> complex:
    """A figure by the law of propagation at a complex point of a chain without looks: matrices by
    `expm`, the displacement from that of the augmented matrix, covariances summed term by term."""
    system, timing = situations.system, situations.timing
    by_name = {(b.stage, b.name): point[b.rows] for b in situations.blocks}
    nodes = [dict(timing.mean_s)]
    for variable in timing.variables:
        nodes.append(dict(timing.mean_s))
        for key in variable.moves:
            nodes[-1][key] += variable.sign * variable.std_s
    error = np.zeros((len(nodes), 3), dtype=complex)
    covariance = np.zeros((3, 3), dtype=complex)
    for k, stage in enumerate(system.stages):
        before = (system.stages[k - 1].name, "ranging") if k else (stage.name, "position")
        picked = {name: value for (at, name), value in by_name.items() if at == k}
        rotation = attitude(picked, system.horizon.tilt_rad)
        v, w = picked["velocity"] * stage.platform.v_max_mps, picked["rate"]
        w = w * stage.platform.omega_max_radps
        given = stage.position.lever_arm_m if stage.position else stage.transponder_lever_arm_m
        antenna = np.array(given, dtype=complex)
        assert stage.ranging is not None
        n = picked["bearing"] / np.sqrt(np.sum(picked["bearing"] ** 2))
        lever = np.array(stage.ranging.lever_arm_m) - antenna + stage.platform.distance_m * n
        for m, mu in enumerate(nodes):
            reference = mu.get((stage.name, "ranging"), 0.0)
            s_p = mu.get(before, 0.0) - reference
            s_a = mu.get((stage.name, "attitude"), 0.0) - reference
            screw = np.zeros((4, 4), dtype=complex)
            screw[:3, :3], screw[:3, 3] = skew(w), v
            moved = expm(screw * s_p)
            measured = rotation @ expm(skew(w) * s_a)
            error[m] += rotation @ (moved[:3, 3] + moved[:3, :3] @ antenna - antenna - lever)
            error[m] += measured @ lever
            if m == 0:
                covariance += scatter(stage, measured, lever, n)
    for off in error[1:] - error[0]:
        covariance += np.outer(off, off)
    axes = AXES[wanted.axis]
    return by_moments(error[0][axes], covariance[axes, axes], wanted)


def attitude(picked: dict[str, np.ndarray], tilt_rad: float) -> np.ndarray:
    """R = Rz Ry Rx with cosines from roots, so that complex steps pass."""
    lean = picked["lean"]
    length = np.sqrt(np.sum(lean**2))
    s0, s1 = np.sin(tilt_rad * length) * lean / length
    cr, level = np.cos(tilt_rad * length), np.sqrt(1.0 - s0 * s0)
    sr, cr = np.array([s1, cr]) / np.sqrt(s1 * s1 + cr * cr)
    cy, sy = picked["yaw"] / np.sqrt(np.sum(picked["yaw"] ** 2))
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    ry = np.array([[level, 0, -s0], [0, 1, 0], [s0, 0, level]])
    return rz @ ry @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


def scatter(stage: object, measured: np.ndarray, lever: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Covariance of a stage's noise; azimuth and elevation turn n about down and across it."""
    level = np.sqrt(n[0] ** 2 + n[1] ** 2)
    seen, first = measured @ lever, measured[:, 0]
    flat = np.sqrt(first[0] ** 2 + first[1] ** 2)
    axes = [first, np.array([-first[1], first[0], 0]) / flat, np.array([0, 0, 1.0])]
    far = stage.platform.distance_m  # type: ignore[attr-defined]
    up = far * np.array([n[0] * n[2] / level, n[1] * n[2] / level, -level])
    columns = [skew(axis) @ seen for axis in axes]
    columns += [measured @ one for one in (n, far * np.array([-n[1], n[0], 0]), up)]
    sigmas = (*stage.attitude.sigma, *stage.ranging.sigma)  # type: ignore[attr-defined]
    position = stage.position.sigma if stage.position else (0.0, 0.0, 0.0)  # type: ignore[attr-defined]
    total = np.diag(np.array(position, dtype=complex) ** 2)
    for column, sigma in zip(columns, sigmas, strict=True):
        total = total + sigma**2 * np.outer(column, column)
    return total


def by_moments(m: np.ndarray, c: np.ndarray, wanted: Wanted) -> complex:
    """Imhof's three moments and Wilson and Hilferty's quantile."""
    power = [np.eye(len(m)), c, c @ c, c @ c @ c]
    c1, c2, c3 = (np.trace(power[r]) + r * (m @ power[r - 1] @ m) for r in (1, 2, 3))
    if wanted.p is None:
        return complex(np.sqrt(c1))
    h, z = c2**3 / c3**2, NormalDist().inv_cdf(wanted.p)
    chi2 = h * (1.0 - 2.0 / (9.0 * h) + z * np.sqrt(2.0 / (9.0 * h))) ** 3
    return complex(np.sqrt(c1 + (chi2 - h) * np.sqrt(c2 / h)))


@pytest.mark.parametrize("seed", range(3))
def test_slopes_are_those_of_complex_steps(seed: int) -> None:
    """Of plain formulas, Im f(x + i h) / h without any difference (Squire and Trapp, 1998)."""
    situations = Situations(chain(seed))
    point = inside(situations, seed, len(ALL))
    ascent = _ascent(propagation(situations), ALL)
    assert ascent.slopes is not None
    found = ascent.slopes(point, np.arange(len(ALL)))
    for k, one in enumerate(ALL):
        for row in range(situations.size):
            stepped = point[:, k] + 1e-30j * np.eye(situations.size)[row]
            slope = plain_figure(situations, stepped, one).imag / 1e-30
            assert abs(slope - found[row, k]) < 1e-10 * np.max(np.abs(found[:, k]))


def test_where_nothing_scatters_nothing_has_a_slope() -> None:
    """No noise, no shift: every figure is 0 everywhere, and so is its slope."""
    situations = Situations(lidar())
    ascent = _ascent(propagation(situations), ALL)
    point = situations.starting_points(0, len(ALL))
    assert ascent.slopes is not None
    assert np.all(ascent.slopes(point, np.arange(len(ALL))) == 0.0)


def test_an_ascent_with_slopes_asks_for_no_differences() -> None:
    """|x| of one ball of three, from (0.1, 0.1, 0.1): one call for the start, one an iteration."""
    asked: list[int] = []

    def objective(point: np.ndarray, of: Index) -> np.ndarray:
        asked.append(point.shape[1])
        return np.asarray(np.sqrt(np.sum(point**2, axis=0)))

    def slopes(point: np.ndarray, of: Index) -> np.ndarray:
        return point / np.sqrt(np.sum(point**2, axis=0))

    block = (FreeVector(0, "x", "ball", slice(0, 3)),)
    start, of = np.full((3, 1), 0.1), np.zeros(1, dtype=np.intp)
    value = Ascent(block, objective, slopes).ascend(start, of, np.array([np.inf]), 1e-9, 50)
    assert value == pytest.approx(1.0, rel=1e-12)
    assert start[:, 0] == pytest.approx([1 / math.sqrt(3)] * 3)
    assert 3 not in asked  # three points would be the differences of three directions


def test_slopes_of_noise_at_the_first_node_alone() -> None:
    """Of a system with effects, some of which scatter: to the digit those of all nodes' first."""
    effects = (
        EffectEntry("noise_understated", "uav", "position", (("factor", 2.0),)),
        EffectEntry("boresight", "uav", "ranging", (("roll_rad", 0.01), ("pitch_rad", 0.0))),
    )
    system = replace(lidar(attitude=(0.01, 0.02, 0.03), horizon=Horizon()), effects=effects)
    situations = Situations(system)
    point, nodes = situations.starting_points(1, 9), situations.nodes(POINTS)[:, :5]
    whole, first = situations.moments(point, nodes), situations.moments(point, nodes, 1)
    assert np.array_equal(whole.slopes_m[:, :1], first.slopes_m)
    assert np.array_equal(whole.mean_m, first.mean_m)
