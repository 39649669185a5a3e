"""The log reader: what it accepts, what it counts, and how it refuses."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.log import Log
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from tests.world.geodesy import to_geodetic

ROWS = 40
NAMES = (
    "time_s",
    *(f"position_{a}_m" for a in ("north", "east", "down")),
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    *(f"velocity_{a}_mps" for a in ("north", "east", "down")),
    *(f"rate_{a}_degps" for a in "xyz"),
    "range_m",
    "azimuth_deg",
    "elevation_deg",
    *(f"target_{a}_m" for a in ("north", "east", "down")),
)


def columns() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    made = {name: rng.uniform(-10, 10, ROWS) for name in NAMES}
    made["time_s"] = np.arange(ROWS) * 0.1
    return made


def write(path: Path, made: dict[str, np.ndarray]) -> Path:
    lines = [",".join(made)]
    lines += [",".join(f"{v:.10g}" for v in row) for row in zip(*made.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read(path: Path, mapping: dict[str, str] | None = None) -> Log:
    return read_log([path], ["uav"], mapping or {})


def refusal(path: Path, mapping: dict[str, str] | None = None) -> str:
    with pytest.raises(BadInput) as caught:
        read(path, mapping)
    return str(caught.value)


def test_units_come_from_the_names(tmp_path: Path) -> None:
    made = columns()
    plain = read(write(tmp_path / "a.csv", made))
    other = dict(made)
    other["range_mm"] = other.pop("range_m") * 1e3
    other["yaw_rad"] = np.radians(other.pop("yaw_deg"))
    other["time_ms"] = other.pop("time_s") * 1e3
    same = read(write(tmp_path / "b.csv", other))
    assert plain.stages[0].range_m == pytest.approx(same.stages[0].range_m, rel=1e-8)
    assert plain.stages[0].euler_rad == pytest.approx(same.stages[0].euler_rad, rel=1e-8)
    assert plain.stages[0].euler_rad[:, 2] == pytest.approx(np.radians(made["yaw_deg"]), rel=1e-8)
    assert plain.time_s == pytest.approx(same.time_s)


def test_other_names_map_in_the_spec(tmp_path: Path) -> None:
    made = columns()
    rolled = made.pop("roll_deg")
    path = write(tmp_path / "a.csv", {**made, "att.phi": np.radians(rolled)})
    log = read(path, {"roll_deg": "att.phi [rad]"})
    assert log.stages[0].euler_rad[:, 0] == pytest.approx(np.radians(rolled), rel=1e-8)


def test_parquet_reads_like_csv(tmp_path: Path) -> None:
    import polars as pl

    made = columns()
    pl.DataFrame(made).write_parquet(tmp_path / "a.parquet")
    left, right = read(tmp_path / "a.parquet"), read(write(tmp_path / "a.csv", made))
    assert left.truth_m == pytest.approx(right.truth_m, rel=1e-8)


def test_geodetic_places_become_local(tmp_path: Path) -> None:
    """Against an independent conversion by way of the earth-centred frame."""
    made = columns()
    place = np.stack([made.pop(f"position_{a}_m") for a in ("north", "east", "down")], axis=1)
    target = np.stack([made.pop(f"target_{a}_m") for a in ("north", "east", "down")], axis=1)
    origin = (63.4, 10.4, 40.0)
    for prefix, values in (("", place), ("target_", target)):
        geodetic = to_geodetic(values - place[0], origin)
        for k, name in enumerate(("latitude_deg", "longitude_deg", "height_m")):
            made[prefix + name] = geodetic[:, k]
    lines = [",".join(made)]
    lines += [",".join(f"{v:.12f}" for v in row) for row in zip(*made.values(), strict=True)]
    (tmp_path / "g.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    log = read(tmp_path / "g.csv")
    assert log.stages[0].antenna_m == pytest.approx(place - place[0], abs=1e-5)
    assert log.truth_m == pytest.approx(target - place[0], abs=1e-5)
    assert any("WGS 84" in note for note in log.notes)


def test_gaps_and_strays_are_counted(tmp_path: Path) -> None:
    made = columns()
    made["range_m"][5] = np.nan
    made["time_s"][20], made["time_s"][21] = made["time_s"][21], made["time_s"][20]
    log = read(write(tmp_path / "a.csv", made))
    assert log.rejected == {"stamp out of order": 1, "missing value": 1}
    assert log.rows_read == len(log) + 2
    assert np.all(np.diff(log.time_s) > 0)


@pytest.mark.parametrize("wrong", [1e6, -50.0, np.nan])
def test_one_stray_stamp_costs_one_row(tmp_path: Path, wrong: float) -> None:
    made = columns()
    made["time_s"][17] = wrong
    log = read(write(tmp_path / "a.csv", made))
    assert log.time_s == pytest.approx(np.delete(columns()["time_s"], 17))
    assert sum(log.rejected.values()) == 1


def test_one_target_after_the_other_is_put_in_order(tmp_path: Path) -> None:
    """A file sorted by target runs through time once for each; no row is a stamp fault."""
    made = columns()
    order = np.argsort(np.arange(ROWS) % 2, kind="stable")
    log = read(write(tmp_path / "a.csv", {k: v[order] for k, v in made.items()}))
    assert log.time_s == pytest.approx(made["time_s"])
    assert log.truth_m[:, 0] == pytest.approx(made["target_north_m"], rel=1e-8)
    assert not log.rejected
    assert any("order" in note for note in log.notes)


def scanned(stamps: int, targets: int) -> dict[str, np.ndarray]:
    """Rows of a scanner that sees all targets at every stamp."""
    made = columns()
    rng = np.random.default_rng(8)
    made = {name: rng.uniform(-10, 10, stamps * targets) for name in made}
    made["time_s"] = np.repeat(np.arange(stamps) * 0.1, targets)
    places = np.round(rng.uniform(0, 100, (targets, 3)), 3)
    for k, axis in enumerate(("north", "east", "down")):
        made[f"target_{axis}_m"] = np.tile(places[:, k], stamps)
        made[f"position_{axis}_m"] = np.sin(0.1 * made["time_s"] + k)
    return made


@pytest.mark.parametrize("told_by", ["place", "number", "name"])
def test_targets_of_one_stamp_are_all_used(tmp_path: Path, told_by: str) -> None:
    made = scanned(30, 4)
    ids = np.tile(np.arange(4), 30)
    path = write(tmp_path / "a.csv", made | ({} if told_by == "place" else {"target_id": ids}))
    if told_by == "name":
        lines = path.read_text(encoding="utf-8").splitlines()
        named = [
            line.rpartition(",")[0] + f",tube {k}" for line, k in zip(lines[1:], ids, strict=True)
        ]
        path.write_text("\n".join([lines[0], *named]) + "\n", encoding="utf-8")
    log = read(path)
    assert len(log) == log.rows_read == 120
    assert not log.rejected
    assert log.stages[0].range_m == pytest.approx(made["range_m"], rel=1e-8)
    if told_by != "place":
        assert log.target_id is not None
        assert len(set(zip(log.target_id, ids, strict=True))) == 4


def test_a_row_given_twice_is_counted_once(tmp_path: Path) -> None:
    made = scanned(30, 4)
    again = np.sort(np.concatenate([np.arange(120), [5, 5, 77]]))
    log = read(write(tmp_path / "a.csv", {k: v[again] for k, v in made.items()}))
    assert log.rejected == {"row given twice": 3}
    assert (log.rows_read, len(log)) == (123, 120)
    made = scanned(30, 4)
    other = {k: np.append(v, v[9]) for k, v in made.items()}
    other["range_m"][-1] += 1.0
    order = np.argsort(other["time_s"], kind="stable")
    log = read(write(tmp_path / "b.csv", {k: v[order] for k, v in other.items()}))
    assert log.rejected == {"second row of a target at one stamp": 1}
    assert log.stages[0].range_m is not None
    assert log.stages[0].range_m[9] == pytest.approx(made["range_m"][9], rel=1e-8)


def test_a_row_of_a_position_log_is_its_stamp_s(tmp_path: Path) -> None:
    t = np.repeat(np.arange(20) * 0.1, 2)[:-1]
    made = {k: v[: t.size] for k, v in columns().items() if k.startswith(("pos", "ro", "pi", "ya"))}
    made |= {"time_s": t, **{f"reference_{a}_m": 0 * t for a in ("north", "east", "down")}}
    with pytest.raises(BadInput, match="stands still"):
        read_log([write(tmp_path / "a.csv", {**made, "time_s": 0 * t})], ["car"], {}, False)
    made["time_s"] = np.unique(np.append(np.arange(t.size) * 0.1, 0.0))
    made["time_s"][4] = made["time_s"][3]
    log = read_log([write(tmp_path / "b.csv", made)], ["car"], {}, False)
    assert log.rejected == {"duplicate stamp": 1}


@pytest.mark.parametrize("targets", [1, 4])
def test_motion_is_derived_over_distinct_stamps(tmp_path: Path, targets: int) -> None:
    """A turning circle seen at several targets a stamp: the same velocity and rate as at one."""
    t = np.repeat(np.arange(200) * 0.1, targets)
    yaw = 0.2 * t
    made = {
        "time_s": t,
        "position_north_m": 10 * np.sin(yaw),
        "position_east_m": -10 * np.cos(yaw),
        "position_down_m": 0 * t,
        "roll_deg": 0 * t,
        "pitch_deg": 0 * t,
        "yaw_deg": np.degrees(yaw),
        "range_m": 5 + 0 * t,
        "azimuth_deg": 0 * t,
        "elevation_deg": 0 * t,
        "target_north_m": np.tile(np.arange(targets), 200) + 0.0,
        "target_east_m": 0 * t,
        "target_down_m": 0 * t,
    }
    log = read(write(tmp_path / "a.csv", made))
    assert len(log) == 200 * targets
    assert log.interval_s == pytest.approx(0.1)
    assert log.stages[0].velocity_mps[:, 0] == pytest.approx(2 * np.cos(yaw), abs=0.02)
    assert log.stages[0].rate_radps[:, 2] == pytest.approx(0.2, abs=1e-6)


def test_a_torn_end_leaves_the_readable_rows(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", columns())
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.rindex("\n", 0, -1) + 25], encoding="utf-8")
    log = read(path)
    assert len(log) == ROWS - 1
    assert any(f"line {ROWS + 1}" in note for note in log.notes)


def test_missing_motion_is_derived_and_said(tmp_path: Path) -> None:
    """A turning circle: the derived velocity and rate are those of the circle."""
    t = np.arange(200) * 0.1
    yaw = 0.2 * t
    made = {
        "time_s": t,
        "position_north_m": 10 * np.sin(yaw),
        "position_east_m": -10 * np.cos(yaw),
        "position_down_m": np.zeros(200),
        "roll_deg": np.zeros(200),
        "pitch_deg": np.zeros(200),
        "yaw_deg": np.degrees(yaw),
        "reference_north_m": 10 * np.sin(yaw),
        "reference_east_m": -10 * np.cos(yaw),
        "reference_down_m": np.zeros(200),
    }
    log = read_log([write(tmp_path / "a.csv", made)], ["car"], {}, needs_ranging=False)
    assert log.kind == "position"
    assert log.stages[0].velocity_mps[:, 0] == pytest.approx(2 * np.cos(yaw), abs=0.01)
    assert log.stages[0].rate_radps[:, 2] == pytest.approx(0.2, abs=1e-6)
    assert sum("derived" in note for note in log.notes) == 2


def test_several_files_meet_at_the_ranging_stamps(tmp_path: Path) -> None:
    """Attitude at 50 Hz and positions at 7 Hz of a known motion, ranges at 10 Hz."""
    made = columns()
    slow, fast = np.arange(-1, 6, 1 / 7), np.arange(-1, 6, 0.02)
    position = {
        "time_s": slow,
        "position_north_m": np.sin(slow),
        "velocity_north_mps": np.cos(slow),
    }
    for axis in ("east", "down"):
        position |= {f"position_{axis}_m": 0 * slow, f"velocity_{axis}_mps": 0 * slow}
    attitude = {"time_s": fast, "roll_deg": 0 * fast, "pitch_deg": 0 * fast}
    attitude |= {"yaw_deg": (170 + 10 * fast + 180) % 360 - 180}
    attitude |= {f"rate_{a}_degps": (10 if a == "z" else 0) + 0 * fast for a in "xyz"}
    ranging = {
        k: v for k, v in made.items() if k.startswith(("time", "range", "azi", "ele", "tar"))
    }
    paths = [
        write(tmp_path / f"{name}.csv", table)
        for name, table in (("position", position), ("attitude", attitude), ("ranging", ranging))
    ]
    log = read_log(paths, ["uav"], {})
    stamps = made["time_s"]
    assert log.time_s == pytest.approx(stamps)
    assert log.stages[0].antenna_m is not None
    assert log.stages[0].antenna_m[:, 0] == pytest.approx(np.sin(stamps), abs=2e-5)
    turned = np.angle(np.exp(1j * (log.stages[0].euler_rad[:, 2] - np.radians(170 + 10 * stamps))))
    assert turned == pytest.approx(np.zeros(ROWS), abs=1e-9)
    assert sum("matched" in note for note in log.notes) == 2


def replaced(column: int, value: str) -> str:
    cells = ["1"] * len(NAMES)
    cells[column] = value
    return ",".join(cells)


def test_every_refusal_says_what_and_where(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    made = columns()
    without = {k: v for k, v in made.items() if k != "range_m"}
    assert "range_m" in refusal(write(path, without))
    lines = write(path, made).read_text(encoding="utf-8").splitlines()
    lines[7] = replaced(4, "east")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert f"{path}:8:5: roll_deg: text among numbers" in refusal(path)
    path.write_text(",".join(NAMES) + "\n", encoding="utf-8")
    assert "no rows" in refusal(path)
    path.write_text("", encoding="utf-8")
    assert "empty" in refusal(path)
    backwards = {k: (v[::-1] if k == "time_s" else v) for k, v in made.items()}
    assert "backwards" in refusal(write(path, backwards))
    still = {k: (0 * v if k == "time_s" else v) for k, v in made.items()}
    assert "stands still" in refusal(write(path, still))
    nanoseconds = {k: (v * 1e9 if k == "time_s" else v) for k, v in made.items()}
    assert "time_ns" in refusal(write(path, nanoseconds))
    path.write_bytes(gzip.compress(b"0" * 10_000_000))
    assert "gzip" in refusal(path)
    path.write_bytes(b"time_s,\xff\xfe\n1,2\n")
    assert "UTF-8" in refusal(path)
    path.write_text("time_s,time_s\n1,2\n", encoding="utf-8")
    assert "twice" in refusal(path)
    short = {k: v[:6] for k, v in made.items()}
    assert "too few" in refusal(write(path, short))
    assert "no regular file" in refusal(tmp_path / "none.csv")
    assert "folder" in refusal(tmp_path)
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 and no more")
    assert "Parquet" in refusal(tmp_path / "bad.parquet")


def test_a_position_log_may_know_one_axis(tmp_path: Path) -> None:
    made = {k: v for k, v in columns().items() if not k.startswith(("target", "range", "az", "el"))}
    made["reference_north_m"] = made["position_north_m"]
    log = read_log([write(tmp_path / "a.csv", made)], ["uav"], {}, needs_ranging=False)
    assert np.isnan(log.truth_m[:, 1:]).all()
    assert np.isfinite(log.truth_m[:, 0]).all()
    assert any("reference_east_m" in note for note in log.notes)
