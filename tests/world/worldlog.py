"""A log as a field system would have written it, and the spec its owner believes in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from tests.world.bound import Key, all_faults, cramer_rao
from tests.world.estimate import georeference
from tests.world.geodesy import to_geodetic
from tests.world.hidden import Hidden, placed
from tests.world.noise import Noise, disturb
from tests.world.scenarios import Carrier, Scenario
from tests.world.sensing import Reading, as_written, listed_truth, read_all
from tests.world.trajectory import Array

DEGREE = np.pi / 180.0
NED = ("north", "east", "down")
Moments = tuple[Array, Array]  # at which velocities and rates were true
DIGITS = {"_s": 4, "_m": 4, "_deg": 5, "_mps": 3, "_degps": 3, "_id": 0}


@dataclass(frozen=True)
class WorldLog:
    """A log and, kept from whoever diagnoses it, what is true about it."""

    run: Scenario
    effects: tuple[Hidden, ...]
    noise: Noise
    readings: tuple[Reading, ...]
    columns: dict[str, Array]

    @property
    def truth(self) -> tuple[Hidden, ...]:
        """The hidden effects, each with its stage."""
        return placed(self.effects, tuple(carrier.name for carrier in self.run.carriers))

    def cramer_rao(self) -> dict[Key, float]:
        return cramer_rao(self.run, self.effects, self.noise)

    def error(self) -> Array:
        """Estimate minus listed truth (n, 3) of a system that believes its spec."""
        prefix = "reference" if self.run.kind == "position" else "target"
        listed = np.column_stack([self.columns[f"{prefix}_{axis}_m"] for axis in NED])
        return georeference(self.run.carriers, self.readings) - listed

    def to_csv(
        self,
        path: FilePath | str,
        geodetic: tuple[float, float, float] | None = None,
        coarser: int = 0,
    ) -> FilePath:
        """Write the log, with `coarser` digits less of places and angles.

        `geodetic` (latitude, longitude in degrees, height) makes it WGS 84; the origin of the
        local frame is then the first row's position, as who reads the log takes it.
        """
        columns = self.columns if geodetic is None else _in_wgs84(self.columns, geodetic)
        return write_columns(path, columns, coarser)

    def spec_yaml(self, known: Sequence[Hidden] = ()) -> str:
        """The spec: sensors and arms as their owner believes them, everything pinned."""
        return spec_text(self.run, known)


def write_columns(path: FilePath | str, columns: dict[str, Array], coarser: int = 0) -> FilePath:
    """Columns as CSV, each with the digits its unit deserves."""
    texts = [_texts(name, values, coarser) for name, values in columns.items()]
    lines = [",".join(columns)] + [",".join(row) for row in zip(*texts, strict=True)]
    target = FilePath(path)
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return target


def _texts(name: str, values: Array, coarser: int) -> list[str]:
    if name.endswith(("latitude_deg", "longitude_deg")):
        digits = 10
    else:
        ending = max((e for e in DIGITS if name.endswith(e)), key=len)
        digits = DIGITS[ending] - (coarser if ending in ("_m", "_deg") else 0)
    return [f"{value:.{digits}f}" for value in values]


def _in_wgs84(columns: dict[str, Array], origin: tuple[float, float, float]) -> dict[str, Array]:
    """Local places as latitude, longitude and height; everything else as it was."""
    prefix = next(n for n in columns if n.endswith("position_north_m"))[: -len("position_north_m")]
    start = np.array([columns[f"{prefix}position_{axis}_m"][0] for axis in NED])
    result: dict[str, Array] = {}
    for name, values in columns.items():
        if not name.endswith("_north_m"):
            if not name.endswith(("_east_m", "_down_m")):
                result[name] = values
            continue
        stem = name[: -len("north_m")]
        place = np.column_stack([columns[f"{stem}{axis}_m"] for axis in NED]) - start
        shown = stem.removesuffix("position_")
        for key, values_deg in zip(
            ("latitude_deg", "longitude_deg", "height_m"), to_geodetic(place, origin).T, strict=True
        ):
            result[f"{shown}{key}"] = values_deg
    return result


def _columns(
    run: Scenario,
    readings: tuple[Reading, ...],
    listed: Array,
    noise: Noise,
    moved_at: tuple[Moments, ...],
) -> dict[str, Array]:
    rng = np.random.default_rng([run.seed, 41])
    columns: dict[str, Array] = {"time_s": run.stamps_s}
    for carrier, reading, at in zip(run.carriers, readings, moved_at, strict=True):
        prefix = f"{carrier.name}_" if len(run.carriers) > 1 else ""
        columns |= {f"{prefix}{k}": v for k, v in _stage(carrier, reading, noise, rng, at).items()}
    stem = "reference" if run.kind == "position" else "target"
    for axis, values in zip(NED, listed.T, strict=True):
        columns[f"{stem}_{axis}_m"] = values
    if run.kind == "georeference":
        columns["target_id"] = run.sighted.astype(np.float64)
    return columns


def _stage(
    carrier: Carrier, reading: Reading, noise: Noise, rng: np.random.Generator, moved_at: Moments
) -> dict[str, Array]:
    columns: dict[str, Array] = {}
    if reading.antenna_m is not None:
        for axis, values in zip(NED, reading.antenna_m.T, strict=True):
            columns[f"position_{axis}_m"] = values
    yaw, pitch, roll = reading.euler_rad.T
    columns["roll_deg"] = roll / DEGREE
    columns["pitch_deg"] = pitch / DEGREE
    columns["yaw_deg"] = np.angle(np.exp(1j * yaw)) / DEGREE
    velocity_at, rate_at = moved_at
    velocity = carrier.path.velocity(velocity_at)
    velocity = velocity + noise.velocity_mps * rng.standard_normal(velocity.shape)
    for axis, values in zip(NED, velocity.T, strict=True):
        columns[f"velocity_{axis}_mps"] = values
    rate = carrier.path.body_rate(rate_at)
    rate = rate + noise.rate_radps * rng.standard_normal(rate.shape)
    for axis, values in zip("xyz", rate.T, strict=True):
        columns[f"rate_{axis}_degps"] = values / DEGREE
    if reading.polar is not None:
        columns["range_m"] = reading.polar[:, 0]
        columns["azimuth_deg"] = np.angle(np.exp(1j * reading.polar[:, 1])) / DEGREE
        columns["elevation_deg"] = reading.polar[:, 2] / DEGREE
    return columns


def make_log(
    run: Scenario,
    effects: Sequence[Hidden] = (),
    noise: Noise | None = None,
    *,
    shared_stamps: bool = False,
) -> WorldLog:
    """Drive the run with the hidden effects in place and write down what the sensors say.

    shared_stamps: velocities are as old as the places, rates as the attitudes; else both are true.
    """
    noise = noise or Noise()
    faults = all_faults(run, tuple(effects))
    clean = read_all(run, faults)
    readings = tuple(
        as_written(disturb(run, stage, reading, fault, noise), fault)
        for stage, (reading, fault) in enumerate(zip(clean, faults, strict=True))
    )
    listed = listed_truth(run, faults[-1])
    if run.kind == "position" and noise.reference_m > 0.0:
        rng = np.random.default_rng([run.seed, 43])
        listed = listed + noise.reference_m * rng.standard_normal(listed.shape)
    true = run.stamps_s
    moved_at = tuple(
        (true - one.age_of("position", true), true - one.age_of("attitude", true))
        if shared_stamps
        else (true, true)
        for one in faults
    )
    columns = _columns(run, readings, listed, noise, moved_at)
    return WorldLog(run, tuple(effects), noise, readings, columns)


def _lengths(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:.6g} m" for value in values) + "]"


def _angles(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value / DEGREE:.6g} deg" for value in values) + "]"


def _role(role: str, sensor: str, arm: Sequence[float] | None) -> list[str]:
    error = "{error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
    lines = [
        f"    {role}:",
        f"      sensor: {{{sensor}, primitives: [pps]}}",
        "      primitive: pps",
        f"      timestamping: {error}",
    ]
    return lines if arm is None else [*lines, f"      lever_arm: {_lengths(arm)}"]


def _stage_lines(carrier: Carrier, georeferences: bool) -> list[str]:
    sensors = carrier.sensors
    arm = sensors.antenna_arm_m
    platform = (
        f"{{v_max: {carrier.v_max_mps:.6g} m/s, "
        f"omega_max: {carrier.omega_max_radps / DEGREE:.6g} deg/s, "
        f"distance: {carrier.distance_m:.6g} m, baseline: {float(np.linalg.norm(arm)):.4g} m}}"
    )
    lines = [f"  - name: {carrier.name}", f"    platform: {platform}"]
    if sensors.position_m is not None:
        text = f"modality: position, type: gnss, sigma_position: {_lengths(sensors.position_m)}"
        lines += _role("position", text, arm)
    else:
        lines += ["    position:", f"      lever_arm: {_lengths(arm)}"]
    if georeferences and sensors.attitude_rad is not None and sensors.ranging is not None:
        text = f"modality: attitude, type: ins, sigma_attitude: {_angles(sensors.attitude_rad)}"
        lines += _role("attitude", text, None)
        text = (
            f"modality: ranging, type: {sensors.ranging_type}, "
            f"sigma_range: {sensors.ranging[0]:.6g} m, "
            f"sigma_bearing: {_angles(sensors.ranging[1:])}"
        )
        lines += _role("ranging", text, sensors.ranging_arm_m)
    return lines


def spec_text(run: Scenario, known: Sequence[Hidden] = (), limit_m: float = 1.0) -> str:
    """The YAML of a spec that matches a run's sensors, with the known effects listed."""
    lines = [
        "syncline: 1",
        f"name: {run.name.replace('_', ' ')}",
        "requirements:",
        f"  - {{id: ACC-1, kind: accuracy, limit: {limit_m:g} m}}",
        "stages:",
    ]
    for carrier in run.carriers:
        lines += _stage_lines(carrier, run.kind == "georeference")
    if known:
        lines.append("effects:")
    for effect in placed(tuple(known), tuple(carrier.name for carrier in run.carriers)):
        values = ", ".join(f"{name}: {value}" for name, value in effect.parameters)
        lines.append(
            f"  - {{effect: {effect.effect}, sensor: {effect.sensor}, stage: {effect.stage}, "
            f"parameters: {{{values}}}}}"
        )
    return "\n".join(lines) + "\n"
