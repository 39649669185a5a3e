"""Figures that cannot be, and heads of logs that are made to take long."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.delimited import dialect
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from test_diagnose_log import columns, read, refusal, write

# what is physically there: places on or about the Earth (an orbit of 42 000 km included), spinning
# tops, headings counted on for a day of turns at 1 rev/s
POSSIBLE = {
    "position_north_m": 4.2e7, "target_down_m": -6.4e6, "range_m": 4.0e7, "yaw_deg": 86_400 * 360.0,
    "azimuth_deg": -720.0, "velocity_east_mps": -1_500.0, "rate_x_degps": 36_000.0,
}  # fmt: skip


@pytest.mark.parametrize("name", POSSIBLE)
def test_what_can_be_is_read(name: str, tmp_path: Path) -> None:
    made = columns()
    made[name][7] = POSSIBLE[name]
    assert read(write(tmp_path / "log.csv", made)).time_s.shape == made["time_s"].shape


@pytest.mark.parametrize("value", [1e12, -1e60, 1e200])
@pytest.mark.parametrize("name", POSSIBLE)
def test_what_cannot_be_is_refused_at_its_column(name: str, value: float, tmp_path: Path) -> None:
    """The square of 1e200 is no number of a float: it ended as an internal error or a verdict."""
    made = columns()
    made[name][7] = value
    said = refusal(write(tmp_path / "log.csv", made))
    unit = name.rsplit("_", 1)[1].replace("mps", "m/s").replace("degps", "deg/s")
    assert f"{name}: " in said
    assert f"found {abs(value):.4g} {unit}" in said


def test_a_reference_that_cannot_be_is_refused(tmp_path: Path) -> None:
    made = columns()
    rows = made["time_s"].shape[0]
    for name in ("range_m", "azimuth_deg", "elevation_deg"):
        del made[name]
    for axis in ("north", "east", "down"):
        made[f"reference_{axis}_m"] = np.zeros(rows)
        del made[f"target_{axis}_m"]
    made["reference_east_m"][3] = 1e180
    with pytest.raises(BadInput, match="reference_east_m: farther than any place on Earth"):
        read_log([write(tmp_path / "log.csv", made)], ["uav"], {}, needs_ranging=False)


def test_a_chain_is_held_to_it_stage_by_stage(tmp_path: Path) -> None:
    made = columns()
    own = ("roll", "pitch", "yaw", "velocity", "rate", "range", "azimuth", "elevation")
    chain = {
        f"{stage}_{n}": v.copy()
        for stage in ("ship", "auv")
        for n, v in made.items()
        if n.startswith(own) or (n.startswith("position") and stage == "ship")
    }
    chain |= {n: v for n, v in made.items() if n.startswith(("time", "target"))}
    chain["auv_rate_y_degps"][5] = 1e200
    with pytest.raises(BadInput, match="auv_rate_y_degps: turning faster than any vehicle"):
        read_log([write(tmp_path / "log.csv", chain)], ["ship", "auv"])


HEADS = {
    "comments alone": "#\n" * 520_000,
    "comments that end with CR": "#\r" * 520_000,
    "comments over a row of many cells": "#\n" * 50_000 + ",".join(["1"] * 400_000) + "\n",
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS.keys())
def test_no_head_of_a_log_takes_long(head: str, tmp_path: Path) -> None:
    """Linear in its bytes: below 6 s of processor time; the last one took hours."""
    path = tmp_path / "log.csv"
    path.write_bytes((head + "\n" * 1_100_000).encode()[: (1 << 20) + 9])
    started = time.process_time()
    with pytest.raises(BadInput):
        dialect(path)
    assert time.process_time() - started < 6.0


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_names_are_found_below_comments_whatever_ends_a_line(end: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(end.join(["# a logger", "", "# time_s; range_m", "0,5; 1,25", ""]).encode())
    found = dialect(path)
    assert found.names == ("time_s", "range_m")
    assert found.separator == ";"
    assert path.read_bytes()[found.body :].startswith(b"0,5; 1,25")


@pytest.mark.parametrize("cell", ["1e400", "-1e999", "9" * 190 + "e200"])
def test_figures_beyond_a_float_are_no_missing_values(tmp_path: Path, cell: str) -> None:
    """They counted as missing, while 1e200 was refused; `inf` says that nothing is known."""
    lines = write(tmp_path / "plain.csv", columns()).read_text(encoding="utf-8").splitlines()
    place = lines[0].split(",").index("range_m")
    row = lines[4].split(",")
    for text, wanted in ((cell, None), ("inf", 1), ("-Infinity", 1)):
        row[place] = text
        path = tmp_path / "log.csv"
        path.write_text("\n".join([*lines[:4], ",".join(row), *lines[5:]]) + "\n", "utf-8")
        if wanted is None:
            assert f"log.csv:5:{place + 1}: range_m: text among numbers" in refusal(path)
        else:
            assert read(path).rejected == {"missing value": wanted}
