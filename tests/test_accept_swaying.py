"""`accept` on delays that vary from row to row, which scatter readings along the motion alone."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.diagnosis.built import Sighted, sighted
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.spec.load import load
from syncline_design.verdict.pinned import as_measured
from tests.test_accept_stretches import files, world
from tests.world import hidden, make_log
from tests.world.worldlog import write_columns

AXES = ("north", "east", "down")
RUN = ("fixed_wing_circuits", 2, 80.0, 8.0)
AMPLITUDE_S = 0.015


def swaying_log(folder: Path) -> tuple[Path, Path]:
    """Places late by 15 ms sin(2 pi t / 20 s): none in the mean."""
    sound = make_log(world(*RUN))
    columns = dict(sound.columns)
    time_s = columns["time_s"] - columns["time_s"][0]
    late_s = AMPLITUDE_S * np.sin(2.0 * np.pi * time_s / 20.0)
    for axis in AXES:
        moved = late_s * columns[f"velocity_{axis}_mps"]
        columns[f"position_{axis}_m"] = columns[f"position_{axis}_m"] - moved
    spec = folder / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    return spec, write_columns(folder / "log.csv", columns)


def seen(spec: Path, log: Path) -> Sighted:
    settings = DiagnosisSettings(seed=0, unseen_block=False)
    return sighted(as_measured(load(spec), 0), [log], settings)


def test_a_delay_that_sways_breaks_no_noise(tmp_path: Path) -> None:
    spec, log = swaying_log(tmp_path)
    sways = seen(spec, log).sways
    (rms_s,) = [rms_s for key, rms_s in sways.items() if key.endswith("/position")]
    assert rms_s == pytest.approx(AMPLITUDE_S / math.sqrt(2.0), rel=0.2)
    told = accept(load(spec), [log], AcceptSettings(("latency", "noise")), seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    for role in ("position", "attitude", "ranging"):  # each has its own noise
        assert rows[role, "noise"].status == "not_shown", rows[role, "noise"]
    assert rows["position", "latency"].status == "not_shown"
    assert "as a delay that varies by" in rows["position", "latency"].evidence


def test_noise_of_all_readings_is_no_delay(tmp_path: Path) -> None:
    """Places three times as noisy, and a sound log."""
    louder = hidden("noise_understated", "position", factor=3.0)
    for what in ((louder,), ()):
        assert not [key for key in seen(*files(tmp_path, world(*RUN), what)).sways
                    if key.endswith("/position")]  # fmt: skip


@pytest.mark.parametrize("shape", ["normal", "of three values", "exponential"])
def test_stamps_that_scatter_are_bound_by_the_worst_row(shape: str, tmp_path: Path) -> None:
    """Their standard deviation stood there as the bound of a row; and a mean as the delay."""
    rng = np.random.default_rng(3)
    sound = make_log(world(*RUN))
    columns = dict(sound.columns)
    count = len(columns["time_s"])
    late_s = {
        "normal": rng.normal(0.0, 0.02, count),
        "of three values": rng.choice([0.0, 0.03, 0.06], count),
        "exponential": rng.exponential(0.02, count),
    }[shape]
    for axis in AXES:
        moved = late_s * columns[f"velocity_{axis}_mps"]
        columns[f"position_{axis}_m"] = columns[f"position_{axis}_m"] - moved
    spec = tmp_path / "spec.yaml"
    spec.write_text(sound.spec_yaml(), "utf-8")
    log = write_columns(tmp_path / "log.csv", columns)
    told = accept(load(spec), [log], AcceptSettings(("latency", "timing")), seed=0)
    rows = {(row.role, row.assumption): row for row in told.assumptions}
    row = rows["position", "timing"]
    assert row.status == "broken"
    assert row.measured is not None
    assert row.measured.low is not None
    assert row.measured.high is not None
    largest_s = float(np.max(np.abs(late_s - np.mean(late_s))))
    assert row.measured.low <= largest_s <= row.measured.high <= 1.5 * largest_s
    assert "standard deviation" in row.evidence
    assert "in the worst row" in row.evidence
    delay = rows["position", "latency"].measured
    if rows["position", "latency"].status == "broken":
        assert delay is not None
        assert delay.high is not None
        assert delay.high >= float(np.max(late_s))
