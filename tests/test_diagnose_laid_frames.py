"""What is constant between two frames that only the log laid onto each other is no finding."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.run import diagnose_measured
from syncline_design.diagnosis.system import measured
from syncline_design.logs.frame_fit import Turns
from syncline_design.logs.log_files import open_recording, some_offers
from syncline_design.logs.readers.stream import Piece
from syncline_design.logs.run_parts import one_run
from syncline_design.logs.stream_values import values_of
from syncline_design.spec.load import load
from syncline_design.spec.log_block import LogChoice
from tests.flight_logs import write_ros1
from tests.test_diagnose_recordings import FIXES, TRUTH, spec

SHIFT = np.array([0.01, -0.02, 0.05])  # as a laying may be off; the fixes scatter by 2 cm


def named(
    folder: Path, laid: Turns | None, turn_rad: float = 0.0, flat: bool = False
) -> dict[str, float]:
    """What is named, with its first value, where the reference stands off by a shift and a turn."""
    inputs = measured(load(spec(folder)), [write_ros1(folder / "a.bag", TRUTH, fixes=FIXES)])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turned = inputs.log.truth_m @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + SHIFT
    if flat:
        turned[:, 2] = np.nan
    log = replace(inputs.log, truth_m=turned, laid=laid)
    done = diagnose_measured(replace(inputs, log=log), DiagnosisSettings(seed=1))
    return {one.effect: next(iter(one.parameters.values())).value for one in done.findings}


def test_a_shift_of_a_frame_that_is_known_is_found(tmp_path: Path) -> None:
    assert len(named(tmp_path, None)) > 1


@pytest.mark.parametrize(("laid", "turn_rad"), [("none", 0.0), ("heading", 1e-3)])
def test_a_shift_and_turn_of_a_laid_frame_are_not(
    tmp_path: Path, laid: Turns, turn_rad: float
) -> None:
    found = named(tmp_path, laid, turn_rad)
    assert list(found) == ["latency"]
    assert found["latency"] == pytest.approx(0.08, abs=0.001)


def test_an_axis_that_the_reference_does_not_tell_puts_no_warning(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert list(named(tmp_path, "heading", 1e-3, flat=True)) == ["latency"]


def test_signalling_nan_of_damaged_bytes_put_no_warning(tmp_path: Path) -> None:
    """0x7f800001 as a 32-bit float (IEEE 754-2019, 6.2.1); widening it raises `invalid`."""
    (recording,) = one_run([open_recording(write_ros1(tmp_path / "a.bag", TRUTH, fixes=FIXES))])
    offer = some_offers([recording])[0]
    damaged = np.frombuffer(bytes.fromhex("0100807f0000803f"), dtype="<f4")
    piece = Piece(np.array([1, 2]), None, {"position_x_m": damaged})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = values_of(offer, [piece], LogChoice())
    assert len(read.time_ns) == 2
