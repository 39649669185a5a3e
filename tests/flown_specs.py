"""A trajectory's file, and a spec whose vehicle flies it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import report_samples as samples

SLOW, FAST, TURN_S, LASTS_S = 4.0, 16.0, 60.0, 120.0  # m/s up to the change at 60 s, and after it
HEAD = "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"


def flight(folder: Path) -> Path:
    """North, slowly, then fast; the nose ahead, no turn."""
    times = np.arange(0.0, LASTS_S + 0.1, 0.25)
    north = np.where(times < TURN_S, SLOW * times, SLOW * TURN_S + FAST * (times - TURN_S))
    rows = [f"{t},{n},0,-50,0,0,0" for t, n in zip(times, north, strict=True)]
    path = folder / "flight.csv"
    path.write_text("\n".join([HEAD, *rows]) + "\n", encoding="utf-8")
    return path


def flown(folder: Path) -> Path:
    """A spec whose vehicle flies the file, timestamped so badly that speed decides."""
    flight(folder)
    spec = folder / "spec.yaml"
    text = samples.PINNED.replace(
        "monte_carlo: {samples: 2000}",
        "monte_carlo: {samples: 2000, envelope: trajectory, trajectory: {file: flight.csv}}",
    )
    assert "flight.csv" in text
    spec.write_text(text, encoding="utf-8")
    return spec
