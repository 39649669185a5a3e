"""Lever arms of a log's still frames beside the spec's, against chains worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from syncline_design.logs.log_files import row_sources
from syncline_design.logs.readers.stream import StaticPose
from syncline_design.logs.reading import read_log
from syncline_design.logs.static_arms import arms_beside
from syncline_design.spec.log_block import LogChoice
from tests import flight_logs

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


def _with_static(messages, place):  # type: ignore[no-untyped-def]
    """The flight's messages behind one of the vehicle's still frames: x forward, y left, z up."""

    def written(store, made, seq, fixes=None):  # type: ignore[no-untyped-def]
        kinds = store.types
        first = messages(store, made, seq, fixes)
        head = kinds["std_msgs/msg/Header"](
            stamp=kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=0), frame_id="base_link"
        )
        still = kinds["geometry_msgs/msg/TransformStamped"](
            header=head, child_frame_id="gps_link", transform=kinds["geometry_msgs/msg/Transform"](
                translation=kinds["geometry_msgs/msg/Vector3"](*place),
                rotation=kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)),
        )  # fmt: skip
        tf = kinds["tf2_msgs/msg/TFMessage"](transforms=[still])
        return [("/tf_static", "tf2_msgs/msg/TFMessage", first[0][2], tf), *first]

    return written


@pytest.mark.parametrize(
    ("place", "words"),
    [((0.4, 0.1, 1.2), "gps_link: the log's own lever arm of uav.position is 0.400, -0.100, "
      "-1.200 m (forward, right, down from base_link), as the spec has it"),
     ((0.4, -0.2, 1.2), "0.400, 0.200, -1.200 m (forward, right, down from base_link), 0.300 m "
      "from the spec's, which was used")],
)  # fmt: skip
def test_a_diagnosis_says_where_the_log_states_another_lever_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: tuple[float, ...], words: str
) -> None:
    monkeypatch.setattr(flight_logs, "ros_messages", _with_static(flight_logs.ros_messages, place))
    bag = flight_logs.write_mcap(tmp_path / "a.mcap", flight_logs.flight(4.0))
    arms = {"uav.position": (0.4, -0.1, -1.2)}
    sources = row_sources([bag], LogChoice(), ["uav"], poses=False, arms=arms)
    log = read_log(sources, ["uav"], needs_ranging=False)
    assert any(note.endswith(words) for note in log.notes)
