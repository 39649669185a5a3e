"""The quick chain of leaning vehicles against the row-wise one; the search of worst cases by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from syncline_design.simulation import kernel, known_effects
from syncline_design.simulation.surroundings import Moment
from syncline_design.simulation.worst_case import _Search
from tests.simulation_systems import fixed_wing, survey


def drawn(seed: int, n: int, noise: float, shift_s: float) -> kernel.Draw:
    """Everything at random; yaw and line of sight of any length."""
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal
    return kernel.Draw(
        cos_yaw=normal(n),
        sin_yaw=normal(n),
        velocity_mps=5.0 * normal((3, n)),
        rate_radps=normal((3, n)),
        range_m=rng.uniform(1.0, 200.0, n),
        bearing=normal((3, n)),
        antenna_m=normal((3, n)),
        ranging_m=normal((3, 1)),
        position_noise_m=0.1 * normal((3, n)),
        angle_noise_rad=noise * normal((5, n)),
        range_noise_m=0.1 * normal(n),
        mu_position_s=shift_s * normal(n),
        mu_attitude_s=shift_s * normal(n),
        mu_ranging_s=shift_s * normal(n),
    )


def both(draw: kernel.Draw, lean_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (3, n) of two such stages, one after the other: quick, and row by row."""
    n = draw.range_m.shape[0]
    moment = Moment(np.zeros(n), np.zeros((2, n)))
    quick = plain = None
    for _ in range(2):
        quick = known_effects.leaning_error(draw, lean_rad, quick)
        plain = known_effects.placed_error(draw, (moment, lean_rad), (), None, plain)
    assert quick is not None
    assert plain is not None
    return quick.error_m, plain.error_m


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.3])
@pytest.mark.parametrize("shift_s", [0.0, 1e-4, 1.0, 10.0])
def test_it_is_the_chain(noise: float, shift_s: float) -> None:
    """Leaning by up to 80 degrees, turns of many rad: 1e-11 of the distance."""
    lean = np.random.default_rng(1).uniform(-1.4, 1.4, (2, 500))
    quick, plain = both(drawn(2, 500, noise, shift_s), lean)
    assert np.max(np.abs(quick - plain)) < 200.0 * 1e-11


def test_it_is_the_chain_at_gimbal_lock() -> None:
    """Nose straight down or up, at rest: the roll counts as yaw in both."""
    draw = replace(drawn(3, 40, 0.1, 0.1), rate_radps=np.zeros((3, 40)))
    lean = np.zeros((2, 40))
    lean[1] = np.where(np.arange(40) % 2, 0.5, -0.5) * math.pi
    quick, plain = both(draw, lean)
    assert np.max(np.abs(quick - plain)) < 200.0 * 1e-11


def test_it_is_the_chain_where_nothing_ranges_and_straight_down() -> None:
    """No line of sight at all, and one along the body's down axis, where azimuth counts as 0."""
    for sight in (np.zeros((3, 30)), np.array([[0.0], [0.0], [2.0]]) * np.ones(30)):
        draw = replace(drawn(4, 30, 0.1, 0.1), bearing=sight, range_m=np.full(30, 40.0))
        if not sight.any():
            draw = replace(draw, range_m=np.zeros(30), range_noise_m=np.zeros(30))
        quick, plain = both(draw, np.full((2, 30), 0.2))
        assert np.max(np.abs(quick - plain)) < 200.0 * 1e-11


@pytest.mark.parametrize("system", [fixed_wing(), survey()], ids=["wing", "survey"])
def test_the_search_meets_the_same_errors(system: object) -> None:
    """Points of the worst case's search, which leans by up to 10 degrees, by both chains."""
    search = _Search(system, np.array([1e-3, 1.0]))  # type: ignore[arg-type]
    assert search.placed
    assert not search.acting
    point = search.starting_points(0, 40)
    of = np.repeat([0, 1], 40)
    quick = search.error_m(point, of)
    search.acting = {"nowhere": ()}  # of no stage: the row-wise chain without effects
    np.testing.assert_allclose(quick, search.error_m(point, of), rtol=1e-10)
