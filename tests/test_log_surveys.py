"""Targets surveyed in a file of their own: the same log as with their places in every row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.log import Log
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput

TARGETS = {"A": (40.0, 0.5, 2.0), "B": (35.0, -8.0, 1.0), "7": (50.0, 6.0, 3.0)}
NAMES = "target_id,target_north_m,target_east_m,target_down_m"
HEAD = (
    "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg,"
    "range_m,azimuth_deg,elevation_deg,target_id"
)


def rows(names: list[str]) -> list[str]:
    found = []
    for k in range(60):
        name = names[k % len(names)]
        found.append(f"{0.1 * k:.3f},{0.3 * k},{np.sin(k)},{-20},1,2,{k},30,4,5,{name}")
    return found


def written(folder: Path, name: str, lines: list[str]) -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def survey(folder: Path, names: list[str]) -> Path:
    lines = ["target_id;target_north_m;target_east_m;target_down_mm"]
    for name in names:
        north, east, down = TARGETS[name]
        lines.append(f"{name};{north};{east};{down * 1e3}".replace(".", ","))
    return written(folder, "survey.csv", lines)


def read(*paths: Path) -> Log:
    return read_log(list(paths), ["uav"])


@pytest.mark.parametrize("names", [["A", "B", "7"], ["7"], ["A", "B"]])
def test_joined_by_name_is_as_if_written_in_every_row(tmp_path: Path, names: list[str]) -> None:
    """Whether the names of the log are words, figures or both, and the survey's likewise."""
    lines = rows(names)
    whole = [
        f"{line},{','.join(str(v) for v in TARGETS[line.rpartition(',')[2]])}" for line in lines
    ]
    head = f"{HEAD},target_north_m,target_east_m,target_down_m"
    oracle = read(written(tmp_path, "whole.csv", [head, *whole]))
    log = written(tmp_path, "log.csv", [HEAD, *lines])
    for files in ([log, survey(tmp_path, list(TARGETS))], [survey(tmp_path, list(TARGETS)), log]):
        found = read(*files)
        assert found.kind == "georeference"
        assert len(found) == 60
        assert np.array_equal(found.truth_m, oracle.truth_m)
        assert any("joined by target_id" in note for note in found.notes)


def test_targets_that_were_not_surveyed_are_left_out_and_said(tmp_path: Path) -> None:
    log = written(tmp_path, "log.csv", [HEAD, *rows(["A", "B", "7"])])
    found = read(log, survey(tmp_path, ["A", "7"]))
    assert (len(found), found.rejected) == (40, {"missing value": 20})
    assert any("20 rows have a target_id of no target" in note for note in found.notes)


def test_a_survey_that_is_not_needed_is_said(tmp_path: Path) -> None:
    lines = [f"{line},1,2,3" for line in rows(["A"])]
    head = f"{HEAD},target_north_m,target_east_m,target_down_m"
    found = read(written(tmp_path, "log.csv", [head, *lines]), survey(tmp_path, ["A"]))
    assert np.all(found.truth_m == [1, 2, 3])
    assert any("not used" in note for note in found.notes)


@pytest.mark.parametrize(
    ("lines", "line", "words"),
    [
        ([NAMES, "A,1,2,3", "A,1,2,4"], 3, "twice"),
        ([NAMES, "A,1,2,"], 2, "no whole place"),
        ([NAMES, ",1,2,3"], 2, "without a name"),
        (["target_id,target_north_m,target_east_m", "A,1,2"], 1, "not whole"),
        ([NAMES, "Z,1,2,3"], 0, "no row of the log"),
        ([NAMES, "A,1,x,3"], 2, "text among"),
    ],
)  # fmt: skip
def test_a_bad_survey_is_refused_at_its_place(
    tmp_path: Path, lines: list[str], line: int, words: str
) -> None:
    log = written(tmp_path, "log.csv", [HEAD, *rows(["A"])])
    with pytest.raises(BadInput) as caught:
        read(log, written(tmp_path, "survey.csv", lines))
    (flaw,) = caught.value.problems
    assert words in flaw.message
    assert (flaw.line, Path(flaw.file).name) == (line, "survey.csv")
