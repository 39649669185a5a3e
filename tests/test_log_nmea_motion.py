"""Speed and course of NMEA, in whatever sentence they come, and what no sentence of it tells."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.inspection import inspect_logs
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.readers import open_recording
from syncline_design.logs.reading import read_log
from syncline_design.spec.log_block import LogChoice
from tests import flat_flight_logs as made
from tests.flight_logs import geodetic
from tests.test_diagnose_recordings import FIXES, LATE_S, TRUTH
from tests.test_log_receivers import sentence

pytest.importorskip("pyubx2")
KNOT_MPS = 1852 / 3600

Epoch = tuple[str, str, str, str]  # GGA, RMC, VTG, ZDA


def epochs() -> list[Epoch]:
    found = []
    for ns, (lat, lon, height), v in zip(
        TRUTH.stamp_ns.tolist(), geodetic(TRUTH.place).tolist(), TRUTH.velocity, strict=True
    ):
        at = made.moment(ns)
        clock = f"{at:%H%M%S}.{at.microsecond:06d}"
        place = f"{made._minutes(lat, 2)},N,{made._minutes(lon, 3)},E"
        knots, course = np.hypot(v[0], v[1]) / KNOT_MPS, np.degrees(np.arctan2(v[1], v[0])) % 360
        high = f"{height - made.GEOID_M:.4f},M,{made.GEOID_M:.3f},M"
        found.append(
            (
                f"GNGGA,{clock},{place},4,20,0.6,{high},,",
                f"GNRMC,{clock},A,{place},{knots:.6f},{course:.6f},{at:%d%m%y},,,R",
                f"GNVTG,{course:.6f},T,,M,{knots:.6f},N,{knots * 1.852:.6f},K,R",
                f"GNZDA,{clock},{at:%d,%m,%Y},00,00",
            )
        )
    return found


ORDERS: dict[str, Callable[[int, Epoch], tuple[str, ...]]] = {
    "places alone": lambda _, e: (e[3], e[0]),
    "RMC": lambda _, e: (e[0], e[1]),
    "RMC, one in five": lambda k, e: (e[3], e[0], *(e[1:2] if k % 5 == 0 else ())),
    "VTG after": lambda _, e: (e[3], e[0], e[2]),
    "VTG before": lambda _, e: (e[2], e[3], e[0]),
    "VTG between": lambda _, e: (e[3], e[2], e[0]),
}


def written(path: Path, order: str) -> Path:
    rows = (sentence(s) for k, e in enumerate(epochs()) for s in ORDERS[order](k, e))
    path.write_bytes(b"".join(rows))
    return path


@pytest.mark.parametrize("order", [name for name in ORDERS if name.startswith("VTG")])
def test_vtg_is_of_the_epoch_that_it_was_said_in(tmp_path: Path, order: str) -> None:
    recording = open_recording(written(tmp_path / "gnss.log", order))
    (fix,) = [s for s in recording.streams() if s.name == "fix"]
    assert fix.quantity == ("position", "velocity")
    columns = [piece.columns for piece in recording.samples("fix")]
    read = [np.concatenate([c[f"velocity_{a}_mps"] for c in columns]) for a in ("north", "east")]
    assert np.max(np.abs(np.stack(read, axis=1) - TRUTH.velocity[:, :2])) < 1e-4
    side = "before" if order == "VTG after" else "after"
    assert any(f"it counts with the fix {side} it" in note for note in fix.notes)


@pytest.mark.parametrize("order", ORDERS)
def test_the_motion_of_a_reference_in_nmea_is_whole(tmp_path: Path, order: str) -> None:
    """Down too, which no sentence tells, and at every fix: by its places where it says none."""
    files = [
        made.write_german_csv(tmp_path / "rover.csv", FIXES),
        written(tmp_path / "base.log", order),
    ]
    parts = inspect_logs(files, LogChoice(), poses=False, stages=["uav"]).proposal.parts
    own = [part.stream for part in parts if part.role == "velocity"]
    assert own == (["rover"] if order == "places alone" else ["fix"])
    sources = row_sources(files, LogChoice(), ["uav"], poses=False)
    log = read_log(sources, ["uav"], needs_ranging=False)
    assert len(log) > 440
    antenna, velocity = log.stages[0].antenna_m, log.stages[0].velocity_mps
    assert antenna is not None
    of_day = (TRUTH.stamp_ns % (86_400 * 10**9)) / 1e9
    truth = np.stack([np.interp(log.time_s, of_day, v) for v in TRUTH.velocity.T], axis=1)
    inside, near = slice(20, -20), 0.02 if own == ["fix"] else 0.15  # the rover's is 80 ms late
    assert np.sqrt(np.mean((velocity - truth)[inside] ** 2, axis=0)) == pytest.approx(0, abs=near)
    late_s = -np.sum((antenna - log.truth_m) * velocity) / np.sum(velocity**2)
    assert late_s == pytest.approx(LATE_S, abs=1e-3)
