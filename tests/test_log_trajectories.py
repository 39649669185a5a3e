"""Solutions and trajectories: RTKLIB, TUM, EuRoC, KITTI, SBET; files written as the layouts say."""

from __future__ import annotations

import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from pymap3d import geodetic2ecef
from scipy.spatial.transform import Rotation

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import Recording, Stream
from syncline_design.logs.readers.trajectory import quaternions_of
from syncline_design.spec.load import BadInput

SECOND = 10**9
GPS_ZERO = datetime(1980, 1, 6, tzinfo=UTC)
TITLE = (
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
    "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)\n"
)
HEIGHTS = "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,ns=# of satellites)\n"
REST = "1  19   0.0045   0.0046   0.0097   0.0027   0.0011  -0.0030   0.03    5.9"


def opened(tmp_path: Path, content: str | bytes, name: str = "log.txt") -> Recording:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return open_recording(path)


def only(recording: Recording) -> Stream:
    (stream,) = recording.streams()
    return stream


def stamps_of(recording: Recording) -> list[int]:
    stamps = only(recording).stamps
    assert stamps is not None
    return [int(at) for at in stamps.primary_ns]


def columns_of(recording: Recording) -> dict[str, np.ndarray]:
    pieces = list(recording.samples(only(recording).name))
    return {key: np.concatenate([p.columns[key] for p in pieces]) for key in pieces[0].columns}


def unix_ns(moment: datetime) -> int:
    return int(moment.timestamp()) * SECOND + moment.microsecond * 1000


# RTKLIB


def test_dates_and_weeks_of_a_solution_are_the_same_moments(tmp_path: Path) -> None:
    moments = [
        datetime(2023, 12, 30, 23, 59, 58, tzinfo=UTC) + timedelta(seconds=k) for k in range(4)
    ]
    place = "35.165360854  136.881409534    41.4069"
    dated = "".join(f"{m:%Y/%m/%d %H:%M:%S.000}   {place}   {REST}\n" for m in moments)
    weeks = ""
    for m in moments:  # the week begins on Sunday, 2023-12-31
        week, tow = divmod(round((m - GPS_ZERO).total_seconds()), 604_800)
        weeks += f"{week} {tow}.000   {place}   {REST}\n"
    found = [
        stamps_of(
            opened(tmp_path, HEIGHTS + TITLE.replace("vn(m/s)    ve(m/s)    vu(m/s)", "") + body)
        )
        for body in (dated, weeks)
    ]
    assert found[0] == found[1] == [unix_ns(m) for m in moments]


@pytest.mark.parametrize(
    ("system", "timeline", "shift_h"), [("GPST", "gps", 0), ("UTC", "utc", 0), ("JST", "utc", -9)]
)
def test_time_systems_of_a_solution(
    tmp_path: Path, system: str, timeline: str, shift_h: int
) -> None:
    text = TITLE.replace("GPST", system) + f"2023/07/11 06:04:32.125 35.1 136.8 41.4 {REST} 1 2 3\n"
    recording = opened(tmp_path, text, "rover.pos")
    assert only(recording).timeline == timeline
    moment = datetime(2023, 7, 11, 6, 4, 32, 125_000, tzinfo=UTC) + timedelta(hours=shift_h)
    assert stamps_of(recording) == [unix_ns(moment)]
    assert only(recording).name == "rover"


def test_velocity_and_quality_of_a_solution(tmp_path: Path) -> None:
    recording = opened(
        tmp_path,
        HEIGHTS + TITLE + f"2023/07/11 06:04:32.000 35.1 136.8 41.4 {REST} 0.5 -0.25 0.125\n",
    )
    row = {name: float(column[0]) for name, column in columns_of(recording).items()}
    assert (row["velocity_north_mps"], row["velocity_east_mps"]) == (0.5, -0.25)
    assert row["velocity_down_mps"] == -0.125
    assert (row["quality"], row["satellites"], row["sigma_up_m"]) == (1, 19, 0.0097)
    assert only(recording).quantity == ("position", "velocity")
    assert row["height_m"] == 41.4


def test_other_coordinates_of_a_solution(tmp_path: Path) -> None:
    x, y, z = geodetic2ecef(35.1, 136.8, 41.4)
    head = "%  GPST  x-ecef(m)  y-ecef(m)  z-ecef(m)   Q  ns\n"
    found = columns_of(
        opened(tmp_path, f"{head}2023/07/11 06:04:32.0 {x:.4f} {y:.4f} {z:.4f} {REST}\n")
    )
    assert found["latitude_deg"][0] == pytest.approx(35.1, abs=1e-9)
    assert found["height_m"][0] == pytest.approx(41.4, abs=1e-3)
    head = "% ref pos   : 35.0 136.0 10.0\n%  GPST  e-baseline(m) n-baseline(m) u-baseline(m)\n"
    recording = opened(tmp_path, f"{head}2023/07/11 06:04:32.0 1.5 2.5 -3.5 {REST}\n")
    assert only(recording).frame == "enu"
    found = columns_of(recording)
    assert [found[f"position_{a}_m"][0] for a in "xyz"] == [1.5, 2.5, -3.5]
    assert any("35.0 136.0 10.0" in note for note in only(recording).notes)
    head = "%  GPST  latitude(d'\")  longitude(d'\")  height(m)   Q  ns\n"
    found = columns_of(
        opened(tmp_path, f"{head}2023/07/11 06:04:32.0 -0 30 36.0 8 32 44.16 12.5 {REST}\n")
    )
    assert found["latitude_deg"][0] == pytest.approx(-0.51)
    assert found["longitude_deg"][0] == pytest.approx(8 + 32 / 60 + 44.16 / 3600)
    assert found["height_m"][0] == 12.5
    text = HEIGHTS.replace("ellipsoidal", "geodetic") + TITLE
    text += f"2023/07/11 06:04:32.0 35.1 136.8 41.4 {REST} 0 0 0\n"
    assert columns_of(opened(tmp_path, text))["height_msl_m"][0] == 41.4


def test_a_solution_without_header_says_what_was_taken(tmp_path: Path) -> None:
    recording = opened(tmp_path, f"2023/08/12 11:29:48.195   37.4   23.1    38.6   {REST}\n")
    assert only(recording).timeline == "gps"
    assert any("names no time system" in note for note in only(recording).notes)


# TUM, EuRoC, KITTI


def turns(count: int) -> Rotation:
    return Rotation.random(count, rng=np.random.default_rng(7))


def test_quaternions_of_matrices_are_those_of_scipy() -> None:
    half = Rotation.from_euler(
        "xyz", [[180, 0, 0], [0, 180, 0], [0, 0, 180], [0, 0, 0]], degrees=True
    )
    for turn in (turns(500), half):
        found = quaternions_of(turn.as_matrix())[:, [1, 2, 3, 0]]
        assert np.allclose((Rotation.from_quat(found) * turn.inv()).magnitude(), 0, atol=1e-7)


def test_tum_is_xyzw_and_its_stamps_are_exact(tmp_path: Path) -> None:
    q = turns(4).as_quat()
    rows = [
        f"140363658{k}.838555648 1 2 3 " + " ".join(repr(float(v)) for v in q[k]) for k in range(4)
    ]
    recording = opened(tmp_path, "\n".join(rows) + "\n")
    assert stamps_of(recording) == [1403636580838555648 + k * SECOND for k in range(4)]
    found = columns_of(recording)
    assert np.allclose(np.stack([found[f"quaternion_{a}"] for a in "xyzw"], axis=1), q)
    stream = only(recording)
    assert (stream.frame, stream.body, stream.timeline) == ("unknown", "unknown", "utc")
    assert any("axes" in note for note in stream.notes)


def test_a_header_may_name_another_order(tmp_path: Path) -> None:
    q = turns(1).as_quat()[0]
    row = f"1.5e9 1 2 3 {q[3]!r} {q[0]!r} {q[1]!r} {q[2]!r}".replace("np.float64(", "").replace(
        ")", ""
    )
    found = columns_of(opened(tmp_path, f"# timestamp tx ty tz qw qx qy qz\n{row}\n"))
    assert np.allclose([found[f"quaternion_{a}"][0] for a in "xyzw"], q)


def test_a_quaternion_without_length_is_none(tmp_path: Path) -> None:
    rows = ["1 0 0 0 0 0 0 1"] * 9 + ["2 0 0 0 0 0 0 0", "3 0 0 0 1e308 0 0 1"]
    recording = opened(tmp_path, "\n".join(rows) + "\n")
    assert np.isnan(columns_of(recording)["quaternion_w"]).tolist() == [False] * 9 + [True] * 2
    assert any("2 quaternions without length" in note for note in only(recording).notes)


@pytest.mark.parametrize("header", [True, False])
def test_euroc_is_wxyz_and_nanoseconds(tmp_path: Path, header: bool) -> None:
    q = turns(3).as_quat()
    head = (
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
        "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], "
        "b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], "
        "b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
        "b_a_RS_S_z [m s^-2]\n"
    )
    rows = ""
    for k, (x, y, z, w) in enumerate(q.tolist()):
        at = 1403636580838555648 + k * 5_000_000
        rows += f"{at},4.5,-1.5,0.5,{w},{x},{y},{z},1,2,3,7,7,7,8,8,8\n"
    recording = opened(tmp_path, head * header + rows, "data.csv")
    assert stamps_of(recording) == [1403636580838555648 + k * 5_000_000 for k in range(3)]
    found = columns_of(recording)
    assert np.allclose(np.stack([found[f"quaternion_{a}"] for a in "xyzw"], axis=1), q)
    assert found["velocity_y_mps"].tolist() == [2, 2, 2]
    assert only(recording).quantity == ("position", "attitude", "velocity")
    assert set(found) == {
        *(f"position_{a}_m" for a in "xyz"),
        *(f"quaternion_{a}" for a in "wxyz"),
        *(f"velocity_{a}_mps" for a in "xyz"),
    }


def test_an_imu_of_euroc(tmp_path: Path) -> None:
    head = (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    )
    recording = opened(tmp_path, head + "1403636579758555392,-0.1,0.2,0.3,8.1,-0.4,-2.4\n")
    assert only(recording).quantity == ("rate", "acceleration")
    assert columns_of(recording)["rate_y_radps"].tolist() == [0.2]


def test_kitti_has_no_times(tmp_path: Path) -> None:
    turn, place = turns(5), np.arange(15.0).reshape(5, 3)
    poses = np.concatenate([turn.as_matrix(), place[:, :, None]], axis=2).reshape(5, 12)
    recording = opened(
        tmp_path, "\n".join(" ".join(f"{v:.9e}" for v in row) for row in poses) + "\n"
    )
    stream = only(recording)
    assert stream.stamps is None
    assert stream.messages == 5
    assert any("times.txt" in note for note in stream.notes)
    found = columns_of(recording)
    assert np.allclose(found["position_z_m"], place[:, 2])
    back = Rotation.from_quat(np.stack([found[f"quaternion_{a}"] for a in "xyzw"], axis=1))
    assert np.allclose((back * turn.inv()).magnitude(), 0, atol=1e-7)


# SBET


def flight(records: int, wander: float = 0.4) -> np.ndarray:
    """A level turn: 17 doubles a record, velocity in axes that stand -wander from north, y left."""
    at = 604_790 + 0.5 * np.arange(records)
    course = 0.3 + 0.05 * np.arange(records)
    table = np.zeros((records, 17))
    table[:, 0], table[:, 1], table[:, 2], table[:, 3] = at, 0.7, -2.0, 1234.5
    azimuth_x = -wander
    table[:, 4] = 60 * np.cos(course - azimuth_x)  # along x
    table[:, 5] = -60 * np.sin(course - azimuth_x)  # along y, to the left of x
    table[:, 6] = 1.5  # up
    heading = (course + wander + np.pi) % (2 * np.pi) - np.pi
    table[:, 7], table[:, 8], table[:, 9], table[:, 10] = 0.01, -0.02, heading, wander
    return table


def test_an_sbet_is_turned_out_of_its_wander_frame(tmp_path: Path) -> None:
    recording = opened(tmp_path, flight(50).astype("<f8").tobytes(), "sbet.out")
    found = columns_of(recording)
    course = 0.3 + 0.05 * np.arange(50)
    assert np.allclose(found["velocity_north_mps"], 60 * np.cos(course))
    assert np.allclose(found["velocity_east_mps"], 60 * np.sin(course))
    assert np.allclose(found["velocity_down_mps"], -1.5)
    assert np.allclose(found["yaw_rad"], course)
    assert found["latitude_deg"][0] == pytest.approx(np.degrees(0.7))
    stream = only(recording)
    assert (stream.timeline, stream.frame, stream.body) == ("unknown", "wgs84", "frd")
    assert stream.stamps is not None
    assert stream.stamps.primary == "seconds of the GPS week"
    assert stamps_of(recording)[:2] == [604_790 * SECOND, 604_790_500_000_000]
    assert any("past the end of the week" in note for note in stream.notes)


def test_a_week_that_begins_again_is_said(tmp_path: Path) -> None:
    table = flight(60)
    table[:, 0] %= 604_800
    stream = only(opened(tmp_path, table.astype("<f8").tobytes()))
    assert any("begin again 1 times" in note for note in stream.notes)


def test_an_impossible_record_of_an_sbet_costs_itself(tmp_path: Path) -> None:
    table = flight(200)
    table[150, 1] = 3.0  # a latitude beyond the pole
    recording = opened(tmp_path, table.astype("<f8").tobytes())
    assert only(recording).messages == 199
    assert recording.incomplete is not None
    assert "record 151" in recording.incomplete.reason


def test_a_cut_sbet_is_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, flight(3).astype("<f8").tobytes()[:-1])
    assert (only(recording).messages, only(recording).partial) == (2, True)


def test_errors_of_an_sbet(tmp_path: Path) -> None:
    rows = [(400_000 + k, *[0.01] * 3, *[0.002] * 3, 0.3, 0.3, 0.6) for k in range(20)]
    recording = opened(tmp_path, b"".join(struct.pack("<10d", *row) for row in rows))
    assert recording.format == "smrmsg of an SBET"
    assert columns_of(recording)["sigma_yaw_deg"][0] == pytest.approx(0.01)


# bad lines


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (f"{TITLE}2023/07/11 06:04:32.000 35.1 x 41.4 {REST}\n", 2, "no epoch"),
        (f"{TITLE}2023/07/11 06:04:32.000 95.1 136.8 41.4 {REST}\n", 2, "no place"),
        (f"{TITLE}2137 9.1e9 35.1 136.8 41.4 {REST}\n", 2, "no epoch"),
        (f"{TITLE}2023/13/11 06:04:32.000 35.1 136.8 41.4 {REST}\n", 2, "no epoch"),
        (f"{TITLE}2023/07/11 06:04:32.000 nan 136.8 41.4 {REST}\n", 2, "no place"),
    ],
)  # fmt: skip
def test_where_no_line_is_good_the_first_is_refused_at_its_place(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    with pytest.raises(BadInput) as caught:
        opened(tmp_path, text).streams()
    (flaw,) = caught.value.problems
    assert words in flaw.message
    assert flaw.line == line


@pytest.mark.parametrize(
    "text",
    [
        f"{HEIGHTS}{TITLE}2023/07/11 06:04:32.000 35.1 136.8 41.4 {REST} 0 0 0\n2023/07/11 06:0",
        "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n3 0 0 0",
    ],
)
def test_a_last_line_that_is_cut_is_left_out(tmp_path: Path, text: str) -> None:
    recording = opened(tmp_path, text)
    assert only(recording).messages == text.count("\n") - text.count("%")
    assert only(recording).partial
