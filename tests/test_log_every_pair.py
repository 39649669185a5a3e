"""One flight in every format, each tested and each the reference: the same delay from all of them.

The oracle is the least-squares delay of the flight's own arrays; no file is read for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.inspection import inspect_logs
from syncline_design.logs.log_files import row_sources
from syncline_design.logs.reading import read_log
from syncline_design.spec.log_block import LogChoice
from tests import flat_flight_logs as made
from tests.flight_logs import ORIGIN, Flight, flight, write_mcap, write_ros1, write_ros2, write_ulog

pytest.importorskip("pyubx2")

LATE_S, NOISE_M, STEP_M = 0.08, 0.01, 0.011  # the last: 1e-7 deg
TRUTH, TESTED = flight(45.0), flight(45.0, late_s=LATE_S, noise_m=NOISE_M)
WRITERS: dict[str, tuple[str, Callable[[Path, Flight], Path]]] = {
    "nmea": ("f.log", made.write_nmea),
    "ubx": ("f.ubx", made.write_ubx),
    "pos": ("f.pos", made.write_pos),
    "sbet": ("f.out", made.write_sbet),
    "tum": ("f.txt", made.write_tum),
    "euroc": ("e.csv", made.write_euroc),
    "csv": ("f.csv", made.write_german_csv),
    "parquet": ("f.parquet", made.write_parquet),
    "ros1": ("f.bag", write_ros1),
    "ros2": ("bag", write_ros2),
    "mcap": ("f.mcap", write_mcap),
    "ulog": ("f.ulg", write_ulog),
    "dataflash": ("f.bin", lambda path, flown: made.write_dataflash(path, flown, flown)),
}
COARSE = {"ulog", "dataflash"}
STAMP_STEP_S = {"nmea": 1e-6, "dataflash": 1e-3}  # others have more digits
FIXES_ALONE = {"nmea", "ubx", "pos"}  # no attitude, so none of these is held against another
PAIRS = [
    *((one, "tum") for one in WRITERS if one != "dataflash"),
    *(("nmea", one) for one in WRITERS if one not in FIXES_ALONE),
    *((a, b) for a in ("csv", "parquet") for b in ("csv", "parquet")),
    *(("sbet", "ros2"), ("ros1", "mcap"), ("mcap", "sbet"), ("parquet", "euroc"), ("ulog", "csv")),
]


def least_squares_s(error: np.ndarray, velocity: np.ndarray) -> tuple[float, float]:
    """Places that are tau old differ by -v tau; tau and its standard uncertainty [s]."""
    known = np.isfinite(error) & np.isfinite(velocity)
    e, v = np.where(known, error, 0.0), np.where(known, velocity, 0.0)
    power = float(np.sum(v**2))
    return -float(np.sum(e * v)) / power, NOISE_M / np.sqrt(power)


def written(folder: Path, name: str, flown: Flight) -> Path:
    folder.mkdir()
    file, write = WRITERS[name]
    return write(folder / f"{folder.name}{file}", flown)


@pytest.mark.parametrize(("tested", "reference"), list(dict.fromkeys(PAIRS)))
def test_every_format_shows_the_same_delay(tmp_path: Path, tested: str, reference: str) -> None:
    files = [written(tmp_path / "t", tested, TESTED), written(tmp_path / "r", reference, TRUTH)]
    place = (*np.radians(ORIGIN[:2]).tolist(), ORIGIN[2])
    choice = LogChoice.model_construct(origin=place, frame="enu", body="flu")
    log = read_log(row_sources(files, choice, ["uav"], poses=False), ["uav"], choice.columns,
                   needs_ranging=False, origin=choice.origin)  # fmt: skip
    antenna, velocity = log.stages[0].antenna_m, log.stages[0].velocity_mps
    assert antenna is not None
    found, _ = least_squares_s(antenna - log.truth_m, velocity)
    rows = slice(len(TRUTH) - len(log), None)  # before a flight log's first fix there are none
    expected, sigma = least_squares_s((TESTED.place - TRUTH.place)[rows], TRUTH.velocity[rows])
    coarse = bool(COARSE & {tested, reference})
    step = STEP_M / np.sqrt(12.0) / NOISE_M if coarse else 0.0
    stamps_s = max(STAMP_STEP_S.get(one, 0.0) for one in (tested, reference))
    assert abs(found - expected) < (0.1 + 3.0 * step) * sigma + stamps_s
    assert len(log) >= 449 - 5 * coarse  # a stamp cut off to 1 us lies before the first reference


def test_two_trajectories_in_tables_are_two_trajectories(tmp_path: Path) -> None:
    """As two recordings are: the first is tested, the last the reference, and it is said."""
    files = [written(tmp_path / "t", "csv", TESTED), written(tmp_path / "r", "parquet", TRUTH)]
    plan = inspect_logs(files).proposal
    chosen = {part.role: part.stream for part in plan.parts}
    assert (chosen["position"], chosen["reference"]) == ("tf", "rf")
    assert not plan.lacking


def test_a_table_of_places_beside_one_of_attitudes_stays_a_table(tmp_path: Path) -> None:
    """Parts of one trajectory in two files are joined by their times, as before."""
    whole = made.write_german_csv(tmp_path / "w.csv", replace(TRUTH))
    head, *rows = whole.read_text("utf-8-sig").splitlines()[1:]
    names = head.split(";")
    for file, cells in (("places", range(4)), ("turns", (0, 4, 5, 6))):
        text = [";".join(row.split(";")[k] for k in cells) for row in [";".join(names), *rows]]
        (tmp_path / f"{file}.csv").write_text("\n".join(text) + "\n", "utf-8")
    plan = inspect_logs([tmp_path / "places.csv", tmp_path / "turns.csv"]).proposal
    assert "reference" not in {part.role for part in plan.parts}
    assert plan.lacking
