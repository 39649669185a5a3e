"""Noise that is not the model's: what measured logs have and white noise of the spec's size lacks.

The kinds in AS_MEASURED have the sizes, time constants and tails that were fitted to three measured
sets: a laser robot, motion capture, and a camera on targets.

Every kind is put on the columns of a finished log and stays near the spec's sigma, so that a right
reader of a clean log finds nothing missing.  Slow noise is a sum of cosines of the log's length
with variances falling as 1/k, bounded; heavy noise is Student's t with outliers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.world.noise import Noise, gauss_markov
from tests.world.trajectory import Array
from tests.world.worldlog import WorldLog

DEGREE = np.pi / 180.0
NED = ("north", "east", "down")
WAVES = 60
WHITE = Noise(scale=0.6)  # of the log underneath: leaves room for the foreign part
Columns = dict[str, Array]


def slow(rng: np.random.Generator, rows: int) -> Array:
    """Unit-variance noise whose power falls as 1/f, (rows,)."""
    phase = np.linspace(0.0, np.pi, rows)
    k = np.arange(1, WAVES + 1)
    weights = rng.standard_normal(WAVES) / np.sqrt(k)
    wave = np.cos(phase[:, None] * k + rng.uniform(0, 2 * np.pi, WAVES)) @ weights
    return np.asarray(wave * np.sqrt(2.0 / np.sum(1.0 / k)))


def steps(rng: np.random.Generator, rows: int) -> Array:
    """Levels of unit variance that last for 3 % of the log on average: multipath."""
    jumps = rng.random(rows) < 1.0 / (0.03 * rows)
    jumps[0] = True
    levels = rng.standard_normal(int(jumps.sum()))
    return np.asarray(levels[np.cumsum(jumps) - 1])


def _sigma(log: WorldLog, name: str) -> float:
    """The spec's standard deviation of a column, in the column's unit."""
    sensors = log.run.carriers[0].sensors
    if name.startswith("position"):
        assert sensors.position_m is not None
        return float(sensors.position_m[NED.index(name.split("_")[1])])
    if name in ("roll_deg", "pitch_deg", "yaw_deg") and sensors.attitude_rad is not None:
        index = ("roll_deg", "pitch_deg", "yaw_deg").index(name)
        return float(sensors.attitude_rad[index] / DEGREE)
    if name in RANGING and sensors.ranging is not None:
        index = RANGING.index(name)
        return float(sensors.ranging[index] / (1.0 if index == 0 else DEGREE))
    return 0.0


RANGING = ("range_m", "azimuth_deg", "elevation_deg")
POSITION = tuple(f"position_{axis}_m" for axis in NED)
ATTITUDE = ("roll_deg", "pitch_deg", "yaw_deg")
Maker = Callable[[np.random.Generator, WorldLog], Columns]


def _on(names: tuple[str, ...], share: float, draw: Callable[..., Array]) -> Maker:
    """The same kind of noise on every column named, `share` of its sigma."""

    def made(rng: np.random.Generator, log: WorldLog) -> Columns:
        rows = log.run.stamps_s.size
        return {
            n: log.columns[n] + share * _sigma(log, n) * draw(rng, rows)
            for n in names
            if n in log.columns
        }

    return made


def _heavy(rng: np.random.Generator, rows: int) -> Array:
    drawn = rng.standard_t(3.0, rows) * (rng.random(rows) < 0.98)
    return np.asarray(drawn / np.sqrt(3.0) + 6.0 * rng.standard_normal(rows) * (drawn == 0.0))


def _by_range(rng: np.random.Generator, log: WorldLog) -> Columns:
    """Range and bearing noise that grow with the range."""
    if "range_m" not in log.columns:
        return {}
    grow = (log.columns["range_m"] / np.median(log.columns["range_m"])) ** 2
    rows = grow.size
    return {
        n: log.columns[n] + 0.6 * _sigma(log, n) * grow * rng.standard_normal(rows) for n in RANGING
    }


def _by_speed(rng: np.random.Generator, log: WorldLog) -> Columns:
    speed = np.hypot(log.columns["velocity_north_mps"], log.columns["velocity_east_mps"])
    grow = speed / max(float(np.sqrt(np.mean(speed**2))), 1e-9)
    return {
        n: log.columns[n] + 0.7 * _sigma(log, n) * grow * rng.standard_normal(grow.size)
        for n in POSITION
    }


def _coarse(rng: np.random.Generator, log: WorldLog) -> Columns:
    units = {n: 2.0 * _sigma(log, n) for n in (*POSITION, *RANGING) if n in log.columns}
    return {n: np.round(log.columns[n] / u) * u for n, u in units.items() if u > 0.0}


def _rough_velocity(rng: np.random.Generator, log: WorldLog) -> Columns:
    names = [f"velocity_{axis}_mps" for axis in NED]
    return {n: log.columns[n] + 0.05 * rng.standard_normal(log.columns[n].size) for n in names}


KINDS: dict[str, Maker] = {
    "slow position": _on(POSITION, 0.7, slow),
    "slow attitude": _on(ATTITUDE, 0.7, slow),
    "slow ranging": _on(RANGING, 0.7, slow),
    "multipath steps": _on(POSITION, 0.7, steps),
    "heavy": _on((*POSITION, *RANGING, *ATTITUDE), 0.7, _heavy),
    "by range": _by_range,
    "by speed": _by_speed,
    "coarse": _coarse,
    "rough velocity": _rough_velocity,
    "no motion columns": lambda rng, log: {},
}


def student(freedom: float, outliers: float) -> Callable[..., Array]:
    """Student's t of unit variance, some rows normal and six times as large."""

    def drawn(rng: np.random.Generator, rows: int) -> Array:
        core = rng.standard_t(freedom, rows) / np.sqrt(freedom / (freedom - 2.0))
        struck = rng.random(rows) < outliers
        return np.asarray(np.where(struck, 6.0 * rng.standard_normal(rows), core))

    return drawn


@dataclass(frozen=True)
class Part:
    """Noise on some columns, `share` of their sigma.

    shape: slow, steps, heavy or gm (first-order Gauss-Markov of time_s); freedom, outliers: of
    heavy noise.
    """

    names: tuple[str, ...]
    share: float
    shape: str
    time_s: float = 0.0
    freedom: float = 5.0
    outliers: float = 0.0

    def draw(self, rng: np.random.Generator, log: WorldLog) -> Array:
        rows = log.run.stamps_s.size
        if self.shape == "gm":
            return gauss_markov(rng, log.run.stamps_s, np.ones(1), self.time_s)[:, 0]
        if self.shape == "heavy":
            return student(self.freedom, self.outliers)(rng, rows)
        return slow(rng, rows) if self.shape == "slow" else steps(rng, rows)


AS_MEASURED: dict[str, tuple[Part, ...]] = {
    "as a laser robot": (
        Part(POSITION, 0.5, "slow"),
        Part(("yaw_deg",), 0.2, "slow"),
        Part(RANGING, 0.25, "gm", 1.0),
        Part(RANGING, 0.5, "heavy", freedom=6.0),
    ),
    "as motion capture": (
        Part(POSITION, 0.8, "gm", 15.0),
        Part(POSITION, 0.3, "heavy", freedom=6.0),
    ),
    "as a camera": (
        Part(POSITION, 0.6, "gm", 0.3),
        Part(ATTITUDE, 0.6, "gm", 1.9),
        Part(RANGING, 0.5, "slow"),
        Part((*RANGING, *ATTITUDE), 0.4, "heavy", freedom=4.6, outliers=0.02),
    ),
}


def foreign(log: WorldLog, kind: str) -> WorldLog:
    """The log with noise of a kind on its columns; `no motion columns` takes those away."""
    if kind in AS_MEASURED:
        rng = np.random.default_rng([log.run.seed, 67, sorted(AS_MEASURED).index(kind)])
        columns = dict(log.columns)
        for part in AS_MEASURED[kind]:
            for name in (n for n in part.names if n in columns):
                columns[name] = columns[name] + part.share * _sigma(log, name) * part.draw(rng, log)
        return replace(log, columns=columns)
    rng = np.random.default_rng([log.run.seed, 61, sorted(KINDS).index(kind)])
    columns = {**log.columns, **KINDS[kind](rng, log)}
    if kind == "no motion columns":
        columns = {n: v for n, v in columns.items() if not n.startswith(("velocity", "rate"))}
    return replace(log, columns=columns)
