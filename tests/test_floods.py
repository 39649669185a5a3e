"""Files made to keep the program busy are refused in bounded time, pipes are not waited for."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from simulation_systems import survey
from syncline_design.machine.deadline import Deadline, OutOfTime, within
from syncline_design.simulation.worst_case import worst_cases
from syncline_design.spec.load import BadInput, load_text
from syncline_design.studies import StudySettings, load_study, run_study
from test_study_inputs import BELOW, GRID, OWN, SPEC, STUDY, track

ROOT = Path(__file__).resolve().parent.parent
COUNT = 100_000
FLOODS = {
    "blanks in a quantity": "3" + " " * COUNT + "cm",
    "blanks and tolerances": "1 +/- " * (COUNT // 6),
    "ranges": "1 .. " * (COUNT // 5),
    "slashes": "+/-" * COUNT,
    "digits": "1" * COUNT,
    "colons": "1:" * COUNT,
    "brackets": "a [" * COUNT,
    "exponents": "1e" * COUNT,
}
PLACES = (
    "horizon: {duration: FLOOD}", "coverage_factor: FLOOD", "catalogs: [FLOOD]", "FLOOD: 1",
    "log: {files: [FLOOD], columns: {roll_deg: FLOOD}}", "currency: FLOOD",
    "effects: [{effect: FLOOD, sensor: FLOOD, parameters: {FLOOD: FLOOD}}]",
    "timestamping: {candidates: [FLOOD]}", "monte_carlo: {samples: FLOOD}",
)  # fmt: skip


@pytest.mark.parametrize("flood", FLOODS.values(), ids=FLOODS.keys())
def test_no_value_of_a_spec_takes_long_to_refuse(flood: str) -> None:
    """A second of processor time over all places together; the worst took 34 s in one."""
    spec = (ROOT / "specs" / "position_track.yaml").read_text()
    started = time.process_time()
    for place in PLACES:
        text = spec + "\n" + place.replace("FLOOD", json.dumps(flood)) + "\n"
        with pytest.raises(BadInput) as caught:
            load_text(text, ROOT / "specs" / "flooded.yaml")
        assert len(str(caught.value)) < 10_000
    assert time.process_time() - started < 2.0


def write(folder: Path, study: str = STUDY) -> Path:
    (folder / "more").mkdir()
    for name, text in (
        ("spec.yaml", SPEC), ("own.yaml", OWN), ("more/below.yaml", BELOW), ("study.yaml", study),
        ("delays.txt", "ms\n1.1\n"), ("others.txt", "ms\n1.5\n"), ("more/logger.txt", "us\n7\n"),
        ("path.csv", track()),
    ):  # fmt: skip
        (folder / name).write_text(text)
    return folder / "study.yaml"


@pytest.mark.parametrize("name", ["spec.yaml", "own.yaml", "more/below.yaml", "delays.txt",
                                  "more/logger.txt", "path.csv", "study.yaml"])  # fmt: skip
@pytest.mark.parametrize("kind", ["a pipe", "a folder", "a device"])
def test_a_study_does_not_wait_for_what_is_no_file(tmp_path: Path, name: str, kind: str) -> None:
    path = write(tmp_path)
    place = tmp_path / name
    place.unlink()
    if kind == "a pipe":
        os.mkfifo(place)
    elif kind == "a folder":
        place.mkdir()
    else:
        place.symlink_to("/dev/zero")
    with pytest.raises(BadInput):
        load_study(path)


def test_nor_does_a_case_whose_file_the_grid_names(tmp_path: Path) -> None:
    path = write(tmp_path, GRID)
    (tmp_path / "others.txt").unlink()
    os.mkfifo(tmp_path / "others.txt")
    result = run_study(path, StudySettings(workers=1))
    assert result.counts["refused"] == 2
    problems = [p for c in result.cases() for p in c.record.problems]
    assert problems
    assert all("not a regular file" in problem.message for problem in problems)


LONG_LISTS = {
    "strangers owned": ", ".join(f"x{k}" for k in range(12_000)),
    "one thing owned": ", ".join(["ublox_f9p_rtk"] * 12_000),
}


@pytest.mark.parametrize("listed", LONG_LISTS.values(), ids=LONG_LISTS.keys())
def test_no_long_list_takes_long_to_refuse(listed: str) -> None:
    """Every entry was held against all before it, and a like one looked for among all that is."""
    spec = (ROOT / "specs" / "position_track.yaml").read_text()
    started = time.process_time()
    with pytest.raises(BadInput, match=r"owned\[\d+\]: (nothing to own|owned twice)"):
        load_text(f"{spec}\nowned: [{listed}]\n", ROOT / "specs" / "flooded.yaml")
    assert time.process_time() - started < 3.0


def test_thousands_of_effects_are_refused() -> None:
    """Each acts on every simulated sample: 15 000 of them in 1 MB kept `check` busy for minutes."""
    spec = (ROOT / "specs" / "position_track.yaml").read_text()
    one = "  - {effect: latency, sensor: position, parameters: {latency_s: 1 us}}\n"
    for count, taken in ((1_000, True), (1_001, False), (15_000, False)):
        text = f"{spec}\neffects:\n{one * count}"
        if taken:
            assert load_text(text, ROOT / "specs" / "flooded.yaml")
            continue
        with pytest.raises(BadInput, match=f"too many entries; expected at most 1000, .*{count}"):
            load_text(text, ROOT / "specs" / "flooded.yaml")


def test_thousands_of_stages_and_requirements_are_refused() -> None:
    """8 000 stages or 20 000 simulated requirements, 1 MB each, kept `check` busy for minutes."""
    spec = (ROOT / "specs" / "position_track.yaml").read_text()
    head, stages = spec.split("stages:\n")
    limits = "".join(
        f"  - {{id: Q-{k}, kind: monte_carlo, quantile: {k / 4000}, limit: 9 m}}\n"
        for k in range(1, 1001)
    )
    with pytest.raises(BadInput, match="too many entries; expected at most 1000"):
        load_text(f"{head}{limits}stages:\n{stages}", ROOT / "specs" / "flooded.yaml")
    one = "platform: usv, attitude: {sensor: sbg_apogee}, ranging: {sensor: riegl_vux1uav}"
    for count, taken in ((32, True), (33, False), (8_000, False)):
        chain = "".join(f"  - {{name: s{k}, {one}}}\n" for k in range(1, count))
        first = f"  - {{name: s0, position: {{sensor: ublox_f9p_rtk}}, {one}}}\n"
        text = f"{head}stages:\n{first}{chain}timestamping: {{candidates: [hardware]}}\n"
        if taken:
            assert load_text(text, ROOT / "specs" / "flooded.yaml")
            continue
        with pytest.raises(BadInput, match=f"too many entries; expected at most 32, .*{count}"):
            load_text(text, ROOT / "specs" / "flooded.yaml")


def test_the_search_for_the_worst_case_keeps_the_time_limit() -> None:
    """With 64 stages it took minutes beyond a limit of 3 s."""
    system = survey()
    assert worst_cases(system, np.array([1e-3]), seed=0)
    with within(Deadline(0.0)), pytest.raises(OutOfTime):
        worst_cases(system, np.array([1e-3]), seed=0)
