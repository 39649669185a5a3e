"""One run cut into several tables is read as the whole; the oracle is the file that was cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.given_once import demand_once
from syncline_design.logs.log import Log
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from tests.test_diagnose_log import ROWS, columns, read, write

Columns = dict[str, np.ndarray]
CUT = 17


def pieces(made: Columns, cut: int = CUT, over: int = 0) -> tuple[Columns, Columns]:
    """The rows up to a cut, and those from `over` rows before it on."""
    return (
        {name: values[:cut] for name, values in made.items()},
        {name: values[cut - over :] for name, values in made.items()},
    )


def same(one: Log, other: Log) -> None:
    assert one.time_s == pytest.approx(other.time_s)
    assert one.rows_read == other.rows_read
    assert one.truth_m == pytest.approx(other.truth_m)
    for name in ("antenna_m", "euler_rad", "velocity_mps", "rate_radps", "range_m", "azimuth_rad"):
        a, b = getattr(one.stages[0], name), getattr(other.stages[0], name)
        assert a == pytest.approx(b), name


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_parts_of_one_run_are_the_run_in_any_order(tmp_path: Path, order: tuple[int, int]) -> None:
    made = columns() | {"target_id": np.arange(ROWS) % 3.0}
    files = [write(tmp_path / f"{k}.csv", part) for k, part in zip("ab", pieces(made), strict=True)]
    log = read_log([files[k] for k in order], ["uav"])
    whole = read(write(tmp_path / "whole.csv", made))
    same(log, whole)
    assert log.target_id is not None
    assert whole.target_id is not None
    assert log.target_id == pytest.approx(whole.target_id)
    assert "parts of one run, in the order of time: a.csv, b.csv" in log.notes


def test_parts_may_name_other_units(tmp_path: Path) -> None:
    made = columns()
    first, second = pieces(made)
    second["range_mm"] = second.pop("range_m") * 1e3
    second["yaw_rad"] = np.radians(second.pop("yaw_deg"))
    second["time_ms"] = second.pop("time_s") * 1e3
    files = [write(tmp_path / "a.csv", first), write(tmp_path / "b.csv", second)]
    same(read_log(files, ["uav"]), read(write(tmp_path / "whole.csv", made)))


def test_a_hole_between_the_parts_is_a_gap_of_the_log(tmp_path: Path) -> None:
    made = columns()
    made["time_s"][CUT:] += 60.0
    files = [write(tmp_path / f"{k}.csv", part) for k, part in zip("ab", pieces(made), strict=True)]
    same(read_log(files, ["uav"]), read(write(tmp_path / "whole.csv", made)))


def test_both_logs_of_a_run_may_come_in_parts(tmp_path: Path) -> None:
    """Velocities of a file of their own are interpolated from all of its parts."""
    made = columns()
    motion = {n: v for n, v in made.items() if n.startswith(("time", "velocity"))}
    rest = {n: v for n, v in made.items() if not n.startswith("velocity")}
    cut = [*pieces(rest), *pieces(motion, 23)]
    files = [write(tmp_path / f"{k}.csv", one) for k, one in enumerate(cut)]
    whole = [write(tmp_path / "rest.csv", rest), write(tmp_path / "motion.csv", motion)]
    same(read_log(files, ["uav"]), read_log(whole, ["uav"]))


def test_parts_that_overlap_are_refused_with_their_stamps(tmp_path: Path) -> None:
    first, second = pieces(columns(), over=3)
    files = [write(tmp_path / "a.csv", first), write(tmp_path / "b.csv", second)]
    with pytest.raises(BadInput, match=r"a second log of .* that are in a.csv already") as caught:
        read_log(files, ["uav"])
    assert "1.400 to 3.900 s, beside 0.000 to 1.600 s" in str(caught.value)
    assert "one after the other in time" in str(caught.value)


@pytest.mark.parametrize("lacks", ["velocity_north_mps", "range_m"])
@pytest.mark.parametrize("part", [0, 1])
def test_parts_whose_columns_differ_are_refused(tmp_path: Path, lacks: str, part: int) -> None:
    two = pieces(columns())
    del two[part][lacks]
    files = [write(tmp_path / "a.csv", two[0]), write(tmp_path / "b.csv", two[1])]
    with pytest.raises(BadInput, match="one after the other in time") as caught:
        read_log(files, ["uav"])
    assert lacks in str(caught.value)


def test_the_part_that_is_cut_off_is_named(tmp_path: Path) -> None:
    first, second = pieces(columns())
    files = [write(tmp_path / "a.csv", first), write(tmp_path / "b.csv", second)]
    text = files[1].read_text(encoding="utf-8")
    files[1].write_text(text[: text.rindex(",")], encoding="utf-8")
    log = read_log(files, ["uav"])
    assert any(note.startswith("b.csv is cut off in line") for note in log.notes)
    assert log.rejected["cut off in the last row"] == 1


def test_a_log_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    """By its name or as a copy; parts of one size are no copies."""
    first, second = pieces(columns())
    one, part = write(tmp_path / "a.csv", first), write(tmp_path / "b.csv", second)
    copy = tmp_path / "c.csv"
    copy.write_bytes(one.read_bytes())
    demand_once([one, part])
    for given in ([one, part, one], [one, copy]):
        with pytest.raises(BadInput, match="the same log is given twice"):
            demand_once(given)
