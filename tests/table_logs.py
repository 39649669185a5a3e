"""A short log in many dresses, to be read as the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from syncline_design.logs.log import Log
from syncline_design.logs.reading import read_log
from tests.test_diagnose_log import columns

AXES = ("north", "east", "down")


def read(path: Path, mapping: dict[str, str] | None = None) -> Log:
    return read_log([path], ["uav"], mapping or {})


def same(left: Log, right: Log) -> None:
    assert left.time_s == pytest.approx(right.time_s, abs=1e-9)
    assert left.truth_m == pytest.approx(right.truth_m, abs=1e-8, nan_ok=True)
    for a, b in zip(left.stages, right.stages, strict=True):
        assert a.euler_rad == pytest.approx(b.euler_rad, abs=1e-10)
        assert a.range_m == pytest.approx(b.range_m, abs=1e-8)
        assert a.antenna_m == pytest.approx(b.antenna_m, abs=1e-8)


def written(path: Path, separator: str = ",", decimal: str = ".", head: str = "") -> Path:
    made = columns()
    rows = [
        [f"{v:.10f}".replace(".", decimal) for v in row] for row in zip(*made.values(), strict=True)
    ]
    text = "\n".join(separator.join(row) for row in [list(made), *rows])
    path.write_text(head + text + "\n", encoding="utf-8")
    return path
