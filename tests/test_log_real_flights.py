"""Real bags and flight logs of others: what their formats' own libraries find in them.

The files are not part of this repository; see `test_diagnose_real.py` for where they are sought.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from syncline_design.diagnosis import diagnose
from syncline_design.logs.inspection import inspect_logs
from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import Stream

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("SYNCLINE_DATA", ROOT.parent / "shared" / "data")) / "formats"

pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real files in {DATA}"),
]


class Fact(NamedTuple):
    """By rosbags, mcap and pyulog: messages, first and last primary stamp, arrival - stamp [ms]."""

    messages: int
    first: int | None = None
    last: int | None = None
    median_ms: float | None = None


HUSKY = "/husky_velocity_controller/odom"
FACTS: dict[str, tuple[int, dict[str, Fact]]] = {  # streams, and facts of some
    "rosbag1/test1.bag": (3, {
        "/imu/data": Fact(11865, 1432235497988949113, 1432235893280979189, 25.2),
        HUSKY: Fact(3952, 1432235498027976030, 1432235893331706030, 0.4),
        "/fix": Fact(989, 1432235498039089918, 1432235893228159904, 0.3),
    }),
    "rosbag1/novatel_bestpos.bag": (7, {
        "/novatel/oem7/inspva": Fact(10, 1625094982966327931, 1625094982981490593, 0.5),
        "/gps/gps": Fact(12, 1625094982966645118, 1625094982983065268, 0.4),
        "/novatel/oem7/bestutm": Fact(2, 1625094982972062289, 1625094982979757423, 0.2),
    }),
    "rosbag1/novatel_ins2.bag": (3, {
        "/gps/imu": Fact(766, 1628262155391305483, 1628262155702003880, 0.2),
        "/novatel/oem7/inspvax": Fact(6, 1628262155448640689, 1628262155673877740, 0.2),
    }),
    "rosbag1/example-lz4.bag": (9, {
        "/tf": Fact(2688), "/turtle2/cmd_vel": Fact(208), "/tf_static": Fact(1),
        "/rosout": Fact(10, 1396293887843869098, 1396293887807643384, 0.0),
    }),
    "rosbag1/ouster_512x10_raw.bag": (3, {
        "/os_node0/lidar_packets": Fact(32), "/os_node0/imu_packets": Fact(10),
    }),
    "rosbag1/sick_rms_lms.bag": (12, {
        "/cloud": Fact(89, 1663929585478487730, 1663929587242373704, 35.5),
        "/cloud_radar_track": Fact(108, 1663929585508013649, 1663929587207704271, 0.8),
        "/rosout": Fact(35, 1663929585286879957, 1663929585380122104, 65.9),
    }),
    "rosbag2/wbag": (8, {"AAA": Fact(804), "HHH": Fact(726), "FFF": Fact(772)}),
    "rosbag2/cdr_test_0.db3": (2, {"/array_topic": Fact(4), "/test_topic": Fact(3)}),
    "rosbag2/test1_60s": (3, {"/imu/data": Fact(1801), HUSKY: Fact(600), "/fix": Fact(150)}),
    "mcap/talker.mcap": (2, {"/rosout": Fact(10), "/topic": Fact(10)}),
    "mcap/cdr_test_0.mcap": (2, {"/array_topic": Fact(4), "/test_topic": Fact(3)}),
    "mcap/test1_60s.mcap": (3, {"/imu/data": Fact(1801), HUSKY: Fact(600), "/fix": Fact(150)}),
    "ulog/sample_log_small.ulg": (70, {
        "sensor_combined[0]": Fact(1298, 20326716000, 26822868000),
        "vehicle_attitude[0]": Fact(1298, 20326716000, 26822868000),
        "vehicle_gps_position[0]": Fact(32, 20471648000, 26658637000),
        "vehicle_local_position[0]": Fact(636, 20321827000, 26817979000),
        "test_motor[0]": Fact(1, 0, 0),
        "mission[0]": Fact(1, 1194367328000, 1194367328000),
    }),
    "ulog/sample_px4_events.ulg": (69, {
        "sensor_combined[0]": Fact(7783, 1710773350354000000, 1710773381482000000),
        "sensor_gps[0]": Fact(31, 1710773351206000000, 1710773381210000000),
        "vehicle_gps_position[0]": Fact(583, 1710773351206000000, 1710773381470000000),
    }),
    "ulog/sample_appended_multiple.ulg": (20, {
        "sensor_combined[0]": Fact(2373, 12262822000, 21880422000),
        "vehicle_attitude[0]": Fact(306, 12263164000, 21872804000),
        "vehicle_local_position[0]": Fact(95, 12263164000, 21803961000),
    }),
    "ulog/test_ulog.ulg": (95, {
        "sensor_combined[0]": Fact(1297, 27329869000, 33819668000),
        "sensor_gps[0]": Fact(6, 28089335000, 33087335000),
        "vehicle_gps_position[0]": Fact(13, 27704335000, 33724338000),
    }),
}  # fmt: skip
UTC = {  # UTC - boot [s], median and spread [ms]
    ("ulog/sample_log_small.ulg", "vehicle_gps_position[0]"): ("1618986638.141670", "18.0"),
    ("ulog/sample_px4_events.ulg", "sensor_gps[0]"): ("0.000000", "0.0"),
    ("ulog/test_ulog.ulg", "sensor_gps[0]"): ("1765331224.535228", "12.0"),
    ("ulog/test_ulog.ulg", "vehicle_gps_position[0]"): ("1765331224.544110", "30.0"),
}


def streams_of(name: str) -> dict[str, Stream]:
    recording = open_recording(DATA / name)
    streams = recording.streams()
    assert recording.incomplete is None
    return {s.name: s for s in streams}


@pytest.mark.parametrize("name", FACTS)
def test_a_real_file_is_read_as_its_library_reads_it(name: str) -> None:
    count, facts = FACTS[name]
    streams = streams_of(name)
    assert len(streams) == count
    for topic, fact in facts.items():
        stream = streams[topic]
        stamps = stream.stamps
        assert stamps is not None
        assert stream.messages == fact.messages == len(stamps.primary_ns)
        if fact.first is not None:
            assert (stamps.primary_ns[0], stamps.primary_ns[-1]) == (fact.first, fact.last)
        if fact.median_ms is not None and stamps.secondary_ns is not None:
            late = np.median(stamps.secondary_ns - stamps.primary_ns) / 1e6
            assert late == pytest.approx(fact.median_ms, abs=0.051)
    timelines = {s.timeline for s in streams.values()}
    wanted = "boot" if name.startswith("ulog") else "unknown" if "wbag" in name else "utc"
    assert timelines <= {wanted, "boot" if name.startswith("ulog") else wanted}


def test_a_bag_of_five_files_is_one() -> None:
    streams = streams_of("rosbag2/wbag")
    assert sum(s.messages for s in streams.values()) == 6074
    assert all("are counts, not times" in s.notes[0] for s in streams.values())


@pytest.mark.parametrize(("name", "topic"), UTC)
def test_utc_against_boot(name: str, topic: str) -> None:
    offset, spread = UTC[name, topic]
    notes = " ".join(streams_of(name)[topic].notes)
    said = re.search(r"UTC - boot = (\d+)\.(\d{6}) s", notes)
    assert said is not None
    wanted = int(offset.replace(".", ""))
    assert abs(int(said.group(1) + said.group(2)) - wanted) <= 1  # half a microsecond rounds
    assert f"spread {spread} ms" in notes


def test_measurement_times_that_are_never_set_are_told() -> None:
    streams = streams_of("ulog/test_ulog.ulg")
    for topic in ("sensor_gps[0]", "vehicle_gps_position[0]"):
        assert any("timestamp_sample is 0 throughout" in n for n in streams[topic].notes)
    attitude = streams["vehicle_attitude[0]"].stamps
    assert attitude is not None
    assert attitude.secondary == "timestamp"


def test_a_laser_scan_says_when_its_points_were_measured() -> None:
    scan = streams_of("rosbag1/sick_rms_lms.bag")["/sick_lms_1xx/scan"]
    assert scan.points is not None
    assert scan.points.last_s == pytest.approx(0.015, abs=1e-6)


PARTS: dict[tuple[str, ...], tuple[str, str, str]] = {  # kind, position, reference
    ("mcap/test1_60s.mcap",): ("position", "/fix", HUSKY),
    ("ulog/test_ulog.ulg",): ("position", "vehicle_gps_position[0]", "vehicle_local_position[0]"),
    ("ulog/sample_px4_events.ulg",): (
        "position", "vehicle_gps_position[0]", "vehicle_local_position[0]",
    ),
    ("dataflash/sample.bin",): ("position", "GPS", "NKF1"),
    ("pos/rover_1Hz_rtk.pos", "pos/reference.csv"): ("position", "rover_1Hz_rtk", "reference"),
    ("trajectory/v2_03_mono.txt", "trajectory/v2_03_stereo.txt"): (
        "pose", "v2_03_mono", "v2_03_stereo",
    ),
}  # fmt: skip


@pytest.mark.parametrize("names", PARTS, ids=lambda names: names[0])
def test_a_mapping_is_proposed_for_every_file_that_diagnose_can_use(names: tuple[str, ...]) -> None:
    kind, position, reference = PARTS[names]
    proposal = inspect_logs([DATA / name for name in names]).proposal
    assert (proposal.kind, proposal.lacking) == (kind, ())
    assert proposal.log.streams["position"] == position
    assert proposal.log.streams["reference"] == reference
    assert proposal.conversions


def test_a_stray_stamp_is_told_and_a_log_without_positions_is_no_reference() -> None:
    found = inspect_logs([DATA / "ulog/sample_log_small.ulg"])
    notes = {s.name: s.notes for s in found.streams}
    assert any("off those of the file's other streams" in n for n in notes["mission[0]"])
    assert "1 of 1 stamps are 0 or not set" in notes["test_motor[0]"]
    assert "never holds a valid position" in found.proposal.lacking[0]


def test_rates_of_the_odometry_come_half_a_second_late(tmp_path: Path) -> None:
    """The oracle is plain correlation: the logged rate against the slope of the logged heading."""
    recording = open_recording(DATA / "rosbag1/test1.bag")
    pieces = list(recording.samples(HUSKY))
    c = {n: np.concatenate([p.columns[n] for p in pieces]) for n in pieces[0].columns}
    w, z = c["quaternion_w"], c["quaternion_z"]
    x, y = c["quaternion_x"], c["quaternion_y"]
    heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    slope, rate = np.gradient(heading), c["rate_z_radps"]
    lags = range(11)
    best = max(lags, key=lambda k: np.corrcoef(slope[: len(slope) - k], rate[k:])[0, 1])
    assert best == 5  # tenths of a second: a mean over ten wheel readings
    spec = tmp_path / "spec.yaml"
    spec.write_text(
        "syncline: 1\nname: robot\n"
        "requirements: [{id: A, kind: accuracy, limit: 1 m}]\n"
        "stages:\n  - name: robot\n"
        "    platform: {v_max: 1.5 m/s, omega_max: 60 deg/s, distance: 10 m, baseline: 0.5 m}\n"
        "    position:\n"
        "      sensor: {modality: position, type: gnss, sigma_position: 0.3 m, primitives: [pps]}\n"
        "      primitive: pps\n"
        "      timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}\n",
        "utf-8",
    )
    found = diagnose(spec, [DATA / "mcap/test1_60s.mcap"])
    assert any("500 ms late" in check.message for check in found.checks)
