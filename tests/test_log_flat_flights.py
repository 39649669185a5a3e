"""One simulated flight in every flat format: what is read is what was flown, to the last digit.

Then one hidden delay of the receiver, found from pairs of formats.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from syncline_design.logs.inspection import inspect_logs
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.epochs import WEEK_NS, gps_to_utc, week_start_ns
from syncline_design.logs.reading import read_log
from syncline_design.logs.stream_times import ASSUMED_GPS
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice
from tests import flat_flight_logs as made
from tests.flight_logs import ORIGIN, TO_ENU, TO_FLU, Flight, flight, geodetic, write_ulog
from tests.test_diagnose_recordings import FIXES, LATE_S, TRUTH, found, latency

pytest.importorskip("pyubx2")

FLOWN = flight(8.0)
SECOND = 10**9
DEGREE_M = 111_320.0
EXACT_NS, MICROSECOND, MILLISECOND = 0, 1_000, 1_000_000
# writer, stream, error of a stamp [ns], of a place [m], of a velocity [m/s], of an attitude [deg]
Writer = Callable[[Path, Flight], Path]
FORMATS: dict[str, tuple[Writer, str, int, float, float, float]] = {
    "nmea": (made.write_nmea, "fix", MICROSECOND, 2e-4, 1e-5, 0),
    "ubx": (made.write_ubx, "NAV-PVT", 1, 2e-4, 6e-4, 0),
    "ubx-coarse": (
        lambda p, f: made.write_ubx(p, f, fine=False), "NAV-PVT", 1, 0.01, 6e-4, 0
    ),
    "pos": (made.write_pos, "flight", 0, 2e-4, 1e-5, 0),
    "sbet": (made.write_sbet, "flight", 120, 1e-6, 1e-9, 1e-7),
    "csv": (made.write_german_csv, "flight", 0, 2e-5, 1e-9, 1e-7),
    "tum": (made.write_tum, "flight", 0, 1e-8, 0, 1e-6),
    "euroc": (made.write_euroc, "flight", 0, 1e-8, 1e-8, 1e-6),
    "dataflash": (
        lambda p, f: made.write_dataflash(p, f, f), "GPS", MICROSECOND, 0.01, 1e-5, 0
    ),
}  # fmt: skip


def read(path: Path, name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """UTC stamps and columns of a stream."""
    recording = open_recording(path)
    (stream,) = [s for s in recording.streams() if s.name == name]
    pieces = list(recording.samples(name))
    columns = {key: np.concatenate([p.columns[key] for p in pieces]) for key in pieces[0].columns}
    stamps = np.concatenate([p.primary_ns for p in pieces])
    if stream.timeline == "boot":  # through the receiver's own time
        apart = columns["clock_utc_ns"] - stamps
        stamps = stamps + int(np.median(apart))
    elif stream.timeline == "unknown":
        week = (int(FLOWN.stamp_ns[0]) - week_start_ns(0)) // WEEK_NS
        stamps = gps_to_utc(stamps + week_start_ns(int(week)))
    elif stream.timeline == "gps":
        stamps = gps_to_utc(stamps)
    return stamps, columns


def places(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Metres from the truth along north, east, up."""
    if "position_x_m" in columns:
        local = np.stack([columns[f"position_{a}_m"] for a in "xyz"], axis=1)
        return local - TO_ENU.apply(FLOWN.place)
    globe = geodetic(FLOWN.place)
    height = columns.get("height_m", columns.get("height_msl_m", np.zeros(0)) + made.GEOID_M)
    north = (columns["latitude_deg"] - globe[:, 0]) * DEGREE_M
    east = (columns["longitude_deg"] - globe[:, 1]) * DEGREE_M * np.cos(np.radians(globe[:, 0]))
    return np.stack([north, east, height - globe[:, 2]], axis=1)


def turns(columns: dict[str, np.ndarray]) -> Rotation:
    if "quaternion_w" in columns:
        given = Rotation.from_quat(np.stack([columns[f"quaternion_{a}"] for a in "xyzw"], axis=1))
        return TO_ENU.inv() * given * TO_FLU
    unit = "deg" if "yaw_deg" in columns else "rad"
    euler = np.stack([columns[f"{n}_{unit}"] for n in ("yaw", "pitch", "roll")], axis=1)
    return Rotation.from_euler("ZYX", euler, degrees=unit == "deg")


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_read_is_what_was_flown(tmp_path: Path, name: str) -> None:
    write, stream, near_ns, near_m, near_mps, near_deg = FORMATS[name]
    path = write(tmp_path / f"flight.{name}", FLOWN)
    stamps, columns = read(path, stream)
    if stream == "GPS":  # milliseconds of the receiver set the boot clock against UTC
        near_ns = MILLISECOND
    assert np.max(np.abs(stamps - FLOWN.stamp_ns)) <= near_ns
    assert np.max(np.abs(places(columns))) < near_m
    if near_mps:
        axes = ("north", "east") if name == "nmea" else ("north", "east", "down")
        truth = FLOWN.velocity
        if "velocity_x_mps" in columns:
            axes, truth = ("x", "y", "z"), TO_ENU.apply(FLOWN.velocity)
        velocity = np.stack([columns[f"velocity_{axis}_mps"] for axis in axes], axis=1)
        assert np.max(np.abs(velocity - truth[:, : len(axes)])) < near_mps
    if near_deg:
        apart = np.degrees((turns(columns) * FLOWN.turn.inv()).magnitude())
        assert np.max(apart) < near_deg


PAIRS: dict[str, Callable[[Path], tuple[list[Path], str]]] = {
    "nmea against sbet": lambda p: (
        [made.write_nmea(p / "gnss.log", FIXES), made.write_sbet(p / "ref.out", TRUTH)], ""
    ),
    "ubx against csv": lambda p: (
        [made.write_ubx(p / "gnss.ubx", FIXES), made.write_german_csv(p / "ref.csv", TRUTH)], ""
    ),
    "pos against tum": lambda p: (
        [made.write_pos(p / "gnss.pos", FIXES), made.write_tum(p / "ref.txt", TRUTH)],
        "{frame: enu, body: flu}",
    ),
    "dataflash": lambda p: ([made.write_dataflash(p / "flight.bin", TRUTH, FIXES)], ""),
}  # fmt: skip


@pytest.mark.parametrize("name", ["ubx against csv", "pos against tum"])
def test_the_rows_of_a_pair_show_the_delay(tmp_path: Path, name: str) -> None:
    """By least squares on the rows themselves: places that are tau old differ by -v tau."""
    files, log = PAIRS[name](tmp_path)
    choice = LogChoice(frame="enu", body="flu") if log else LogChoice()
    read = read_log(row_sources(files, choice, ["uav"], poses=False), ["uav"], needs_ranging=False)
    assert len(read) > 440
    antenna, velocity = read.stages[0].antenna_m, read.stages[0].velocity_mps
    assert antenna is not None
    late_s = -np.sum((antenna - read.truth_m) * velocity) / np.sum(velocity**2)
    assert late_s == pytest.approx(LATE_S, abs=1e-3)


@pytest.mark.parametrize("name", ["nmea against sbet", "dataflash"])
def test_the_delay_is_found_from_a_pair_of_formats(tmp_path: Path, name: str) -> None:
    files, log = PAIRS[name](tmp_path)
    result = found(tmp_path, *files, log=log)
    value, sigma = latency(result)
    assert abs(value - LATE_S) < 4.0 * sigma
    assert [f.effect for f in result.findings if f.kind == "cause"] == ["latency"]


# ---- what a file does not tell ------------------------------------------------------------------


def rows_of(files: list[Path], choice: LogChoice) -> tuple[float, tuple[str, ...]]:
    """The delay by least squares on the rows, and what was said of them."""
    log = read_log(row_sources(files, choice, ["uav"], poses=False), ["uav"], choice.columns,
                   needs_ranging=False, origin=choice.origin)  # fmt: skip
    antenna, velocity = log.stages[0].antenna_m, log.stages[0].velocity_mps
    assert antenna is not None
    return -np.sum((antenna - log.truth_m) * velocity) / np.sum(velocity**2), log.notes


@pytest.mark.parametrize("axes", ["ned", "enu"])
def test_axes_that_no_file_tells_are_those_that_fit_the_globe(tmp_path: Path, axes: str) -> None:
    """A TUM trajectory in either frame against fixes in WGS 84: the same delay, and it is said."""
    fixes = made.write_pos(tmp_path / "gnss.pos", FIXES)
    place = TRUTH.place if axes == "ned" else TO_ENU.apply(TRUTH.place)
    rows = [f"{t // 10**9}.{t % 10**9:09d} {x:.9f} {y:.9f} {z:.9f} 0 0 0 1"
            for t, (x, y, z) in zip(TRUTH.stamp_ns.tolist(), place, strict=True)]  # fmt: skip
    reference = tmp_path / "ref.txt"
    reference.write_text("\n".join(rows) + "\n")
    origin = (math.radians(ORIGIN[0]), math.radians(ORIGIN[1]), ORIGIN[2])
    late_s, notes = rows_of([fixes, reference], LogChoice.model_construct(origin=origin))
    assert late_s == pytest.approx(LATE_S, abs=1e-3)
    assert any("taken as the latter (log: {frame: ned})" in n for n in notes) == (axes == "ned")


def test_the_proposed_block_holds_the_axes_that_the_globe_showed(tmp_path: Path) -> None:
    """What is proposed gives the rows that were tried, and not those of the axes first assumed."""
    fixes = made.write_pos(tmp_path / "gnss.pos", FIXES)
    rows = [f"{t // 10**9}.{t % 10**9:09d} {x:.9f} {y:.9f} {z:.9f} 0 0 0 1"
            for t, (x, y, z) in zip(TRUTH.stamp_ns.tolist(), TRUTH.place, strict=True)]  # fmt: skip
    reference = tmp_path / "ref.txt"
    reference.write_text("\n".join(rows) + "\n")
    origin = (math.radians(ORIGIN[0]), math.radians(ORIGIN[1]), ORIGIN[2])
    choice = LogChoice.model_construct(origin=origin)
    frame = inspect_logs([fixes, reference], choice).proposal.log.frame
    assert frame == "ned"
    late_s, _ = rows_of([fixes, reference], choice.model_copy(update={"frame": frame}))
    assert late_s == pytest.approx(LATE_S, abs=1e-3)


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("body", ["frd", "flu"])
@pytest.mark.parametrize("axes", ["ned", "enu"])
def test_body_axes_that_no_file_tells_are_those_that_are_upright(
    tmp_path: Path, axes: str, body: str, told: bool
) -> None:
    """Whatever frame the globe shows or the spec tells: attitudes are the flown, and it is said."""
    fixes = made.write_pos(tmp_path / "gnss.pos", FIXES)
    place, turn = TRUTH.place, TRUTH.turn
    if axes == "enu":
        place, turn = TO_ENU.apply(place), TO_ENU * turn
    if body == "flu":
        turn = turn * TO_FLU
    rows = [
        f"{t // 10**9}.{t % 10**9:09d} " + " ".join(f"{v:.9f}" for v in (*at, *q))
        for t, at, q in zip(TRUTH.stamp_ns.tolist(), place, turn.as_quat(), strict=True)
    ]
    reference = tmp_path / "ref.txt"
    reference.write_text("\n".join(rows) + "\n")
    origin = (math.radians(ORIGIN[0]), math.radians(ORIGIN[1]), ORIGIN[2])
    known = {"frame": axes} if told else {}
    choice = LogChoice.model_construct(origin=origin, **known)
    log = read_log(row_sources([fixes, reference], choice, ["uav"], poses=False), ["uav"],
                   needs_ranging=False, origin=origin)  # fmt: skip
    base = TRUTH.stamp_ns[0] / 1e9
    flown = Rotation.from_euler("ZYX", log.stages[0].euler_rad[:, ::-1])
    at = np.searchsorted(TRUTH.stamp_ns / 1e9 - base, log.time_s - log.time_s[0])
    apart = (TRUTH.turn[np.clip(at, 0, len(TRUTH) - 1)].inv() * flown).magnitude()
    assert np.median(apart) < math.radians(6.0)  # rows are of other stamps, up to 0.1 s off
    block = inspect_logs([fixes, reference], choice).proposal.log
    assert (block.frame, block.body) == (axes, body)
    assert any(f"(log: {{body: {body}}})" in n for n in log.notes) == (body == "frd")


@pytest.mark.parametrize("told", [None, "utc", "gps"])
def test_the_clock_of_week_seconds_is_the_specs_else_gps_and_said(
    tmp_path: Path, told: str | None
) -> None:
    fixes = made.write_nmea(tmp_path / "gnss.log", FIXES)
    reference = made.write_sbet(tmp_path / "ref.out", TRUTH)
    whole = np.fromfile(reference, dtype="<f8").reshape(-1, 17)
    whole[:, 0] -= 18.0 if told == "utc" else 0.0
    whole.tofile(reference)
    late_s, notes = rows_of([fixes, reference], LogChoice.model_construct(timeline=told))
    assert late_s == pytest.approx(LATE_S, abs=1e-3)
    said = "in UTC, as the spec says" if told == "utc" else "in GPS, as the spec says"
    assert any((said if told else ASSUMED_GPS) in note for note in notes)
    assert any("wander" in note for note in notes)


BESIDE_A_BOOT: dict[str, Callable[[Path], Path]] = {
    "calendar": lambda p: made.write_nmea(p / "gnss.log", FIXES),
    "seconds of the week": lambda p: made.write_sbet(p / "gnss.out", FIXES),
    "another boot": lambda p: write_ulog(p / "late.ulg", FIXES),
}


@pytest.mark.parametrize("beside", BESIDE_A_BOOT)
def test_streams_since_boot_are_made_utc_where_their_file_tells_it(
    tmp_path: Path, beside: str
) -> None:
    """The receiver's own stream, which pairs boot and UTC, plays a part itself."""
    files = [BESIDE_A_BOOT[beside](tmp_path), write_ulog(tmp_path / "flight.ulg", TRUTH)]
    late_s, notes = rows_of(files, LogChoice())
    near_s = 1e-3 if beside != "another boot" else 4e-3  # both in steps of 1e-7 deg
    assert late_s == pytest.approx(LATE_S, abs=near_s)
    assert sum("stamps since boot were made UTC" in note for note in notes) >= 2


@pytest.mark.parametrize("week", [None, 2416])
@pytest.mark.parametrize("wraps", [True, False])
def test_a_week_that_ends_within_the_log_goes_on(
    tmp_path: Path, wraps: bool, week: int | None
) -> None:
    """Seconds of the week begin again or run past 604 800: every row is there, in its order."""
    ends = week_start_ns(2417) - made.LEAPS * SECOND  # as UTC's calendar reads
    shift = ends - 20 * SECOND - int(TRUTH.stamp_ns[0])
    moved = [replace(one, stamp_ns=one.stamp_ns + shift) for one in (FIXES, TRUTH)]
    fixes = made.write_nmea(tmp_path / "gnss.log", moved[0])
    reference = made.write_sbet(tmp_path / "ref.out", moved[1])
    whole = np.fromfile(reference, dtype="<f8").reshape(-1, 17)
    assert whole[-1, 0] < whole[0, 0]
    if not wraps:
        whole[:, 0] += 604_800.0 * (whole[:, 0] < whole[0, 0])
    whole.tofile(reference)
    choice = LogChoice.model_construct(gps_week=week)
    read = read_log(row_sources([fixes, reference], choice, ["uav"], poses=False), ["uav"],
                    needs_ranging=False)  # fmt: skip
    assert len(read) > 440
    late_s, notes = rows_of([fixes, reference], choice)
    assert late_s == pytest.approx(LATE_S, abs=1e-3)
    assert any("into the next week" in note for note in notes) == wraps


@pytest.mark.parametrize("rates", ["about the vertical", "not filled in"])
def test_a_level_trajectory_contradicts_no_rates(tmp_path: Path, rates: str) -> None:
    """Roll and pitch of exactly 0, and rates of 0 beside the vertical one, or all of them."""
    fixes = made.write_nmea(tmp_path / "gnss.log", FIXES)
    reference = made.write_sbet(tmp_path / "ref.out", TRUTH)
    whole = np.fromfile(reference, dtype="<f8").reshape(-1, 17)
    whole[:, 7:9] = whole[:, 14:17] = 0.0
    if rates == "about the vertical":
        whole[:, 16] = np.gradient(np.unwrap(whole[:, 9]), whole[:, 0])
    whole.tofile(reference)
    result = found(tmp_path, fixes, reference)
    assert "rate_columns" not in [check.code for check in result.checks]
    value, sigma = latency(result)
    assert abs(value - LATE_S) < 4.0 * sigma
    said = any("rates are zero throughout" in note for note in result.log.notes)
    assert said == (rates == "not filled in")


def truth_table(path: Path) -> Path:
    """Places and attitudes of the truth under names of its own."""
    euler = np.degrees(TRUTH.turn.as_euler("ZYX"))[:, ::-1]
    rows = ["when,n,e,d,phi,theta,psi"]
    for t, place, turn in zip(TRUTH.stamp_ns.tolist(), TRUTH.place, euler, strict=True):
        figures = ",".join(f"{v:.9f}" for v in (*place, *turn))
        rows.append(f"{t // 10**9}.{t % 10**9:09d},{figures}")
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return path


MAPPED = {
    "time_s": "when", "reference_north_m": "n", "reference_east_m": "e", "reference_down_m": "d",
    "roll_deg": "phi", "pitch_deg": "theta", "yaw_deg": "psi",
}  # fmt: skip


@pytest.mark.parametrize("name", ["truth", "truth.csv"])
def test_a_mapped_table_may_be_named_beside_a_recording(tmp_path: Path, name: str) -> None:
    files = [made.write_pos(tmp_path / "gnss.pos", FIXES), truth_table(tmp_path / "truth.csv")]
    lat, lon, height = ORIGIN
    origin = [f"{lat} deg", f"{lon} deg", f"{height} m"]
    said = {"columns": MAPPED, "origin": origin, "timeline": "utc"}
    plain = rows_of(files, LogChoice.model_validate(said))
    choice = LogChoice.model_validate(said | {"streams": {"reference": name, "position": "gnss"}})
    assert rows_of(files, choice)[0] == plain[0]
    assert plain[0] == pytest.approx(LATE_S, abs=1e-3)
    parts = inspect_logs(files, choice, poses=False, stages=["uav"]).proposal.parts
    assert {"reference", "position", "attitude"} <= {part.role for part in parts}


def test_a_table_named_for_a_part_that_it_does_not_play_is_refused(tmp_path: Path) -> None:
    files = [made.write_pos(tmp_path / "gnss.pos", FIXES), truth_table(tmp_path / "truth.csv")]
    choice = LogChoice.model_validate({"columns": MAPPED, "streams": {"ranging": "truth"}})
    with pytest.raises(BadInput, match="no columns of a ranging"):
        row_sources(files, choice, ["uav"], poses=False)


def test_an_origin_beside_heights_above_sea_level_alone_is_said(tmp_path: Path) -> None:
    """DataFlash knows no ellipsoid: with an origin above it down is off by the geoid's 47 m."""
    files = [made.write_dataflash(tmp_path / "f.bin", TRUTH, FIXES),
             made.write_tum(tmp_path / "r.tum", TRUTH)]  # fmt: skip
    choice = LogChoice.model_construct(origin=ORIGIN, frame="enu", body="flu")
    sources = row_sources(files, choice, ["uav"], False)
    notes = [note for one in sources for note in one.notes]
    assert [n for n in notes if "so that of the spec's origin is taken" in n]
    beside = [made.write_pos(tmp_path / "f.pos", FIXES), files[1]]
    notes = [n for one in row_sources(beside, choice, ["uav"], False) for n in one.notes]
    assert not [n for n in notes if "so that of the spec's origin is taken" in n]
