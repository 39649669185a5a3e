"""Trajectories, the text, and what bad input of the simulator ends in."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from syncline_design.machine.input_files import FileContent
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR, Constant, Empirical, Normal, TimingError, Uniform
from syncline_design.report import numbers
from syncline_design.report.on_simulation import GRID_COLUMNS, grid_csv, on_simulation
from syncline_design.report.render_console import console
from syncline_design.simulation import (
    Simulation,
    SimulationError,
    SimulationSettings,
    cross_check,
    sample_errors,
    simulate,
)
from syncline_design.simulation.trajectory import (
    MANOEUVRES,
    _file_track,
    _manoeuvre_track,
    rotation_log,
)
from tests.simulation_systems import altered, fixed_wing, position_only, sensor, survey

PLATFORM = Platform(20.0, 0.5, 100.0)


def quiet(position_mu_s: float = 0.0, attitude_mu_s: float = 0.0, d: float = 100.0) -> System:
    """No noise; constant timestamp errors against the ranging sensor."""
    timing = {"position": position_mu_s, "attitude": attitude_mu_s, "ranging": 0.0}
    roles = [
        Sensor(role, role, (0.0,) * 3, TimingError(Constant(mu)))  # type: ignore[arg-type]
        for role, mu in timing.items()
    ]
    return System((Stage("s", "s", dataclasses.replace(PLATFORM, distance_m=d), *roles),))


def settings(trajectory: str | Path, samples: int = 2000, **more) -> SimulationSettings:
    return SimulationSettings(samples, envelope="trajectory", trajectory=trajectory, **more)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_manoeuvres_keep_speed_and_reach_the_rate(name: str) -> None:
    track = _manoeuvre_track(PLATFORM, name, 0.3)
    times = np.linspace(track.time_s[0], track.time_s[-1], 4001)
    speed = np.linalg.norm(track.position(times, 1), axis=1)
    np.testing.assert_allclose(speed, 20.0, rtol=2e-3)  # a lawnmower's corner is cut by the cubic
    assert np.median(np.abs(speed - 20.0)) < 1e-7
    rate = track.rate(times)
    assert np.abs(rate).max() == pytest.approx(0.0 if name == "straight" else 0.5, rel=1e-4)
    np.testing.assert_array_equal(rate[:, :2], 0.0)
    # the body looks where it goes
    ahead = np.einsum(
        "nij,nj->ni", np.swapaxes(track.attitude(times), 1, 2), track.position(times, 1)
    )
    assert np.median(np.abs(ahead[:, 1])) < 1e-4


def test_circle_and_figure_eight_close() -> None:
    for name in ("circle", "figure_eight"):
        track = _manoeuvre_track(PLATFORM, name, 0.0)
        gap = track.position_m[-1] - track.position_m[0]
        np.testing.assert_allclose(gap, 0.0, atol=1e-6)


def test_lawnmower_comes_back_to_its_heading() -> None:
    track = _manoeuvre_track(PLATFORM, "lawnmower", 0.0)
    np.testing.assert_allclose(track.rotation[0], track.rotation[-1], atol=1e-12)
    assert abs(track.position_m[-1, 0]) < 1e-6  # legs north and south of equal length
    assert track.position_m[-1, 1] == pytest.approx(4 * 20.0 / 0.5, rel=1e-6)  # two diameters


def test_circle_is_the_constant_twist() -> None:
    """Position late by half a second on a circle: the chord 2 (v/w) sin(w s / 2)."""
    errors = sample_errors(quiet(position_mu_s=-0.5), settings("circle"))
    chord = 2 * 40.0 * math.sin(0.5 * 0.5 * 0.5)
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), chord, rtol=1e-9)


def test_straight_flight_has_no_attitude_error() -> None:
    errors = sample_errors(quiet(attitude_mu_s=0.4), settings("straight"))
    assert np.abs(errors).max() < 1e-12
    moved = sample_errors(quiet(position_mu_s=0.4), settings("straight"))
    np.testing.assert_allclose(moved, np.tile([8.0, 0.0, 0.0], (2000, 1)), atol=1e-9)


def test_attitude_late_on_a_circle_turns_the_line_of_sight() -> None:
    """Late by s: chord 2 d sin(w s / 2) times the sine of the angle to the vertical."""
    errors = sample_errors(quiet(attitude_mu_s=-0.2), settings("circle", 20_000))
    share = np.linalg.norm(errors, axis=1) / (2 * 100.0 * math.sin(0.05))
    # isotropic: P(sin <= x) = 1 - sqrt(1 - x^2); Kolmogorov-Smirnov at level 1e-4
    assert stats.kstest(share, lambda x: 1 - np.sqrt(np.clip(1 - x * x, 0, 1))).pvalue > 1e-4


def test_trajectory_is_the_default_manoeuvre_when_none_is_given() -> None:
    plain = sample_errors(quiet(0.1), SimulationSettings(100, envelope="trajectory"))
    named = sample_errors(quiet(0.1), settings("figure_eight", 100))
    np.testing.assert_array_equal(plain, named)


def write_track(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(map(repr, map(float, c)) for c in columns.values()), strict=True))
    return path


def circle_columns(rows: int = 400, step_s: float = 0.05) -> dict[str, np.ndarray]:
    time = np.arange(rows) * step_s
    yaw = 0.5 * time
    return {
        "time_s": time,
        "position_north_m": 40.0 * np.sin(yaw),
        "position_east_m": -40.0 * np.cos(yaw),
        "position_down_m": np.zeros(rows),
        "roll_deg": np.zeros(rows),
        "pitch_deg": np.zeros(rows),
        "yaw_deg": np.degrees(yaw),
    }


def test_a_file_of_a_circle_gives_the_circle(tmp_path: Path) -> None:
    path = write_track(tmp_path / "circle.csv", circle_columns())
    errors = sample_errors(quiet(position_mu_s=-0.5), settings(path))
    chord = 2 * 40.0 * math.sin(0.125)
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), chord, rtol=1e-3)
    both = sample_errors(quiet(attitude_mu_s=-0.2), settings(path))
    assert np.linalg.norm(both, axis=1).max() <= 200.0 * math.sin(0.05) * (1 + 1e-9)


def test_units_and_sight_of_a_file(tmp_path: Path) -> None:
    """Milliseconds, millimetres, radians; range 10 m straight down instead of the platform's d."""
    columns = circle_columns()
    changed = {
        "time_ms": columns["time_s"] * 1e3,
        **{f"position_{a}_mm": columns[f"position_{a}_m"] * 1e3 for a in ("north", "east", "down")},
        "roll_rad": columns["roll_deg"],
        "pitch_rad": columns["pitch_deg"],
        "yaw_rad": np.radians(columns["yaw_deg"]),
        "range_m": np.full(400, 10.0),
        "azimuth_deg": np.zeros(400),
        "elevation_deg": np.zeros(400),
    }
    path = write_track(tmp_path / "track.csv", changed)
    errors = sample_errors(quiet(attitude_mu_s=0.2), settings(path))
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), 20.0 * math.sin(0.05), rtol=1e-9)


def test_a_chain_s_file_has_the_stages_names(tmp_path: Path) -> None:
    columns = circle_columns()
    both = {"time_s": columns["time_s"]}
    for stage in ("vessel", "auv"):
        both |= {f"{stage}_{name}": c for name, c in columns.items() if name != "time_s"}
    path = write_track(tmp_path / "chain.csv", both)
    assert np.all(np.isfinite(sample_errors(survey(), settings(path))))
    with pytest.raises(SimulationError, match="expected a column vessel_position_north_m"):
        sample_errors(survey(), settings(write_track(tmp_path / "other.csv", columns)))


def test_track_interpolates_attitude_like_scipy_slerp(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    columns = circle_columns(20)
    columns |= {n: np.cumsum(rng.normal(size=20) * 5) for n in ("roll_deg", "pitch_deg", "yaw_deg")}
    path = write_track(tmp_path / "rough.csv", columns)
    track = _file_track(FileContent(path, path.read_bytes()), "")
    from scipy.spatial.transform import Slerp

    angles = np.stack([columns[n] for n in ("yaw_deg", "pitch_deg", "roll_deg")], axis=-1)
    slerp = Slerp(columns["time_s"], Rotation.from_euler("ZYX", angles, degrees=True))
    times = np.linspace(0, columns["time_s"][-1], 333)
    np.testing.assert_allclose(track.attitude(times), slerp(times).as_matrix(), atol=1e-12)
    # position, velocity and acceleration belong together: central differences
    h = 1e-5
    inner = times[(times > h) & (np.abs((times / 0.05) % 1 - 0.5) < 0.45)]
    for order in (0, 1):
        ahead, back = track.position(inner + h, order), track.position(inner - h, order)
        slope = (ahead - back) / (2 * h)
        np.testing.assert_allclose(track.position(inner, order + 1), slope, atol=1e-3, rtol=1e-5)


def test_rotation_log_against_scipy() -> None:
    rng = np.random.default_rng(2)
    vectors = rng.normal(size=(60, 3))
    sizes = np.concatenate([np.logspace(-13, 0, 40), np.linspace(1.0, 3.1, 20)])
    vectors *= (sizes / np.linalg.norm(vectors, axis=1))[:, None]
    found = rotation_log(Rotation.from_rotvec(vectors).as_matrix())
    np.testing.assert_allclose(found, vectors, atol=1e-12)


def test_effects_act_along_a_trajectory() -> None:
    """GNSS 0.1 s late on a straight line at 20 m/s: 2 m behind, in every row."""
    entry = EffectEntry("latency", "position", "s", (("latency_s", 0.1),))
    system = dataclasses.replace(quiet(), effects=(entry,))
    errors = sample_errors(system, settings("straight", 100))
    np.testing.assert_allclose(errors, np.tile([-2.0, 0.0, 0.0], (100, 1)), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty file"),
        ("time_s\n1\n2\n", "expected a column position_north_m"),
        ("time_s,position_north_m\n1,2\n2\n", ":3: expected 2 cells"),
        ("time_s,position_north_m\n1,2\n\n2,x\n", ":4: position_north_m: expected a number"),
        ("time_s\n1\nnan\n", ":3: time_s: expected a number"),
        ("time_s\n1\n1\n", "rising time"),
        ("time_s\n1\n", "at least two rows"),
    ],
)
def test_bad_trajectory_files(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(SimulationError, match=says):
        sample_errors(quiet(), settings(path))


def test_trajectories_that_cannot_be_followed(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="expected a CSV file or one of straight, circle"):
        sample_errors(quiet(), settings("spiral"))
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(SimulationError, match="UTF-8"):
        sample_errors(quiet(), settings(binary))
    short = write_track(tmp_path / "short.csv", circle_columns(5))
    with pytest.raises(SimulationError, match=r"lasts 0\.2 s, expected more than 1 s"):
        sample_errors(quiet(position_mu_s=0.5), settings(short))
    columns = circle_columns(20)
    columns["yaw_deg"] = np.where(np.arange(20) == 7, 100.0, 0.0)
    jump = write_track(tmp_path / "jump.csv", columns)
    with pytest.raises(SimulationError, match=r"jump.csv:9: the attitude turns by 100 deg"):
        sample_errors(quiet(), settings(jump))


def changed_sensor(system: System, role: str, **changes) -> System:
    stage = system.stages[0]
    altered_sensor = dataclasses.replace(getattr(stage, role), **changes)
    return dataclasses.replace(
        system, stages=(dataclasses.replace(stage, **{role: altered_sensor}), *system.stages[1:])
    )


BAD_SYSTEMS = [
    (System(()), "stages: expected at least one stage"),
    (altered(fixed_wing(), v_max_mps=math.nan), r"uav.platform.v_max: expected .*, found nan"),
    (altered(fixed_wing(), omega_max_radps=math.inf), "omega_max: expected a finite"),
    (altered(fixed_wing(), v_max_mps=-1.0), "v_max: expected"),
    (changed_sensor(fixed_wing(), "ranging", lever_arm_m=(0.0, math.nan, 0.0)), "finite lengths"),
    (changed_sensor(fixed_wing(), "position", sigma=(0.1, -0.1, 0.1)), "standard deviations"),
    (fixed_wing(Empirical(())), "at least one value"),
    (fixed_wing(Empirical((0.0, math.nan))), "a number as value 2"),
    (fixed_wing(Empirical((0.0, "x"))), "a number as value 2"),  # type: ignore[arg-type]
    (fixed_wing(Uniform(1.0, -1.0)), "low <= high"),
    (fixed_wing(Normal(0.0, -1.0)), "std >= 0"),
    (fixed_wing(Constant(math.inf)), "finite constant"),
    (
        changed_sensor(fixed_wing(), "position", timing=TimingError(Constant(0.0), -1.0)),
        "calibrated remainder",
    ),
    (
        dataclasses.replace(
            fixed_wing(), clock_offsets=(("host:x", TimingError(Normal(0.0, math.nan))),)
        ),
        r"clock_offsets.host:x",
    ),
    (
        System((dataclasses.replace(fixed_wing().stages[0], attitude=None),)),
        "an attitude sensor to aim",
    ),
    (
        System((dataclasses.replace(fixed_wing().stages[0], position=None),)),
        "a position sensor in the first stage",
    ),
    (System((survey().stages[0], fixed_wing().stages[0])), "no position sensor after the first"),
    (
        System((position_only().stages[0], survey().stages[1])),
        "a ranging sensor in every stage",
    ),
]


@pytest.mark.parametrize(("system", "says"), BAD_SYSTEMS, ids=[s for _, s in BAD_SYSTEMS])
def test_systems_that_cannot_be_simulated(system: System, says: str) -> None:
    for run in (cross_check, sample_errors):
        with pytest.raises(SimulationError, match=says):
            run(system, SimulationSettings(samples=10))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"samples": 0}, "samples: expected a whole number of at least 1, found 0"),
        ({"samples": -5}, "samples"),
        ({"samples": 1e5}, "samples"),
        ({"samples": True}, "samples"),
        ({"seed": -1}, "seed"),
        ({"workers": 0}, "workers"),
        ({"envelope": "maximal"}, "envelope: expected one of limits, inside, trajectory"),
        ({"envelope": math.nan}, "envelope"),
        ({"quantiles": (0.5, 1.0)}, "quantiles"),
        ({"quantiles": (math.nan,)}, "quantiles"),
        ({"confidence": 1.0}, "confidence"),
        ({"limit_m": math.nan}, "limit_m"),
        ({"limit_m": -1.0}, "limit_m"),
        ({"tau_grid_s": (0.0, -1.0)}, "tau_grid_s"),
        ({"tau_grid_s": (math.inf,)}, "tau_grid_s"),
    ],
)
def test_settings_that_make_no_sense(changes: dict[str, object], says: str) -> None:
    with pytest.raises(SimulationError, match=says):
        SimulationSettings(**changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (EffectEntry("gremlins", "position", "uav", ()), "effect: expected one of .*latency"),
        (EffectEntry("latency", "position", "usv", (("latency_s", 1.0),)), "stage: expected one"),
        (
            EffectEntry("range_bias", "position", "uav", (("bias_m", 1.0),)),
            "sensor: expected ranging, found position",
        ),
        (EffectEntry("latency", "position", "uav", ()), "parameters: missing parameter latency_s"),
        (
            EffectEntry("frame_convention", "attitude", "uav", (("convention", "upside_down"),)),
            "convention: expected one of .*, found upside_down",
        ),
        (
            EffectEntry("frame_convention", "ranging", "uav", (("convention", "transposed"),)),
            r"parameters.convention: expected one of azimuth_sign, .*, found transposed",
        ),
    ],
)
def test_effects_that_do_not_fit(entry: EffectEntry, says: str) -> None:
    system = dataclasses.replace(fixed_wing(), effects=(entry,))
    with pytest.raises(SimulationError, match=says):
        sample_errors(system, SimulationSettings(samples=10))


def told(result: Simulation, system: System) -> str:
    """The console's text, its columns and lines closed up."""
    return " ".join(console(on_simulation(result, system)).split())


def test_summary_says_what_was_found() -> None:
    system = fixed_wing()
    result = simulate(
        system, SimulationSettings(samples=3000, limit_m=0.05, tau_grid_s=(1e-5, 1.0))
    )
    text = told(result, system)
    worst = result.monte_carlo.worst_case
    for part in (
        "Samples 3 000",
        "Seed 0",
        f"95 % {numbers.length(result.monte_carlo.quantile(0.95).value_m)}",
        "Within the limit of 50 mm",
        f"{numbers.percent(worst.ratio_to_syncline, 4)} of the Syncline's",
        "do not contradict the Syncline",
        "range noise acts along the line of sight",
        "a turn moves the object along a chord",
    ):
        assert part.replace("\u00a0", " ") in text
    entry = EffectEntry("range_bias", "ranging", "uav", (("bias_m", 1.0),))
    acting = told(result, dataclasses.replace(system, effects=(entry,)))
    assert "range_bias of the ranging sensor" in acting


def test_summary_says_when_the_ratio_never_leaves_one() -> None:
    result = simulate(survey(), SimulationSettings(samples=500, tau_grid_s=(1e-5, 1e-3)))
    assert "within 2 % of the Syncline over the whole grid" in told(result, survey())


def test_trajectory_is_named_in_text_and_json() -> None:
    result = simulate(fixed_wing(), settings("circle", 500, tau_grid_s=(1e-4,)))
    assert "the Syncline, along circle." in told(result, fixed_wing())
    assert result.to_json()["trajectory"] == "circle"


def test_grid_as_csv() -> None:
    result = simulate(fixed_wing(), SimulationSettings(samples=100, tau_grid_s=(0.0, 1e-3)))
    text = grid_csv(result)
    rows = list(csv.DictReader(io.StringIO(text)))
    assert text.splitlines()[0] == ",".join(GRID_COLUMNS)
    assert [float(r["tau_s"]) for r in rows] == [0.0, 1e-3]
    assert float(rows[1]["worst_case_m"]) == result.grid[1].worst_case_m
    assert rows[0]["reason"] == result.grid[0].reason


def test_a_sensor_on_utc_ignores_host_clocks() -> None:
    """Everything on UTC: a clock offset of the host changes nothing."""
    stage = fixed_wing(Constant(0.0)).stages[0]
    roles = {
        r: dataclasses.replace(getattr(stage, r), timeline="utc", timing=NO_ERROR)
        for r in ("position", "attitude", "ranging")
    }
    clock = (("host:uav", TimingError(Constant(3.0))),)
    with_clock = System((dataclasses.replace(stage, **roles),), clock_offsets=clock)
    without = dataclasses.replace(with_clock, clock_offsets=())
    np.testing.assert_array_equal(
        sample_errors(with_clock, SimulationSettings(samples=200)),
        sample_errors(without, SimulationSettings(samples=200)),
    )
    assert sensor("position", (1.0,) * 3).timeline == "host:vehicle"
