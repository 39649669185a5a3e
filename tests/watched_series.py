"""Runs of a linear log with known values, in a store that `watch` reads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from jsonschema import Draft202012Validator
from typer.testing import CliRunner, Result

from syncline_design.campaign.kept import NamedAlone, Run, date_of, statistics_of
from syncline_design.campaign.store import add_run
from syncline_design.cli.app import app
from syncline_design.diagnosis.sufficient import Less, Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests.world import make_log, scenario

LABELS = (
    ("latency", "position", 0, "latency_s"),
    ("range_bias", "ranging", 0, "bias_m"),
    ("datum_offset", "target", 0, "north_m"),
    ("datum_offset", "target", 0, "east_m"),
    ("datum_offset", "target", 0, "down_m"),
)
UNITS = np.array([1e-3, 1e-2, 1e-2, 1e-2, 1e-2])
ROWS, BLOCKS, DAY = 64, 8, 86_400.0
BOUND = UNITS / np.sqrt(ROWS)  # standard deviation of a parameter by one run, roughly
FIRST = 1.79e9


def statistics(
    rng: np.random.Generator, values: np.ndarray, alike: float = 0.0, still: float = 0.0
) -> Sufficient:
    """Of a linear log with unit noise; alike: cosine of latency and the datum's north; still: by
    how much less it shows the latency, 1 for a vehicle at rest."""
    columns = rng.standard_normal((ROWS, len(LABELS)))
    columns[:, 2] = alike * columns[:, 0] + np.sqrt(1.0 - alike**2) * columns[:, 2]
    columns /= UNITS
    columns[:, 0] *= 1.0 - still
    whole = np.column_stack([columns, columns @ values + rng.standard_normal(ROWS)])
    total = whole.T @ whole
    less = np.array([total - part.T @ part for part in np.split(whole, BLOCKS)])
    return Sufficient(
        LABELS, total[:-1, :-1], total[:-1, -1], float(total[-1, -1]), total[:-1, :-1] / ROWS,
        (Less(less[:, :-1, :-1], less[:, :-1, -1], less[:, -1, -1]),),
    )  # fmt: skip


def run_of(
    found: Sufficient, day: int, date: bool = True, named: tuple[NamedAlone, ...] = ()
) -> Run:
    first = (FIRST if date else 0.0) + DAY * day
    return Run(
        (f"day{day}.csv",), f"{day:064d}", "georeference", first, date_of(first), 60.0, ROWS, ROWS,
        {}, "agrees", 0.0, False, 0.05, {"car/position": 1.0}, named, "0", **statistics_of(found),
    )  # fmt: skip


def series(seed: int, runs: int, change: np.ndarray, since: int) -> list[Sufficient]:
    rng = np.random.default_rng(seed)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))  # of the build, whatever it is
    return [statistics(rng, base + (change if k >= since else 0.0)) for k in range(runs)]


def car_spec(path: Path) -> Path:
    """The spec of a car, written there."""
    path.write_text(make_log(scenario("car_stops", 4, 20.0, 5.0), ()).spec_yaml(), encoding="utf-8")
    return path


def kept(spec: Path, folder: Path, runs: list[Run]) -> Path:
    store, case = folder / "store.jsonl", load(spec)
    for run in runs:
        add_run(store, "car", pinned_system(case), run)
    return store


def watch(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["watch", *map(str, arguments)])


def told(spec: Path, store: Path, folder: Path, code: int) -> dict:
    out, page = folder / "watch.json", folder / "watch.html"
    found = watch(store, spec, "-o", f"json:{out}", "-o", f"html:{page}")
    assert found.exit_code == code, found.output
    document = dict(json.loads(out.read_text("utf-8")))
    Draft202012Validator(result_schema("watch")).validate(document)
    return document
