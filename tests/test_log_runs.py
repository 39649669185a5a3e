"""Two runs in one file are refused; one run in any order of its rows is read as it is sorted.

The oracle is the same log sorted by this file, and for runs the rows at which they were joined.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput
from tests.test_diagnose_log import NAMES, read, refusal, write

COUNT = 120


def run(start: float, seed: int, count: int = COUNT, step_s: float = 0.1) -> dict[str, np.ndarray]:
    """A vehicle under way from `start` seconds of its path on; its stamps begin at 0."""
    rng = np.random.default_rng(seed)
    made = {name: rng.uniform(-10, 10, count) for name in NAMES}
    made["time_s"] = np.arange(count) * step_s + rng.uniform(0, 0.01, count)
    at = made["time_s"] + start
    made["position_north_m"] = 30 * np.sin(0.2 * at) + rng.normal(0, 0.02, count)
    made["position_east_m"] = 30 * np.cos(0.17 * at) + rng.normal(0, 0.02, count)
    made["position_down_m"] = -30 + rng.normal(0, 0.03, count)
    made["target_id"] = (np.arange(count) % 3).astype(float)
    return made


def joined(*runs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([one[name] for one in runs]) for name in runs[0]}


def ordered(made: dict[str, np.ndarray], order: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[order] for name, values in made.items()}


@pytest.mark.parametrize("later_s", [4.0, 12.0, 300.0])
def test_stamps_that_start_again_elsewhere_are_refused(tmp_path: Path, later_s: float) -> None:
    """Sorted into each other, they named a scatter of the stamps of 60 ms that was not there."""
    path = write(tmp_path / "two.csv", joined(run(0, 1), run(later_s, 2)))
    said = refusal(path)
    assert f"two runs in one file: the stamps start again in row {COUNT + 1}" in said
    assert "split the file there" in said


def test_three_runs_and_a_fleet_of_stages_are_refused(tmp_path: Path) -> None:
    three = joined(run(0, 1, 60), run(9, 2, 60), run(21, 3, 60))
    assert "in row 61" in refusal(write(tmp_path / "three.csv", three))
    chain = {
        (f"vessel_{n}" if n.startswith("position") else n): v
        for n, v in joined(run(0, 1), run(50, 2)).items()
    }
    path = write(tmp_path / "chain.csv", chain)
    with pytest.raises(BadInput, match="two runs in one file"):
        read_log([path], ["vessel", "auv"])


def test_runs_in_wgs_84_are_told_too(tmp_path: Path) -> None:
    made = joined(run(0, 1), run(40, 2))
    made["latitude_deg"] = 47 + made.pop("position_north_m") / 111_200
    made["longitude_deg"] = 8 + made.pop("position_east_m") / 76_000
    made["height_m"] = -made.pop("position_down_m")
    path = tmp_path / "geo.csv"
    lines = [",".join(made)] + [
        ",".join(f"{v:.14g}" for v in row) for row in zip(*made.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "two runs in one file" in refusal(path)


@pytest.mark.parametrize("kind", ["targets", "seen in spells", "parts", "shuffled", "scans"])
def test_one_run_in_any_order_is_one_run(tmp_path: Path, kind: str) -> None:
    made = run(0, 5, 600)
    rng = np.random.default_rng(6)
    if kind == "scans":  # all three targets at every stamp, one target after the other in the file
        made = joined(*[{**made, "target_id": made["target_id"] * 0 + k} for k in range(3)])
    by_target = np.lexsort((made["time_s"], made["target_id"]))
    if kind == "seen in spells":
        made["target_id"] = (np.arange(600) // 50 % 3).astype(float)
        by_target = np.lexsort((made["time_s"], made["target_id"]))
    order = {
        "parts": np.roll(np.arange(600), 217),
        "shuffled": rng.permutation(600),
    }.get(kind, by_target)
    log = read(write(tmp_path / "mixed.csv", ordered(made, order)))
    rising = np.argsort(made["time_s"], kind="stable")
    plain = read(write(tmp_path / "plain.csv", ordered(made, rising)))
    assert log.time_s == pytest.approx(plain.time_s)
    assert log.rejected == plain.rejected
    if kind != "scans":  # there the order within a stamp is the file's
        assert log.stages[0].range_m == pytest.approx(plain.stages[0].range_m)


@pytest.mark.parametrize("seed", range(4))
def test_a_file_in_no_order_is_put_in_order(tmp_path: Path, seed: int) -> None:
    """Half of its steps lead back, now more and now less."""
    made = run(0, 5, 120)
    order = np.random.default_rng(seed).permutation(120)
    log = read(write(tmp_path / "mixed.csv", ordered(made, order)))
    assert log.time_s == pytest.approx(np.sort(made["time_s"]))


def test_a_parked_vehicle_may_start_again(tmp_path: Path) -> None:
    made = joined(run(0, 1), run(80, 2))
    for axis, value in (("north", 3.0), ("east", 4.0), ("down", -1.0)):
        rng = np.random.default_rng(9)
        made[f"position_{axis}_m"] = np.round(value + rng.normal(0, 0.004, 2 * COUNT), 2)
    assert read(write(tmp_path / "parked.csv", made)).time_s.shape[0] == 2 * COUNT
