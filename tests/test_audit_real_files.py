"""The audit on logs that people made: what is wrong in them is said, what is not is left alone.

What is expected stands in the README of the folder; the wander of the robot's IMU is fitted here by
plain least squares.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit
from syncline_design.logs.readers import open_recording

ROOT = Path(__file__).resolve().parent.parent
FORMATS = Path(os.environ.get("SYNCLINE_DATA", ROOT.parent / "shared" / "data")) / "formats"
pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not FORMATS.is_dir(), reason="the folder of real logs is not at hand"),
]


def rows(name: str) -> dict[str, StreamAudit]:
    return {row.name: row for row in audit([FORMATS / name]).streams}


def names(row: StreamAudit) -> set[str]:
    return {fault.fault for fault in row.faults}


def fault(row: StreamAudit, name: str) -> StampFault:
    return next(one for one in row.faults if one.fault == name)


def test_an_imu_that_wanders_on_its_own_clock_between_sound_streams() -> None:
    """The mean rate against a straight line through the smallest delay of each second."""
    name = "mcap/test1_60s.mcap"
    found = rows(name)
    drift = fault(found["/imu/data"], "drift")
    streams = {s.name: s for s in open_recording(FORMATS / name).streams()}
    stamps = streams["/imu/data"].stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    late = (stamps.secondary_ns - stamps.primary_ns) / 1e9
    when = (stamps.secondary_ns - stamps.secondary_ns[0]) / 1e9
    least = [(when[k], late[k]) for s in range(59)
             for k in [np.flatnonzero((when >= s) & (when < s + 1))]
             for k in [k[np.argmin(late[k])]]]  # fmt: skip
    slope = np.polyfit(*np.transpose(least), 1)[0]
    assert drift.parameters["ppm"] == pytest.approx(-1e6 * slope, rel=0.03)
    assert names(found["/imu/data"]) == {"drift"}
    assert found["/fix"].sound
    assert found["/husky_velocity_controller/odom"].sound


def test_one_header_stamp_that_goes_back() -> None:
    found = rows("rosbag1/example-lz4.bag")
    assert fault(found["/rosout"], "backward_jump").parameters["count"] == 1.0
    assert all(row.sound for name, row in found.items() if name != "/rosout")
    assert any("no stamp of their own" in line for line in found["/tf"].cannot_show)


def test_a_lidar_on_its_boot_clock_and_a_receiver_in_gps_time() -> None:
    boot = fault(rows("lidar/OS-1-32-G.pcap")["udp 7502 lidar"], "epoch_offset")
    assert (boot.parameters["kind"], boot.counts) == ("boot", True)
    gps = fault(rows("lidar/novatel_bestpos.pcap")["tcp 3001 BESTPOS"], "epoch_offset")
    assert (gps.parameters["kind"], gps.counts) == ("gps", False)


def test_a_week_that_rolled_over() -> None:
    roll = fault(rows("nmea/gp-320fw_coldboot.log")["GPGLL"], "epoch_offset")
    assert roll.parameters == {"seconds": -619_315_200.0, "kind": "week_rollover"}


def test_a_flight_controllers_own_clock_is_not_held_against_itself() -> None:
    found = rows("ulog/sample_log_small.ulg")
    assert names(found["test_motor[0]"]) == {"unset_stamps"}
    assert not any({"drift", "step", "stamped_on_arrival"} & names(row) for row in found.values())


def test_the_pause_of_a_logger_is_a_gap_of_its_streams() -> None:
    found = rows("dataflash/sample.bin")
    assert fault(found["GPS"], "gap").parameters["interval_s"] == pytest.approx(628.0, abs=0.01)


@pytest.mark.parametrize(
    "name",
    ["las/points.las", "las/warsaw_small.las", "pos/reference_1Hz.pos", "sbet/sbet.out",
     "trajectory/v2_03_mono.txt", "nmea/hemi.log", "nmea/skytraq-dgps.log", "mcap/talker.mcap",
     "rosbag1/novatel_bestpos.bag", "ubx/SF-calibration.log"],
)  # fmt: skip
def test_sound_logs_are_left_alone(name: str) -> None:
    assert {row.name: names(row) for row in rows(name).values() if not row.sound} == {}
