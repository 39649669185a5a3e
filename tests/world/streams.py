"""A log as separate files, each sensor at its own rate and phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from tests.world.hidden import Hidden
from tests.world.noise import Noise
from tests.world.scenarios import Scenario
from tests.world.worldlog import WorldLog, make_log, write_columns

FILES = {
    "position": ("position_", "velocity_"),
    "attitude": ("roll_", "pitch_", "yaw_", "rate_"),
    "ranging": ("range_", "azimuth_", "elevation_", "target_"),
}


def at_rate(run: Scenario, rate_hz: float, phase_s: float) -> Scenario:
    """The same run stamped at another rate, from a second before its start to one after."""
    stamps = np.arange(-1.0 + phase_s, run.duration_s + 1.0, 1.0 / rate_hz)
    sighted = np.zeros(stamps.size, np.int64)
    return replace(run, stamps_s=np.round(stamps, 4), sighted=sighted, seed=run.seed + 5000)


def write_streams(
    run: Scenario,
    folder: FilePath,
    effects: Sequence[Hidden] = (),
    noise: Noise | None = None,
    rates_hz: tuple[float, float] = (5.0, 50.0),
) -> list[FilePath]:
    """Files of position, attitude and ranging of a one-stage run; ranging keeps its stamps."""
    logs: dict[str, WorldLog] = {
        "position": make_log(at_rate(run, rates_hz[0], 0.013), effects, noise),
        "attitude": make_log(at_rate(run, rates_hz[1], 0.0071), effects, noise),
        "ranging": make_log(run, effects, noise),
    }
    paths = []
    for role, log in logs.items():
        wanted = {
            name: values
            for name, values in log.columns.items()
            if name == "time_s" or name.startswith(FILES[role])
        }
        paths.append(write_columns(folder / f"{role}.csv", wanted))
    return paths
