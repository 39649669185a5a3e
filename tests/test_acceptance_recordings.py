"""`accept` with recordings whose streams tell stamps, and no places that could be diagnosed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from tests.acceptance_samples import EXAMPLE, first_rows, run
from tests.flight_logs import flight, write_ulog

STREAMS = "log: {streams: {position: /gps/fix, attitude: /imu/data, ranging: /scan}}\n"
RATES = {"/gps/fix": 10, "/imu/data": 50, "/scan": 20}
LENGTH_S = 60
START_NS = 1_790_000_000 * 10**9
STORE = get_typestore(Stores.ROS2_HUMBLE)


def message(topic: str, stamp_ns: int) -> Any:
    """A fix, attitude and rates, or ranges of a scanner whose points have no places."""
    types = STORE.types
    time = types["builtin_interfaces/msg/Time"](*(int(x) for x in divmod(stamp_ns, 10**9)))
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="x")
    if topic == "/gps/fix":
        return types["sensor_msgs/msg/NavSatFix"](
            header=header, status=types["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
            latitude=47.0, longitude=8.0, altitude=400.0, position_covariance=np.zeros(9),
            position_covariance_type=0,
        )  # fmt: skip
    if topic == "/imu/data":
        vector = types["geometry_msgs/msg/Vector3"]
        level = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        none = np.zeros(9)
        return types["sensor_msgs/msg/Imu"](
            header=header, orientation=level, orientation_covariance=none,
            angular_velocity=vector(x=0.0, y=0.0, z=0.0), angular_velocity_covariance=none,
            linear_acceleration=vector(x=0.0, y=0.0, z=9.8), linear_acceleration_covariance=none,
        )  # fmt: skip
    return types["sensor_msgs/msg/LaserScan"](
        header=header, angle_min=-1.0, angle_max=1.0, angle_increment=0.5, time_increment=0.0,
        scan_time=0.05, range_min=0.0, range_max=100.0, ranges=np.full(5, 10.0, np.float32),
        intensities=np.zeros(0, np.float32),
    )  # fmt: skip


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Even stamps, received 0.1 to 0.3 ms after them: a folder of ROS 2."""
    source = np.random.default_rng(3)
    told = []
    for topic, rate in RATES.items():
        stamps = START_NS + (np.arange(LENGTH_S * rate) * (10**9 // rate)).astype(np.int64)
        late = source.integers(100_000, 300_000, stamps.size)
        told += [(int(s + d), topic, int(s)) for s, d in zip(stamps, late, strict=True)]
    path = tmp_path_factory.mktemp("made") / "drive"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {topic: message(topic, START_NS).__msgtype__ for topic in RATES}
        made = {t: writer.add_connection(t, kind, typestore=STORE) for t, kind in kinds.items()}
        for received, topic, stamp in sorted(told):
            raw = STORE.serialize_cdr(message(topic, stamp), kinds[topic])
            writer.write(made[topic], received, raw)
    return path


def spec(folder: Path, log: str = STREAMS) -> Path:
    """The example with stamps within 0.6 ms, to be kept for as long as the recording lasts."""
    text = EXAMPLE.read_text("utf-8").replace("stages:", "horizon: {duration: 1 min}\nstages:", 1)
    text = text.replace("low: -10 ns, high: 10 ns", "low: -0.6 ms, high: 0.6 ms")
    text = text.replace("limit: 0.3 m", "limit: 0.9 m")
    assert "0.6 ms" in text
    path = folder / "spec.yaml"
    path.write_text(f"{text}\n{log}", "utf-8")
    return path


def accepted(*arguments: object) -> tuple[dict[str, Any], int]:
    done = run("accept", *arguments, "-o", "json:-")
    assert done.stdout, done.stderr
    return json.loads(done.stdout), done.exit_code


@pytest.mark.parametrize("log", [STREAMS, ""])
def test_a_recording_without_places_is_read_for_its_stamps(
    tmp_path: Path, recording: Path, log: str
) -> None:
    result, code = accepted(spec(tmp_path, log), recording)
    assert (code, result["verdict"]) == (3, "not_shown")
    rows = {(row["role"], row["assumption"]): row["status"] for row in result["assumptions"]}
    held = {role for (role, name), status in rows.items() if (name, status) == ("timing", "holds")}
    assert held == {"position", "attitude", "ranging"}
    assert {status for (_, name), status in rows.items() if name != "timing"} == {"not_shown"}
    (said,) = [note for note in result["notes"] if "stamps alone" in note]
    assert "no log of places" in said


@pytest.mark.parametrize("only", [(), ("--only", "timing")])
def test_a_recording_s_files_are_named_by_their_contents(
    tmp_path: Path, recording: Path, only: tuple[str, ...]
) -> None:
    """A folder has no SHA-256; each of its files has."""
    result, _ = accepted(spec(tmp_path), recording, *only)
    found = {(one["file"], one["read_as"], one["sha256"]) for one in result["evidence"]}
    there = [path for path in recording.iterdir() if path.is_file()]
    assert len(there) == 2
    assert found == {(str(one), "stamps", hashlib.sha256(one.read_bytes()).hexdigest())
                     for one in there}  # fmt: skip


def test_streams_named_for_their_stamps_stand_beside_a_table_of_places(
    tmp_path: Path, recording: Path
) -> None:
    """The table tells places, attitudes and ranges; the recording the stamps of all three."""
    table = first_rows(tmp_path)
    result, code = accepted(spec(tmp_path), recording, table)
    rows = {(row["role"], row["assumption"]): row["status"] for row in result["assumptions"]}
    assert [rows[r, "timing"] for r in ("position", "attitude", "ranging")] == ["holds"] * 3
    assert rows["position", "latency"] == "broken"
    assert code == 1


@pytest.mark.parametrize("command", ["diagnose", "accept"])
def test_what_cannot_be_read_as_places_is_refused_in_words(
    tmp_path: Path, recording: Path, command: str
) -> None:
    """A diagnosis is asked of streams without places; a name is wrong."""
    if command == "diagnose":
        done = run("diagnose", spec(tmp_path), recording)
        words = "log.streams.ranging: /scan holds no ranging; found points"
    else:
        done = run("accept", spec(tmp_path, STREAMS.replace("/scan", "/scam")), recording)
        words = "no stream '/scam'"
    assert (done.exit_code, done.stdout) == (2, ""), done.stdout
    assert words in done.stderr
    assert "internal" not in done.stderr
    if command == "accept":
        done = run("accept", spec(tmp_path), recording, "--only", "latency")
        assert (done.exit_code, done.stdout) == (2, ""), done.stdout


def test_two_times_of_one_clock_are_said_to_be_so(tmp_path: Path) -> None:
    """A flight log tells when a sample was taken and when it was published, by one clock."""
    log = write_ulog(tmp_path / "flight.ulg", flight(20.0, 50.0))
    streams = "log: {streams: {attitude: 'vehicle_attitude[0]'}}\n"
    result, code = accepted(spec(tmp_path, streams), log, "--only", "timing")
    (row,) = [row for row in result["assumptions"] if row["role"] == "attitude"]
    assert (row["status"], code) == ("not_shown", 3)
    assert "two times a message, timestamp_sample and timestamp" in row["evidence"]
    shown = " ".join(run("audit", log).stdout.split())
    assert "none (timestamp:" in shown
    assert "are of one clock, which cannot be held" in shown
