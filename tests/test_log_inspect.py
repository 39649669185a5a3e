"""`log inspect`: streams, the proposed mapping, and the way from a bag to a finding."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.logs.inspection import inspect_logs, rate_hz
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from syncline_design.spec.log_block import LogChoice
from tests.flight_logs import (
    START_NS,
    Flight,
    flight,
    geodetic,
    write_mcap,
    write_ros1,
    write_ulog,
)
from tests.test_diagnose_recordings import spec, tum

MADE = flight(20.0)


def run(*words: str | Path) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    return result.exit_code, result.stdout, result.stderr


def as_json(*words: str | Path) -> dict[str, Any]:
    code, out, _ = run("log", "inspect", *words, "--output", "json:-")
    assert code == 0
    found: dict[str, Any] = json.loads(out)
    jsonschema.Draft202012Validator(result_schema("log")).validate(found)
    return found


def test_every_stream_with_its_stamps(tmp_path: Path) -> None:
    found = as_json(write_ros1(tmp_path / "a.bag", MADE))
    assert found["schema"] == "syncline-design/log/v1"
    streams = {s["name"]: s for s in found["streams"]}
    imu = streams["/imu"]
    assert imu["quantity"] == ["attitude", "rate", "acceleration"]
    assert (imu["messages"], imu["timeline"], imu["frame"], imu["partial"]) == (
        len(MADE), "utc", "enu", False,
    )  # fmt: skip
    assert imu["stamps"] == {"primary": "header.stamp", "secondary": "log time"}
    assert imu["first_ns"] == START_NS
    assert imu["first"] == pytest.approx(START_NS / 1e9, abs=3e-7)
    assert imu["first_time"] == "2023-11-14T22:13:20.123456789"
    assert imu["rate_hz"] == pytest.approx(10.0, rel=1e-6)


def test_the_mapping_says_who_plays_what_and_every_conversion(tmp_path: Path) -> None:
    proposal = as_json(write_mcap(tmp_path / "a.mcap", MADE))["proposal"]
    assert proposal["kind"] == "position"
    assert proposal["log"]["streams"] == {
        "position": "/fix", "reference": "/odom", "attitude": "/odom",
    }  # fmt: skip
    parts = {p["role"]: p for p in proposal["parts"]}
    assert parts["position"]["confidence"] == "high"
    assert parts["reference"]["confidence"] == "medium"
    said = " ".join(proposal["conversions"])
    for words in ("north, east, down", "quaternions", "degrees", "first fix", "velocities in the"):
        assert words in said
    assert proposal["lacking"] == []


def test_the_schema_knows_the_keys_of_the_block(tmp_path: Path) -> None:
    found = as_json(write_mcap(tmp_path / "a.mcap", MADE))
    validator = jsonschema.Draft202012Validator(result_schema("log"))
    for wrong in ({"streams": "/fix"}, {"streams": {"compass": "/mag"}}, {"body": "frf"},
                  {"gps_week": "2385"}):  # fmt: skip
        broken = {**found, "proposal": {**found["proposal"], "log": wrong}}
        assert not validator.is_valid(broken), wrong
    keys = validator.schema["$defs"]["ProposedBlock"]["properties"]
    assert set(keys) <= set(LogChoice.model_fields)


def test_from_a_bag_to_a_finding_in_two_commands(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path / "a.bag", MADE, fixes=flight(20.0, late_s=0.2, noise_m=0.02))
    own, mapped = spec(tmp_path), tmp_path / "mapped.yaml"
    code, _, said = run("log", "inspect", bag, "--spec", own, "--write-spec", mapped)
    assert (code, "spec with the mapping written" in said) == (0, True)
    choice = load(mapped).spec.log
    assert choice is not None
    assert choice.streams.model_dump(exclude_none=True) == {
        "position": "/fix", "reference": "/odom", "attitude": "/odom",
    }  # fmt: skip
    code, out, _ = run("diagnose", mapped, bag)
    assert code == 1
    late = re.search(r"Position data are ([0-9.]+) \S+ [0-9.]+ ms older", out)
    assert late is not None, out[:600]
    assert float(late.group(1)) == pytest.approx(200.0, abs=2.0)


def test_a_mapping_joins_what_the_spec_says_already(tmp_path: Path) -> None:
    own = spec(tmp_path, log="{origin: [47.3 deg, 8.55 deg, 460 m]}")
    mapped = tmp_path / "mapped.yaml"
    bag = write_ros1(tmp_path / "a.bag", MADE)
    assert run("log", "inspect", bag, "--spec", own, "--write-spec", mapped)[0] == 0
    choice = load(mapped).spec.log
    assert choice is not None
    assert choice.origin is not None
    assert choice.streams.position == "/fix"


def test_two_trajectories_with_axes_that_nothing_tells(tmp_path: Path) -> None:
    files = tum(tmp_path / "slam.txt", MADE, 0.4), tum(tmp_path / "truth.txt", MADE)
    proposal = as_json(*files)["proposal"]
    assert proposal["kind"] == "pose"
    assert (proposal["log"]["frame"], proposal["log"]["body"]) == ("enu", "flu")
    assert any("is assumed (log: {frame: ...})" in one for one in proposal["conversions"])


def test_a_cut_file_is_read_in_part_and_says_so(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "a.ulg", MADE)
    path.write_bytes(path.read_bytes()[:-100])
    found = as_json(path)
    assert found["files"][0]["incomplete"]["reason"] == "cut off within a record"
    assert all(one["partial"] for one in found["streams"])
    code, out, _ = run("log", "inspect", path)
    assert (code, "Read in part" in out) == (0, True)


def test_what_cannot_be_read_ends_with_two_and_writes_nothing(tmp_path: Path) -> None:
    bag, bad = write_ros1(tmp_path / "a.bag", MADE), tmp_path / "bad.bin"
    bad.write_bytes(bytes(range(256)))
    mapped = tmp_path / "mapped.yaml"
    own = spec(tmp_path)
    code, out, said = run("log", "inspect", bad, "--spec", own, "--write-spec", mapped)
    assert (code, mapped.exists()) == (2, False)
    assert "no log that can be read" in said
    listed = tmp_path / "listed.json"
    code, out, said = run("log", "inspect", bad, "--output", f"json:{listed}")
    assert (code, out, listed.exists()) == (2, "", False)
    code, out, said = run("log", "inspect", bag, bad)
    assert code == 2
    assert "/odom" in out  # what could be read is shown all the same


@pytest.mark.parametrize("row", ["nan,inf", "1e30,-1e40"])
def test_a_file_of_stamps_without_a_time_gives_nothing(tmp_path: Path, row: str) -> None:
    """As `audit` says; where one of the columns holds times, they are told."""
    path = tmp_path / "stamps.csv"
    path.write_text(f"stamp_s,receive_s\n{row}\n{row}\n")
    code, _, told = run("log", "inspect", path)
    assert code == 2
    assert "no message in it has a time" in told
    path.write_text("stamp_s,receive_s\nnan,1.5\nnan,2.5\n")
    code, out, _ = run("log", "inspect", path)
    assert code == 0
    assert "2 of 2 stamps are 0 or not set" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--write-spec", "x.yaml"), "--write-spec needs --spec SPEC"),
        (("--output", "csv:x.csv"), "csv"),
    ],
)
def test_usage_is_refused(tmp_path: Path, words: tuple[str, ...], message: str) -> None:
    code, _, said = run("log", "inspect", write_ros1(tmp_path / "a.bag", flight(2.0)), *words)
    assert code == 2
    assert message in said


def test_an_unknown_name_in_the_spec_is_told_with_its_neighbour(tmp_path: Path) -> None:
    own = spec(tmp_path, log="{streams: {position: /fixx}}")
    bag = write_ros1(tmp_path / "a.bag", flight(3.0))
    lacking = as_json(bag, "--spec", own)["proposal"]["lacking"]
    assert len(lacking) == 1
    assert "did you mean /fix?" in lacking[0]


def test_one_file_says_what_is_missing_for_a_diagnosis(tmp_path: Path) -> None:
    proposal = as_json(tum(tmp_path / "only.txt", MADE))["proposal"]
    assert proposal["kind"] is None
    assert "nothing to hold the positions against" in proposal["lacking"][0]


def test_rates_do_not_depend_on_gaps_packets_and_strays() -> None:
    even = np.arange(0, 10_000_000_000, 10_000_000)
    packets = np.repeat(np.arange(0, 1_600_000_000, 16_000_000), 4)
    burst = np.concatenate([even, even + 3_600 * 10**9])
    assert rate_hz(even) == pytest.approx(100.0)
    assert rate_hz(packets) == pytest.approx(250.0)
    assert rate_hz(burst) == pytest.approx(100.0)
    assert rate_hz(np.append(even, 10**18)) == pytest.approx(100.0)
    assert rate_hz(even[:1]) is None
    assert rate_hz(np.arange(1000, 3000)) is None  # counts, not times


def test_stamps_far_from_all_others_are_told(tmp_path: Path) -> None:
    """A topic that counts from elsewhere, by hand: three topics, one 100 s ahead."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind, time = "std_msgs/msg/Header", store.types["builtin_interfaces/msg/Time"]
    with Writer(tmp_path / "a.bag") as writer:
        for topic, ahead in (("/a", 0), ("/b", 0), ("/c", 100)):
            made = writer.add_connection(topic, "geometry_msgs/msg/PointStamped", typestore=store)
            for k in range(20):
                head = store.types[kind](
                    seq=k, stamp=time(1_700_000_000 + k + ahead, 0), frame_id=""
                )
                point = store.types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0)
                message = store.types["geometry_msgs/msg/PointStamped"](head, point)
                data = store.serialize_ros1(message, "geometry_msgs/msg/PointStamped")
                writer.write(made, (1_700_000_000 + k) * 10**9, data)
    found = {s.name: s.notes for s in inspect_logs([tmp_path / "a.bag"]).streams}
    assert any("lie +90.500 s off" in note for note in found["/c"])
    assert not any("off those" in note for note in (*found["/a"], *found["/b"]))


def as_table(path: Path, made: Flight, *, reference: bool = True, parquet: bool = False) -> Path:
    """The package's own columns, places in degrees: attitude, and the better places."""
    import polars as pl

    globe = geodetic(made.place)
    euler = np.degrees(made.turn.as_euler("ZYX")[:, ::-1])
    columns = {"time": [calendar_text(int(ns)) for ns in made.stamp_ns]}
    columns |= {f"{n}_deg": euler[:, k] for k, n in enumerate(("roll", "pitch", "yaw"))}
    names = ("latitude_deg", "longitude_deg", "height_m")
    columns |= {("reference_" * reference) + n: globe[:, k] for k, n in enumerate(names)}
    frame = pl.DataFrame(columns)
    if parquet:
        frame = frame.with_columns(pl.col("time").str.to_datetime(time_unit="ns", time_zone="UTC"))
        frame.write_parquet(path)
    else:
        frame.write_csv(path, float_precision=12)
    return path


def calendar_text(ns: int) -> str:
    return f"{np.datetime64(ns, 'ns')}Z"


@pytest.mark.parametrize("parquet", [False, True])
def test_a_table_of_a_reference_beside_a_receivers_solution(tmp_path: Path, parquet: bool) -> None:
    """The files that `diagnose` takes: what the table's columns say is not asked of the other."""
    from tests.flat_flight_logs import write_pos

    late = flight(45.0, late_s=0.2, noise_m=0.02)
    files = [
        write_pos(tmp_path / "rover.pos", late),
        as_table(tmp_path / ("truth.parquet" if parquet else "truth.csv"), flight(45.0),
                 parquet=parquet),
    ]  # fmt: skip
    found = as_json(*files)
    streams = {s["name"]: s for s in found["streams"]}
    assert streams["truth"]["quantity"] == ["attitude", "reference"]
    assert (streams["truth"]["timeline"], streams["truth"]["messages"]) == ("utc", 450)
    assert streams["truth"]["first_ns"] == START_NS
    proposal = found["proposal"]
    assert (proposal["kind"], proposal["lacking"]) == ("position", [])
    parts = {p["role"]: (p["stream"], p["confidence"]) for p in proposal["parts"]}
    assert parts == {"position": ("rover", "high"), "attitude": ("truth", "stated"),
                     "reference": ("truth", "stated")}  # fmt: skip
    assert proposal["log"]["streams"] == {"position": "rover"}
    own, mapped = spec(tmp_path), tmp_path / "mapped.yaml"
    assert run("log", "inspect", *files, "--spec", own, "--write-spec", mapped)[0] == 0
    code, out, _ = run("diagnose", mapped, *files)
    assert code == 1
    said = re.search(r"Position data are ([0-9.]+) \S+ [0-9.]+ ms older", out)
    assert said is not None, out[:600]
    assert float(said.group(1)) == pytest.approx(200.0, abs=2.0)


def test_ranges_in_a_table_are_not_asked_of_the_bag_beside_it(tmp_path: Path) -> None:
    """What a table plays is no stream: a block that named it would be refused by `diagnose`."""
    path = tmp_path / "ranges.csv"
    rows = [f"{calendar_text(int(ns))},30,1,2,5,6,7" for ns in MADE.stamp_ns]
    head = "time,range_m,azimuth_deg,elevation_deg,target_north_m,target_east_m,target_down_m"
    path.write_text("\n".join([head, *rows]) + "\n", "utf-8")
    proposal = as_json(write_ros1(tmp_path / "a.bag", MADE), path)["proposal"]
    assert proposal["kind"] == "georeference"
    assert set(proposal["log"]["streams"]) == {"position", "attitude"}
    assert [p["stream"] for p in proposal["parts"] if p["role"] == "ranging"] == ["ranges"]


def test_a_table_alone_needs_no_mapping(tmp_path: Path) -> None:
    from tests.test_diagnose_recordings import table

    path = table(tmp_path / "log.csv", MADE, MADE)
    proposal = as_json(path)["proposal"]
    assert (proposal["kind"], proposal["block"], proposal["lacking"]) == ("position", "", [])
    own, mapped = spec(tmp_path), tmp_path / "mapped.yaml"
    code, _, said = run("log", "inspect", path, "--spec", own, "--write-spec", mapped)
    assert (code, mapped.read_text("utf-8")) == (0, own.read_text("utf-8"))
    assert "the names of the columns are the mapping" in said
    broken = tmp_path / "less.csv"
    lines = [line.rpartition(",")[0] for line in path.read_text("utf-8").splitlines()]
    broken.write_text("\n".join(lines).replace("reference_down_m", "other_m")
                      .replace("reference_north_m", "more_m").replace("reference_east_m", "else_m"),
                      "utf-8")  # fmt: skip
    proposal = as_json(broken)["proposal"]
    assert proposal["kind"] is None
    assert "columns are missing: reference_north_m" in proposal["lacking"][0]


def test_columns_that_the_spec_names_are_listed(tmp_path: Path) -> None:
    """Without the spec nobody knows which column holds times."""
    path = tmp_path / "log.csv"
    rows = [f"{0.1 * k:.1f},{k},2,3,{k},2,3,1,2,{k}" for k in range(40)]
    path.write_text("\n".join(["zeit,a,b,c,d,e,f,r,p,y", *rows]) + "\n", "utf-8")
    names = {"time_s": "zeit"} | {
        f"{what}_{axis}_m": letter
        for (what, axis), letter in zip(
            ((w, a) for w in ("position", "reference") for a in ("north", "east", "down")),
            "abcdef", strict=True,
        )
    } | {"roll_deg": "r", "pitch_deg": "p", "yaw_deg": "y"}  # fmt: skip
    columns = ", ".join(f"{name}: {theirs}" for name, theirs in names.items())
    assert run("log", "inspect", path)[0] == 2
    found = as_json(path, "--spec", spec(tmp_path, log=f"{{columns: {{{columns}}}}}"))
    (stream,) = found["streams"]
    assert (stream["messages"], stream["first_ns"], stream["last_ns"]) == (40, 0, 3_900_000_000)
    assert stream["quantity"] == ["position", "attitude", "reference"]
    assert found["proposal"]["kind"] == "position"


def test_a_stream_that_began_before_the_others_is_not_off(tmp_path: Path) -> None:
    """One stream has times 100 s before three others have; a fifth stands 20 years before."""
    lines = []
    for k in range(110):
        clock = f"05-04T10:{k // 60:02d}:{k % 60:02d}Z"
        kinds = ("SKY", "TPV", "ATT", "GST") if k >= 100 else ("SKY",)
        lines += [f'{{"class":"{kind}","time":"2026-{clock}"}}' for kind in kinds]
        lines.append(f'{{"class":"IMU","time":"2006-{clock}"}}')
    path = tmp_path / "run.json"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    off = {s.name for s in inspect_logs([path]).streams if "off those of" in " ".join(s.notes)}
    assert off == {"IMU"}
