"""Logs as they are written: separators, decimal commas, calendar times, comments, 2-D, origins.

Every file is written by the test from the same numbers; the oracle is the plain file, `datetime`
of the standard library or the conversion of `tests.world.geodesy`.
"""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from tests.table_logs import AXES, read, same, written
from tests.test_diagnose_log import NAMES, ROWS, columns, refusal, scanned, write
from tests.world.geodesy import to_geodetic

ORIGIN_DEG = (47.3, 8.55, 460.0)
ORIGIN = (np.radians(47.3), np.radians(8.55), 460.0)
SHAPES: dict[str, Callable[[str], str]] = {
    "plain": lambda text: text,
    "crlf": lambda text: text.replace("\n", "\r\n"),
    "old mac": lambda text: text.replace("\n", "\r"),
    "byte order mark": lambda text: "\ufeff" + text,
    "no last line end": lambda text: text.rstrip("\n"),
    "comments": lambda text: (
        "# made by a logger; unit, frame\n" + text.replace("\n", "\n#x,y\n", 3)
    ),
    "names behind a hash": lambda text: "# a rig\n# " + text,
    "empty lines": lambda text: "\n \n" + text.replace("\n", "\n\n\t\n", 5) + "\n\n",
    "blanks about cells": lambda text: text.replace(";", " ; ").replace("\t", " \t "),
    "quoted names": lambda text: '"time_s"' + text.removeprefix("time_s"),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ",")]
)
def test_one_log_in_every_dress(tmp_path: Path, separator: str, decimal: str, shape: str) -> None:
    plain = read(written(tmp_path / "plain.csv"))
    path = written(tmp_path / "dressed.csv", separator, decimal)
    text = SHAPES[shape](path.read_text(encoding="utf-8"))
    path.write_bytes(text.encode("utf-8"))
    dressed = read(path)
    same(dressed, plain)
    assert not dressed.rejected


def test_a_line_that_names_the_separator_is_obeyed(tmp_path: Path) -> None:
    same(
        read(written(tmp_path / "a.csv", ";", ",", head="sep=;\n")),
        read(written(tmp_path / "b.csv")),
    )


def with_times(path: Path, name: str, shown: Callable[[datetime], str]) -> Path:
    """The log with calendar times from a Sunday noon on, in some notation."""
    made = columns()
    start = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC)
    cells = [shown(start + timedelta(seconds=float(t))) for t in made.pop("time_s")]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=";")
        writer.writerow([name, *made])
        rows = zip(*made.values(), strict=True)
        writer.writerows(
            [cell, *(f"{v:.10f}" for v in row)] for cell, row in zip(cells, rows, strict=True)
        )
    return path


NOTATIONS: dict[str, Callable[[datetime], str]] = {
    "Z": lambda t: t.isoformat().replace("+00:00", "Z"),
    "offset": lambda t: t.astimezone(timezone(timedelta(hours=2, minutes=30))).isoformat(),
    "west": lambda t: t.astimezone(timezone(timedelta(hours=-7))).isoformat(" "),
    "basic": lambda t: t.strftime("%Y%m%dT%H%M%S.%fZ"),
    "comma": lambda t: t.strftime("%Y-%m-%d %H:%M:%S,%f+0000"),
    "nanoseconds": lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%f") + "000Z",
    "no zone": lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%f"),
    "small letters": lambda t: t.strftime("%Y-%m-%dt%H:%M:%S.%fz"),
}


@pytest.mark.parametrize("notation", NOTATIONS)
@pytest.mark.parametrize("name", ["time", "time_utc", "time_iso"])
def test_calendar_times_count_from_midnight_utc(tmp_path: Path, notation: str, name: str) -> None:
    log = read(with_times(tmp_path / "a.csv", name, NOTATIONS[notation]))
    assert log.time_s == pytest.approx(43_200.0 + columns()["time_s"], abs=1e-9)
    assert any("2026-03-01T00:00:00Z" in note for note in log.notes)
    assert any("no zone" in note for note in log.notes) == (notation == "no zone")
    mapped = with_times(tmp_path / "b.csv", "Zeit", NOTATIONS[notation])
    same(read(mapped, {"time_s": "Zeit"}), log)
    same(read(mapped, {"time": "Zeit"}), log)


def test_calendar_times_of_two_files_share_a_midnight(tmp_path: Path) -> None:
    """Ranging from before midnight, attitude and position from after: one scale for both."""
    made = columns()
    start = datetime(2026, 12, 31, 23, 59, 58, tzinfo=UTC)
    stamps = [start + timedelta(seconds=float(t)) for t in made["time_s"]]

    def file(name: str, keep: Callable[[str], bool], rows: slice) -> Path:
        chosen = {k: v[rows] for k, v in made.items() if keep(k) and k != "time_s"}
        lines = ["time," + ",".join(chosen)]
        values = zip(stamps[rows], *chosen.values(), strict=True)
        lines += [f"{t.isoformat()}," + ",".join(f"{v:.10g}" for v in row) for t, *row in values]
        (tmp_path / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
        return tmp_path / name

    sight = ("range", "azimuth", "elevation", "target")
    ranging = file("r.csv", lambda k: k.startswith(sight), slice(None))
    vehicle = file("v.csv", lambda k: not k.startswith(sight), slice(25, None))
    log = read_log([ranging, vehicle], ["uav"], {})
    assert log.time_s == pytest.approx(86_398.0 + made["time_s"][25:], abs=1e-9)
    assert log.stages[0].antenna_m is not None
    north = made["position_north_m"][25:]
    assert log.stages[0].antenna_m[:, 0] == pytest.approx(north, abs=1e-8)


def test_times_that_cannot_be_meant_name_the_way_out(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv")
    path.write_text(path.read_text(encoding="utf-8").replace("time_s", "time", 1), encoding="utf-8")
    assert "time_s, time_ms, time_us or time_ns" in refusal(path)
    clock = with_times(tmp_path / "b.csv", "time", lambda t: t.strftime("%H:%M:%S.%f"))
    assert f"{clock}:2:1: time: text among numbers" in refusal(clock)
    half = with_times(
        tmp_path / "c.csv", "time", lambda t: t.isoformat() + ("" if t.second < 2 else "Z")
    )
    assert "ISO 8601" in refusal(half)
    zones = with_times(
        tmp_path / "d.csv",
        "time",
        lambda t: t.strftime("%Y-%m-%dT%H:%M:%S.%f") + ("Z" if t.second > 2 else ""),
    )
    assert "zone" in refusal(zones)
    feb = with_times(tmp_path / "e.csv", "time", lambda t: t.isoformat().replace("03-01", "02-30"))
    assert "02-30" in refusal(feb)
    leap = with_times(tmp_path / "f.csv", "time", lambda t: t.strftime("2016-12-31T23:59:60.%fZ"))
    assert "time_s" in refusal(leap)
    far = with_times(tmp_path / "g.csv", "time", lambda t: t.isoformat().replace("2026", "9999"))
    assert "1678 to 2261" in refusal(far)
    zone = with_times(tmp_path / "h.csv", "time", lambda t: t.strftime("%Y-%m-%dT%H:%M:%S+99:99"))
    assert "text among numbers" in refusal(zone)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        (["1,5"], "one decimal mark"),
        (["1.234,5"], "one decimal mark"),
        (["1,5,0"], "one decimal mark"),
        (["12 m"], "a number"),
    ],
)
def test_figures_that_may_mean_two_things_are_refused(
    tmp_path: Path, cells: list[str], words: str
) -> None:
    lines = written(tmp_path / "a.csv", ";").read_text(encoding="utf-8").splitlines()
    for k, cell in enumerate(cells):
        row = lines[5 + k].split(";")
        row[13] = cell
        lines[5 + k] = ";".join(row)
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    said = refusal(tmp_path / "a.csv")
    assert words in said
    assert ":6:14: range_m" in said


def test_unreadable_heads_say_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time_s range_m yaw_deg\n1 2 3\n", encoding="utf-8")
    assert "blanks" in refusal(path)
    path.write_text("1,2,3\n2,3,4\n", encoding="utf-8")
    assert "no header" in refusal(path)
    path.write_text("# nothing else\n", encoding="utf-8")
    assert "no time column" in refusal(path)
    path.write_text("\n\n\n", encoding="utf-8")
    assert "no header" in refusal(path)
    path.write_text('time_s,"range_m\n1,2\n', encoding="utf-8")
    assert str(path) in refusal(path)


def test_a_heading_is_a_yaw(tmp_path: Path) -> None:
    made = columns()
    plain = read(write(tmp_path / "a.csv", made))
    turned = {("heading_deg" if k == "yaw_deg" else k): v for k, v in made.items()}
    log = read(write(tmp_path / "b.csv", turned))
    same(log, plain)
    assert "heading_deg was read as yaw" in log.notes
    radians = {("heading_rad" if k == "yaw_deg" else k): v for k, v in made.items()}
    radians["heading_rad"] = np.radians(made["yaw_deg"])
    same(read(write(tmp_path / "c.csv", radians)), plain)
    both = read(write(tmp_path / "d.csv", {**made, "heading_deg": made["yaw_deg"] + 90}))
    same(both, plain)


def ragged(path: Path, row: int, change: Callable[[str], str], end: str = "\n") -> Path:
    lines = write(path, columns()).read_text(encoding="utf-8").splitlines()
    lines[row] = change(lines[row])
    path.write_text("\n".join(lines) + end, encoding="utf-8")
    return path


@pytest.mark.parametrize("row", [1, 2, 17, ROWS - 1, ROWS])
@pytest.mark.parametrize(
    "change",
    [
        lambda line: line.rpartition(",")[0],
        lambda line: line + ",7",
        lambda line: line.partition(",")[0],
        lambda line: line.replace(",", ",,", 1),
        lambda line: line.replace(",", ";", 1),
    ],
    ids=["short", "long", "one cell", "doubled", "another separator"],
)
def test_a_ragged_row_is_named(tmp_path: Path, row: int, change: Callable[[str], str]) -> None:
    assert f"row {row + 1} has not the header's cells" in refusal(
        ragged(tmp_path / "a.csv", row, change)
    )


@pytest.mark.parametrize("left", [1, 5, 9, 30, 80, 150])
def test_only_a_last_row_cut_off_is_left_out(tmp_path: Path, left: int) -> None:
    log = read(ragged(tmp_path / "a.csv", ROWS, lambda line: line[:left], end=""))
    assert len(log) == ROWS - 1
    assert log.rejected == {"cut off in the last row": 1}
    assert log.rows_read == ROWS
    said = refusal(ragged(tmp_path / "b.csv", ROWS, lambda line: line + ",1", end=""))
    assert f"row {ROWS + 1}" in said


@pytest.mark.parametrize("name", ["run[1].csv", "x*.csv", "what?.csv", "a=1.csv", "[!a].parquet"])
def test_paths_are_literal(tmp_path: Path, name: str) -> None:
    """Beside the file lie others that a pattern of its name would match."""
    import polars as pl

    decoys = {k: (v if k == "time_s" else v + 1.0) for k, v in columns().items()}
    for decoy in ("run1.csv", "xy.csv", "x1.csv", "whats.csv", "b.parquet"):
        if decoy.endswith("parquet"):
            pl.DataFrame(decoys).write_parquet(tmp_path / decoy)
        else:
            write(tmp_path / decoy, decoys)
    if name.endswith("parquet"):
        with (tmp_path / name).open("wb") as file:
            pl.DataFrame(columns()).write_parquet(file)
    else:
        write(tmp_path / name, columns())
    plain = read(write(tmp_path / "plain.csv", columns()))
    same(read(tmp_path / name), plain)
    with pytest.raises(BadInput, match="no regular file"):
        read(tmp_path / name.replace("csv", "CSV").replace("parquet", "pq"))


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.csv")
    start = time.monotonic()
    assert "no regular file" in refusal(tmp_path / "log.csv")
    assert time.monotonic() - start < 2.0


FLAT = ("position_down_m", "roll_deg", "pitch_deg", "elevation_deg", "target_down_m")


@pytest.mark.parametrize(
    "left_out",
    [FLAT, FLAT[:1], FLAT[1:3], FLAT[3:4], FLAT[4:], (*FLAT, "velocity_down_mps"),
     (*FLAT, "velocity_down_mps", "rate_x_degps", "rate_y_degps")],
    ids=len,
)  # fmt: skip
def test_a_2_d_log_may_leave_out_what_it_does_not_know(
    tmp_path: Path, left_out: tuple[str, ...]
) -> None:
    made = columns() | {name: np.zeros(ROWS) for name in FLAT}
    full = read(write(tmp_path / "a.csv", made))
    log = read(write(tmp_path / "b.csv", {k: v for k, v in made.items() if k not in left_out}))
    assert log.stages[0].euler_rad == pytest.approx(full.stages[0].euler_rad)
    assert log.stages[0].antenna_m == pytest.approx(full.stages[0].antenna_m)
    assert log.stages[0].elevation_rad == pytest.approx(full.stages[0].elevation_rad)
    assert log.truth_m[:, :2] == pytest.approx(full.truth_m[:, :2])
    compared = not set(left_out) & {FLAT[0], FLAT[3], FLAT[4]}
    assert np.isfinite(log.truth_m[:, 2]).all() == compared
    assert any("down is not compared" in note for note in log.notes) != compared
    for name in left_out:
        if name != "target_down_m":
            assert any(name in note for note in log.notes), name


@pytest.mark.parametrize("name", ["roll_deg", "yaw_deg", "azimuth_deg", "position_north_m"])
def test_what_a_2_d_log_knows_is_demanded(tmp_path: Path, name: str) -> None:
    made = {k: v for k, v in columns().items() if k != name}
    assert f"column is missing: {name}" in refusal(write(tmp_path / "a.csv", made))


def geodetic(local: dict[str, np.ndarray], prefixes: dict[str, str]) -> dict[str, np.ndarray]:
    """Some places of a local log as WGS 84, by way of the earth-centred frame."""
    made = dict(local)
    for prefix, name in prefixes.items():
        place = np.stack([made.pop(f"{name}_{a}_m") for a in AXES], axis=1)
        found = to_geodetic(place, ORIGIN_DEG)
        for k, column in enumerate(("latitude_deg", "longitude_deg", "height_m")):
            made[prefix + column] = found[:, k]
    return made


def write_long(path: Path, made: dict[str, np.ndarray]) -> Path:
    lines = [",".join(made)]
    lines += [",".join(f"{v:.12f}" for v in row) for row in zip(*made.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "prefixes", [{"": "position", "target_": "target"}, {"": "position"}, {"target_": "target"}]
)
def test_a_stated_origin_is_the_zero_of_the_local_frame(
    tmp_path: Path, prefixes: dict[str, str]
) -> None:
    """Also where positions are in WGS 84 and surveyed targets are local, or the other way."""
    local = columns()
    path = write_long(tmp_path / "a.csv", geodetic(local, prefixes))
    log = read_log([path], ["uav"], {}, origin=ORIGIN)
    north = local["position_north_m"]
    assert log.stages[0].antenna_m is not None
    assert log.stages[0].antenna_m[:, 0] == pytest.approx(north, abs=1e-5)
    assert log.truth_m[:, 2] == pytest.approx(local["target_down_m"], abs=1e-5)
    if len(prefixes) == 1:
        assert "log: {origin: [" in refusal(path)
    flat = {k: v for k, v in geodetic(local, prefixes).items() if "height" not in k}
    log = read_log([write_long(tmp_path / "b.csv", flat)], ["uav"], {}, origin=ORIGIN)
    assert log.truth_m[:, 0] == pytest.approx(local["target_north_m"], abs=1e-3)
    assert np.isnan(log.truth_m[:, 2]).all()


def test_a_latitude_beyond_the_pole_is_refused(tmp_path: Path) -> None:
    made = geodetic(columns(), {"": "position", "target_": "target"})
    made["latitude_deg"] = made["latitude_deg"] * 1e2
    assert "no latitude" in refusal(write_long(tmp_path / "a.csv", made))


def test_floods_end_soon(tmp_path: Path) -> None:
    """A header of 150 000 names, 8 MB of empty lines, and rows that are all one stamp."""
    start = time.process_time()
    path = tmp_path / "a.csv"
    path.write_text(",".join(f"c{k}" for k in range(150_000)) + "\n", encoding="utf-8")
    assert "no header in the first 1 MiB" in refusal(path)
    path.write_text(",".join(f"c{k}" for k in range(100_000)) + "\n1\n", encoding="utf-8")
    assert "too many columns" in refusal(path)
    path.write_text(",".join(NAMES) + "\n" * 8_000_000, encoding="utf-8")
    assert "no rows" in refusal(path)
    path.write_text(",".join(NAMES) + "\n" + ("," * 18 + "\n") * 200_000, encoding="utf-8")
    assert "no time stamps" in refusal(path)
    path.write_text(",".join(NAMES) + "\n" + "1," * 3_000_000, encoding="utf-8")
    assert str(path) in refusal(path)
    path.write_text(",".join(NAMES) + "\n" + " " * 6_000_000 + "\n", encoding="utf-8")
    assert str(path) in refusal(path)
    assert time.process_time() - start < 8.0


def test_targets_of_one_stamp_survive_every_format(tmp_path: Path) -> None:
    made = scanned(30, 4)
    path = write(tmp_path / "a.csv", made)
    text = path.read_text(encoding="utf-8")
    (tmp_path / "b.csv").write_text(text.replace(",", ";").replace(".", ","), encoding="utf-8")
    same(read(tmp_path / "b.csv"), read(path))
    assert len(read(path)) == 120
