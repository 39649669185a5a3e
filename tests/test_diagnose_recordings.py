"""One flight with one hidden delay in every format: the same finding from each.

The receiver's positions are 80 ms older than their stamps, with 2 cm of white noise; the reference
is exact.  The tables in NED that the package has always read are the oracle of the bags.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import Diagnosis, DiagnosisSettings, diagnose
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice
from tests.flat_flight_logs import write_sbet
from tests.flight_logs import Flight, flight, write_mcap, write_ros1, write_ros2, write_ulog

LATE_S, NOISE_M = 0.08, 0.02
TRUTH = flight(45.0)
FIXES = flight(45.0, late_s=LATE_S, noise_m=NOISE_M)
SPEC = """syncline: 1
name: flight
requirements: [{{id: ACC-1, kind: accuracy, limit: 30 cm}}]
stages:
  - name: uav
    platform: {{v_max: 20 m/s, omega_max: 90 deg/s, distance: 40 m, baseline: 0.5 m}}
    position:
      sensor: {{modality: position, type: gnss, sigma_position: 2 cm, primitives: [pps]}}
      primitive: pps
      timestamping: {{error: {{distribution: uniform, low: -1 us, high: 1 us}}}}
{more}"""
ATTITUDE = """    attitude:
      sensor: {modality: attitude, type: ins, sigma_attitude: 0.05 deg, primitives: [pps]}
      primitive: pps
      timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}
"""
WRITERS: dict[str, Callable[[Path], Path]] = {
    "ros1": lambda p: write_ros1(p / "a.bag", TRUTH, fixes=FIXES),
    "ros2": lambda p: write_ros2(p / "bag", TRUTH, fixes=FIXES),
    "mcap": lambda p: write_mcap(p / "a.mcap", TRUTH, fixes=FIXES),
    "ulog": lambda p: write_ulog(p / "a.ulg", TRUTH, FIXES),
}


def spec(folder: Path, more: str = "", **keys: str) -> Path:
    path = folder / "spec.yaml"
    log = "".join(f"log: {value}\n" for value in keys.values())
    path.write_text(SPEC.format(more=more) + log, "utf-8")
    return path


def found(folder: Path, *files: Path, more: str = "", log: str = "") -> Diagnosis:
    keys = {"log": log} if log else {}
    return diagnose(spec(folder, more, **keys), files, DiagnosisSettings(seed=1))


def latency(result: Diagnosis, sensor: str = "position") -> tuple[float, float]:
    (one,) = [f for f in result.findings if (f.effect, f.sensor) == ("latency", sensor)]
    figure = one.parameters["latency_s"]
    assert figure.standard_uncertainty is not None
    return figure.value, figure.standard_uncertainty


def table(path: Path, tested: Flight, truth: Flight) -> Path:
    """The package's own columns, local, on one frame."""
    euler = truth.turn.as_euler("ZYX")[:, ::-1]
    since = (truth.stamp_ns - truth.stamp_ns[0]) / 1e9
    columns = {
        "time_s": since,
        **{f"position_{a}_m": tested.place[:, k] for k, a in enumerate(("north", "east", "down"))},
        **{f"reference_{a}_m": truth.place[:, k] for k, a in enumerate(("north", "east", "down"))},
        **{f"velocity_{a}_mps": truth.velocity[:, k]
           for k, a in enumerate(("north", "east", "down"))},
        **{f"{a}_rad": euler[:, k] for k, a in enumerate(("roll", "pitch", "yaw"))},
        **{f"rate_{a}_radps": truth.rate[:, k] for k, a in enumerate("xyz")},
    }  # fmt: skip
    np.savetxt(path, np.stack(list(columns.values()), 1), "%.17g", ",", header=",".join(columns),
               comments="")  # fmt: skip
    return path


@pytest.fixture(scope="module")
def oracle(tmp_path_factory: pytest.TempPathFactory) -> tuple[float, float]:
    folder = tmp_path_factory.mktemp("oracle")
    return latency(found(folder, table(folder / "oracle.csv", FIXES, TRUTH)))


@pytest.mark.parametrize("name", ["ros1", "ulog"])
def test_the_same_delay_is_found_as_in_a_table(
    tmp_path: Path, name: str, oracle: tuple[float, float]
) -> None:
    result = found(tmp_path, WRITERS[name](tmp_path))
    value, sigma = latency(result)
    assert abs(value - LATE_S) < 4.0 * sigma
    # the bag's frames are laid onto each other; ULog's places are floats and 1e-7 deg
    assert abs(value - oracle[0]) < 0.6 * oracle[1]
    assert [f.effect for f in result.findings if f.kind == "cause"] == ["latency"]


@pytest.mark.parametrize("name", ["ros2", "mcap"])
def test_every_bag_gives_the_very_same_log(tmp_path: Path, name: str) -> None:
    """Same rows to the last bit, whatever the container: so the findings are the same."""
    one, other = (
        read_log(row_sources([WRITERS[n](tmp_path)], LogChoice(), ["uav"], poses=False), ["uav"],
                 needs_ranging=False)
        for n in ("ros1", name)
    )  # fmt: skip
    assert (one.kind, len(one)) == (other.kind, len(other)) == ("position", len(TRUTH))
    np.testing.assert_array_equal(one.time_s, other.time_s)
    np.testing.assert_array_equal(one.truth_m, other.truth_m)
    for field in ("antenna_m", "euler_rad", "velocity_mps", "rate_radps"):
        np.testing.assert_array_equal(
            getattr(one.stages[0], field), getattr(other.stages[0], field)
        )


def test_an_origin_in_the_spec_takes_the_place_of_the_fit(
    tmp_path: Path, oracle: tuple[float, float]
) -> None:
    """With the frame's origin known nothing is laid onto anything: within a tenth of sigma."""
    place = "{origin: [47.3 deg, 8.55 deg, 460 m]}"
    result = found(tmp_path, WRITERS["ros1"](tmp_path), log=place)
    assert abs(latency(result)[0] - oracle[0]) < 0.1 * oracle[1]
    assert not any("shifted by" in note for note in result.log.notes)


def test_streams_that_the_spec_names_go_first(tmp_path: Path) -> None:
    """The other way round: a reference as noisy as this names no second cause."""
    path = WRITERS["mcap"](tmp_path)
    result = found(tmp_path, path, log="{streams: {position: /odom, reference: /fix}}")
    value, sigma = latency(result)
    assert abs(value + LATE_S) < 4.0 * sigma
    assert [f.effect for f in result.findings if f.kind == "cause"] == ["latency"]


@pytest.mark.parametrize(
    ("log", "message"),
    [
        ("{streams: {position: /fixx}}", "no stream '/fixx'"),
        ("{streams: {attitude: /fix}}", "/fix holds no attitude"),
        ("{streams: {ranging: /imu}}", "/imu holds no ranging"),
    ],
)
def test_a_stream_that_does_not_fit_is_refused(tmp_path: Path, log: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        found(tmp_path, WRITERS["ros1"](tmp_path), log=log)


def tum(path: Path, made: Flight, turn_rad: float = 0.0) -> Path:
    """TUM: seconds, place and quaternion x, y, z, w in a frame with z up, turned about it."""
    from scipy.spatial.transform import Rotation

    from tests.flight_logs import TO_ENU, ros_quaternion

    turn = Rotation.from_rotvec([0.0, 0.0, turn_rad])
    place = turn.apply(TO_ENU.apply(made.place))
    q = (turn * Rotation.from_quat(ros_quaternion(made.turn))).as_quat()
    rows = [
        f"{ns // 10**9}.{ns % 10**9:09d} " + " ".join(f"{v:.12f}" for v in (*p, *t))
        for ns, p, t in zip(made.stamp_ns.tolist(), place, q, strict=True)
    ]
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return path


def test_two_trajectories_are_compared_pose_by_pose(tmp_path: Path) -> None:
    """Places and attitudes late together: two files, frames that nothing relates."""
    late = flight(45.0, late_s=LATE_S)
    draw = np.random.default_rng(3)
    late = Flight(late.stamp_ns, late.place + NOISE_M * draw.standard_normal((len(late), 3)),
                  late.velocity, late.turn, late.rate)  # fmt: skip
    files = tum(tmp_path / "slam.txt", late, 0.7), tum(tmp_path / "truth.txt", TRUTH)
    axes = "{frame: enu, body: flu}"
    result = found(tmp_path, *files, more=ATTITUDE, log=axes)
    assert result.log.kind == "pose"
    value, sigma = latency(result)
    assert abs(value - LATE_S) < 5.0 * sigma + 1e-3
    (one,) = [f for f in result.findings if f.kind == "cause"]
    assert one.also == ("attitude",)  # one delay of the whole system, not two
    assert one.sentence.startswith("Position and attitude data are")
    entries = {(e.effect, e.sensor) for e in result.effects_entries()}
    assert entries == {("latency", "position"), ("latency", "attitude")}


def test_poses_late_beside_velocities_of_the_better_system(tmp_path: Path) -> None:
    """A trajectory 40 ms late beside an SBET, and a lever arm in the spec that is none.

    With the arm in it, velocities of the SBET fit the tested places best as an antenna's: they are
    the reference's all the same, and stamped as it is.
    """
    late = flight(60.0, 20.0, late_s=0.04, noise_m=NOISE_M)
    files = tum(tmp_path / "slam.txt", late), write_sbet(tmp_path / "a.out", flight(60.0, 50.0))
    more = "      lever_arm: [0.30 m, 0.05 m, -0.20 m]\n" + ATTITUDE
    axes = "{frame: enu, body: flu, origin: [47.3 deg, 8.55 deg, 460 m]}"
    result = found(tmp_path, *files, more=more, log=axes)
    value, sigma = latency(result)
    assert abs(value - 0.04) < 5.0 * sigma + 1e-3
    causes = {(f.effect, f.sensor): f for f in result.findings if f.kind == "cause"}
    assert set(causes) == {("latency", "position"), ("lever_arm", "position")}
    assert causes["latency", "position"].also == ("attitude",)
    arm = causes["lever_arm", "position"].parameters
    for axis, true_m in zip("xyz", (-0.30, -0.05, 0.20), strict=True):
        (part,) = [v for k, v in arm.items() if k.startswith(axis)]
        assert part.standard_uncertainty is not None
        assert abs(part.value - true_m) < 5.0 * part.standard_uncertainty + 1e-3
    assert not [n for n in result.log.notes if "antenna's" in n or "another clock" in n]


def test_ranges_in_a_table_stand_beside_a_bag(tmp_path: Path) -> None:
    """Position and attitude of a bag, ranges to surveyed targets in a table of the package's."""
    rows = (TRUTH.stamp_ns - 86_400 * 10**9 * (TRUTH.stamp_ns[0] // (86_400 * 10**9))) / 1e9
    targets = np.array([[30.0, 10.0, 0.0], [-20.0, -25.0, 0.0]])[np.arange(len(TRUTH)) % 2]
    body = TRUTH.turn.inv().apply(targets - TRUTH.place)
    length = np.linalg.norm(body, axis=1)
    moments = [
        np.datetime64(int(ns), "ns").astype("datetime64[us]").item().isoformat() + "Z"
        for ns in TRUTH.stamp_ns
    ]
    head = "time,range_m,azimuth_rad,elevation_rad,target_north_m,target_east_m,target_down_m"
    lines = [head] + [
        f"{m},{r:.9f},{np.arctan2(b[1], b[0]):.12f},{-np.arcsin(b[2] / r):.12f},"
        f"{t[0]},{t[1]},{t[2]}"
        for m, r, b, t in zip(moments, length, body, targets, strict=True)
    ]
    table_path = tmp_path / "ranges.csv"
    table_path.write_text("\n".join(lines) + "\n", "utf-8")
    choice = LogChoice.model_validate({"origin": ["47.3 deg", "8.55 deg", "460 m"]})
    sources = row_sources(
        [table_path, write_ros1(tmp_path / "a.bag", TRUTH)], choice, ["uav"], poses=False
    )
    log = read_log(sources, ["uav"], origin=choice.origin)
    assert log.kind == "georeference"
    assert len(log) > 0.98 * len(TRUTH)
    stage = log.stages[0]
    assert stage.antenna_m is not None
    at = np.searchsorted(rows, log.time_s + 1e-6) - 1
    assert np.abs(stage.antenna_m - TRUTH.place[at]).max() < 1e-3


def test_parts_of_one_run_are_one_log(tmp_path: Path) -> None:
    """A bag split in two, given in any order, is the whole bag; two runs at once are not."""

    def part(name: str, made: Flight) -> Path:
        return write_ros1(tmp_path / name, made)

    def cut(rows: slice) -> Flight:
        return Flight(TRUTH.stamp_ns[rows], TRUTH.place[rows], TRUTH.velocity[rows],
                      TRUTH.turn[rows], TRUTH.rate[rows])  # fmt: skip

    choice = LogChoice()
    whole, split = (
        read_log(row_sources(paths, choice, ["uav"], poses=False), ["uav"], needs_ranging=False)
        for paths in (
            [part("whole.bag", TRUTH)],
            [part("b.bag", cut(slice(200, None))), part("a.bag", cut(slice(0, 200)))],
        )
    )
    assert len(split) == len(whole)
    np.testing.assert_array_equal(split.time_s, whole.time_s)
    np.testing.assert_allclose(split.truth_m, whole.truth_m, atol=1e-9)
    assert split.stages[0].antenna_m is not None
    np.testing.assert_allclose(split.stages[0].antenna_m, whole.stages[0].antenna_m, atol=1e-9)
