"""Laying one trajectory's frame onto another's, against frames that were chosen by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syncline_design.logs.frame_fit import LaidTrack, StillError, laid, mean_turn
from tests.flight_logs import flight

MADE = flight(60.0)
SHIFT = np.array([120.0, -45.0, 7.0])


def seen(turn: Rotation, late_s: float = 0.0, lever: tuple[float, ...] = (0, 0, 0),
         noise_m: float = 0.0) -> tuple[LaidTrack, np.ndarray]:  # fmt: skip
    """What one system says, and where the other says it is."""
    late = flight(60.0, late_s=late_s, noise_m=noise_m)
    place = late.place + late.turn.apply(np.array(lever, dtype=float))
    back = turn.inv()
    body = (back * MADE.turn).as_matrix()
    return LaidTrack(back.apply(MADE.place), back.apply(MADE.velocity), body), place + SHIFT


@pytest.mark.parametrize("degrees", [-170.0, 0.0, 3.0, 91.0])
@pytest.mark.parametrize(
    ("late_s", "lever"), [(0.0, (0, 0, 0)), (0.3, (0, 0, 0)), (0.05, (2.0, -1.0, 0.5))]
)
def test_the_heading_is_found_whatever_delay_and_lever_there_are(
    degrees: float, late_s: float, lever: tuple[float, ...]
) -> None:
    turn = Rotation.from_rotvec([0.0, 0.0, np.radians(degrees)])
    track, onto = seen(turn, late_s, lever, noise_m=0.01)
    found = laid(track, onto, "heading")
    assert found is not None
    apart = (Rotation.from_matrix(found.turn) * turn.inv()).magnitude()
    assert apart < np.radians(0.02)
    assert np.abs(found.shift_m - SHIFT).max() < 0.05
    assert found.delay_s == pytest.approx(late_s, abs=0.003)


def test_any_turn() -> None:
    turn = Rotation.from_rotvec([0.4, -1.1, 2.0])
    track, onto = seen(turn)
    found = laid(track, onto, "any")
    assert found is not None
    assert (Rotation.from_matrix(found.turn) * turn.inv()).magnitude() < 1e-8
    np.testing.assert_allclose(found.shift_m, SHIFT, atol=1e-6)


def test_frames_that_know_north_are_shifted_and_not_turned() -> None:
    track, onto = seen(Rotation.identity(), late_s=0.2, noise_m=0.5)
    found = laid(track, onto, "none")
    assert found is not None
    np.testing.assert_array_equal(found.turn, np.eye(3))
    assert np.abs(found.shift_m - SHIFT).max() < 0.15


def test_far_points_count_little() -> None:
    turn = Rotation.from_rotvec([0.0, 0.0, 1.0])
    track, onto = seen(turn, noise_m=0.01)
    onto[::15] += 400.0
    found = laid(track, onto, "heading")
    assert found is not None
    assert (Rotation.from_matrix(found.turn) * turn.inv()).magnitude() < np.radians(0.1)


def test_one_frame_is_left_alone_and_stillness_is_told() -> None:
    track, onto = seen(Rotation.identity())
    assert laid(track, onto - SHIFT + 0.5, "heading") is None
    still = LaidTrack(track.place * 1e-3, track.velocity * 0.0, None)
    with pytest.raises(StillError, match="extend over"):
        laid(still, still.place + SHIFT, "heading")
    with pytest.raises(StillError, match="only 5 common"):
        laid(LaidTrack(track.place[:5], track.velocity[:5], None), onto[:5], "heading")


def test_the_mean_of_turns() -> None:
    draw = np.random.default_rng(2)
    middle = Rotation.from_rotvec([0.3, -0.2, 1.4])
    turns = (middle * Rotation.from_rotvec(0.05 * draw.standard_normal((4000, 3)))).as_matrix()
    found = Rotation.from_matrix(mean_turn(turns))
    assert (found.inv() * middle).magnitude() < 0.005


def level_rover(draw: np.random.Generator, late_s: float) -> tuple[LaidTrack, np.ndarray]:
    """A track that tilts by some degrees, with an antenna 1.2 m up, white noise of 2 cm."""
    t = np.arange(0.0, 120.0, 0.1)

    def place(u: np.ndarray) -> np.ndarray:
        return np.stack([25 * np.sin(0.2 * u), 18 * np.sin(0.31 * u), 1.5 * np.sin(0.37 * u)], 1)

    def turn(u: np.ndarray) -> Rotation:
        heading = 0.06 * u + 2.4 * np.sin(0.2 * u)
        tilts = [0.05 * np.sin(1.03 * u), 0.07 * np.sin(0.7 * u)]
        return Rotation.from_euler("ZYX", np.stack([heading, *tilts], axis=1))

    velocity = (place(t + 1e-4) - place(t - 1e-4)) / 2e-4
    onto = place(t - late_s) + turn(t - late_s).apply(ARM)
    onto = onto + 0.02 * draw.standard_normal(onto.shape) + SHIFT
    return LaidTrack(place(t), velocity, turn(t).as_matrix()), onto


ARM = np.array([0.4, -0.3, -1.2])


def test_on_a_level_vehicle_a_lever_arm_down_takes_up_no_shift() -> None:
    """The shift scatters as white noise alone lets it: 2 cm over the root of 1200 rows.

    Over 20 draws the ratio of variances is chi-square over 19: beyond 2.31 once in a thousand.
    """
    down = []
    for seed in range(20):
        track, onto = level_rover(np.random.default_rng(seed), late_s=0.08)
        found = laid(track, onto, "heading", ARM)
        assert found is not None
        assert found.delay_s == pytest.approx(0.08, abs=0.002)
        down.append(found.shift_m[2] - SHIFT[2])
    assert np.var(down, ddof=1) < 2.31 * 0.02**2 / 1200
    assert abs(np.mean(down)) < 3.3 * 0.02 / np.sqrt(1200 * 20) + 1e-3  # a delay bends the arm


@pytest.mark.parametrize("off", [(0.5, 0.0, 0.0), (0.0, -0.1, 0.0), (0.2, 0.2, 0.0)])
def test_components_of_an_arm_that_show_do_not_go_into_the_shift(off: tuple[float, ...]) -> None:
    track, onto = level_rover(np.random.default_rng(1), late_s=0.0)
    found = laid(track, onto, "heading", ARM - np.array(off))
    assert found is not None
    np.testing.assert_allclose(found.shift_m, SHIFT, atol=0.01)
