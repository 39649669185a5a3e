"""Lever arms of a log's still frames beside the spec's, against chains worked out by hand."""

from __future__ import annotations

import math

import pytest

from syncline_design.logs.readers.stream import StaticPose
from syncline_design.logs.static_arms import arms_beside

STRAIGHT = (0.0, 0.0, 0.0, 1.0)
LEFT = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))  # a quarter turn to the left
POSES = (
    StaticPose("lidar", "mast", (0.2, 0.0, 0.1), STRAIGHT),
    StaticPose("mast", "base_link", (1.0, 0.5, 2.0), LEFT),
    StaticPose("gps_front", "base_link", (-0.8, 0.1, 2.1), STRAIGHT),
    StaticPose("base_link", "base_footprint", (0.0, 0.0, 0.3), STRAIGHT),
    StaticPose("lost", "nowhere", (1.0, 1.0, 1.0), STRAIGHT),
)


def test_places_along_a_chain_are_forward_right_down_of_the_body() -> None:
    """The mast looks left: 0.2 m ahead of it is 0.2 m further left."""
    found = {one.frame: one for one in arms_beside(POSES, {})}
    assert set(found) == {"lidar", "mast", "gps_front"}
    assert {one.body for one in found.values()} == {"base_link"}
    assert found["lidar"].log_m == pytest.approx((1.0, -0.7, -2.1))
    assert found["gps_front"].log_m == pytest.approx((-0.8, -0.1, -2.1))
    assert all(one.agrees and one.role is None for one in found.values())


def test_the_spec_s_arm_is_held_against_the_frame_of_its_role() -> None:
    given = {"usv.position": (-0.8, -0.1, -2.1), "usv.ranging": (1.0, 0.7, -2.1)}
    found = {one.frame: one for one in arms_beside(POSES, given)}
    assert found["gps_front"].role == "usv.position"
    assert found["gps_front"].apart_m == pytest.approx(0.0, abs=1e-12)
    assert found["lidar"].apart_m == pytest.approx(1.4)
    assert not found["lidar"].agrees
    assert found["mast"].role is None


def test_two_stages_of_one_role_are_not_guessed() -> None:
    given = {"a.position": (0.0, 0.0, 0.0), "b.position": (1.0, 0.0, 0.0)}
    assert all(one.role is None for one in arms_beside(POSES, given))


def test_a_turn_of_zeros_turns_nothing_and_nothing_gives_nothing() -> None:
    one = StaticPose("imu", "base_link", (0.1, 0.2, 0.3), (0.0, 0.0, 0.0, 0.0))
    assert arms_beside((one,), {})[0].log_m == pytest.approx((0.1, -0.2, -0.3))
    assert arms_beside((), {"usv.position": (0.0, 0.0, 0.0)}) == ()
