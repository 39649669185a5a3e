"""What a simulation is asked to do, and the demands it makes on the system it is given."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, get_args

from syncline_design.effects.acting import demand_acting
from syncline_design.machine.input_files import FileContent
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Sensor, SimulationError, Stage, System
from syncline_design.model.timing import Constant, Distribution, Empirical, Normal, Uniform

Envelope = Literal["limits", "inside", "trajectory"]
DEFAULT_QUANTILES = (0.5, 0.95, 0.997)
DEFAULT_SAMPLES = 200_000
DEFAULT_MANOEUVRE = "figure_eight"


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """How to simulate.

    samples: Monte Carlo draws.  seed: of the one
    SeedSequence behind every stream.  envelope: `limits` (|v| = v_max, |w| = omega_max, free
    directions), `inside` (|v|, |w| uniform below), `trajectory` (from `trajectory`: a manoeuvre's
    name or a CSV file).  quantiles: of |error|.  limit_m: the limit
    of P(|error| <= limit), as a spec has it in `limit_written`.
    confidence: of every interval.  workers: processes for long runs, None for all cores; the
    result does not depend on it.  tau_grid_s: for the worst case against the Syncline.
    """

    samples: int = DEFAULT_SAMPLES
    seed: int = 0
    envelope: Envelope = "limits"
    quantiles: tuple[float, ...] = DEFAULT_QUANTILES
    limit_m: float | None = None
    limit_written: str | None = None
    workers: int | None = None
    trajectory: str | Path | FileContent | None = None
    tau_grid_s: tuple[float, ...] | None = None
    confidence: float = 0.95

    def __post_init__(self) -> None:
        _demand_whole("samples", self.samples, 1)
        _demand_whole("seed", self.seed, 0)
        if self.workers is not None:
            _demand_whole("workers", self.workers, 1)
        _demand_word("envelope", self.envelope, get_args(Envelope))
        for value in self.quantiles:
            _demand(0.0 < value < 1.0, "quantiles", "a number between 0 and 1", value)
        _demand(0.0 < self.confidence < 1.0, "confidence", "between 0 and 1", self.confidence)
        if self.limit_m is not None:
            _demand(0.0 <= self.limit_m < math.inf, "limit_m", "0 m or more", self.limit_m)
        for tau in self.tau_grid_s or ():
            _demand(0.0 <= tau < math.inf, "tau_grid_s", "finite times of 0 s or more", tau)


def _demand(holds: bool, path: str, expected: str, found: object) -> None:
    if not holds:
        raise SimulationError(f"{path}: expected {expected}, found {found}")


def _demand_whole(path: str, value: object, least: int) -> None:
    whole = isinstance(value, int) and not isinstance(value, bool)
    _demand(
        whole and isinstance(value, int) and value >= least,
        path,
        f"a whole number of at least {least}",
        value,
    )


def _demand_word(path: str, value: str, words: tuple[str, ...]) -> None:
    _demand(value in words, path, f"one of {', '.join(words)}", value)


def demand_simulable(system: System) -> None:
    """Raise SimulationError unless every figure that the simulator uses makes sense."""
    _demand(bool(system.stages), "stages", "at least one stage", "none")
    for index, stage in enumerate(system.stages):
        _demand_motion(stage)
        _demand_roles(stage, index == 0, len(system.stages) > 1)
        for sensor in stage.sensors():
            _demand_sensor(stage, sensor)
    for timeline, error in system.clock_offsets:
        path = f"clock_offsets.{timeline}"
        _demand_distribution(path, error.distribution)
        drifted = error.drifted_s
        _demand(0.0 <= drifted < math.inf, path, "a drift of 0 s or more", drifted)
    demand_acting(system)


def _demand_motion(stage: Stage) -> None:
    platform = stage.platform
    figures = (
        ("v_max", platform.v_max_mps),
        ("omega_max", platform.omega_max_radps),
        ("distance", platform.distance_m),
        ("baseline", platform.baseline_m),
    )
    for name, value in figures:
        path = f"stages.{stage.name}.platform.{name}"
        _demand(0.0 <= value < math.inf, path, "a finite figure of 0 or more", float(value))
    if platform.nearest_m is not None:
        path = f"stages.{stage.name}.platform.nearest"
        wanted = "more than 0, and no farther than the distance"
        _demand(0.0 < platform.nearest_m <= platform.distance_m, path, wanted, platform.nearest_m)


def _demand_roles(stage: Stage, first: bool, chained: bool) -> None:
    path = f"stages.{stage.name}"
    if first:
        _demand(stage.position is not None, path, "a position sensor in the first stage", "none")
    else:
        _demand(stage.position is None, path, "no position sensor after the first stage", "one")
    if chained:
        _demand(stage.ranging is not None, path, "a ranging sensor in every stage", "none")
    if stage.ranging is not None:
        _demand(stage.attitude is not None, path, "an attitude sensor to aim the ranging", "none")


def _demand_sensor(stage: Stage, sensor: Sensor) -> None:
    path = f"stages.{stage.name}.{sensor.role}"
    for value in sensor.sigma:
        _demand(0.0 <= value < math.inf, path, "standard deviations of 0 or more", float(value))
    for value in sensor.lever_arm_m or ():
        _demand(math.isfinite(value), f"{path}.lever_arm", "finite lengths", float(value))
    _demand_distribution(path, sensor.timing.distribution)
    remains = sensor.timing.calibrated_s
    if remains is not None:
        _demand(0.0 <= remains < math.inf, path, "a calibrated remainder of 0 s or more", remains)


def _demand_distribution(path: str, distribution: Distribution) -> None:
    match distribution:
        case Uniform(low, high):
            holds = math.isfinite(low) and math.isfinite(high) and low <= high
            _demand(holds, path, "finite low <= high of a uniform error", (low, high))
        case Normal(mean, std):
            holds = math.isfinite(mean) and 0.0 <= std < math.inf
            _demand(holds, path, "a finite mean and std >= 0 of a normal error", (mean, std))
        case Constant(value):
            _demand(math.isfinite(value), path, "a finite constant error", value)
        case Empirical(values):
            _demand(len(values) > 0, path, "at least one value of an empirical error", "none")
            for number, value in enumerate(values, 1):
                text = f"a number as value {number} of an empirical error"
                _demand(_is_number(value), path, text, value)


def _is_number(value: object) -> bool:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    return real and math.isfinite(float(value))  # type: ignore[arg-type]
