"""Logs that are unlike the others, and runs of a store that are counted no more."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.oddities import scattering
from syncline_design.campaign.pool import Pool, Scoped, fitted, pool_of
from syncline_design.campaign.store import add_run, read_store
from syncline_design.campaign.unlike import _difference, unlike_logs
from syncline_design.diagnosis.finding import estimate
from syncline_design.diagnosis.result import UnlikeOthers
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.report.on_joint import unlike_words
from syncline_design.spec.load import BadInput, load
from tests.test_joint import UNITS, made, statistics
from tests.watched_series import BOUND, car_spec, kept, run_of, series, told, watch
from tests.watched_series import statistics as day_of


def logs_of(values: list[np.ndarray], rng: np.random.Generator) -> tuple[Pool, list[np.ndarray]]:
    """Logs with these values of all parameters, and what least squares makes of each alone."""
    rows = [made(rng, one) for one in values]
    alone = [np.linalg.lstsq(x, e, rcond=None)[0] for x, e in rows]
    return pool_of([statistics(*one) for one in rows], list(range(len(rows)))), alone


def test_the_one_log_that_differs_is_found_with_its_effect() -> None:
    """Three of one value and one of the opposite sign; by how much, as least squares has it."""
    same = np.array([0.6, 0.0, 0.0, 0.0, 0.0]) * UNITS
    pool, alone = logs_of([same, same, -same, same], np.random.default_rng(3))
    named = [t for t in pool.terms if t.label[0] == "latency"]
    (one,) = unlike_logs(pool, named)
    assert one.run == 2
    assert one.term.label[0] == "latency"
    apart = alone[2][0] - np.mean([alone[k][0] for k in (0, 1, 3)])
    spread = float(one.judged.spread[0])
    assert abs(float(one.judged.values[0]) - apart) < 1.5 * spread
    assert one.log_p < -10.0


def test_what_a_log_differs_by_is_known_though_neither_value_is() -> None:
    """A bias whose column is nearly that of a common latency: each value of it is uncertain by 17
    times what they differ by.  Stacked least squares: x'(X'X)^-1 x, x = (0, -1, 1)."""
    rng, rows = np.random.default_rng(8), []
    for sign in (1.0, 1.0, -1.0, 1.0):
        columns = rng.standard_normal((64, 5)) / UNITS
        columns[:, 4] = (columns[:, 0] * UNITS[0] + 0.02 * rng.standard_normal(64)) / UNITS[4]
        late = np.array([0.6 * sign, 0.0, 0.0, 0.0, 0.0]) * UNITS
        rows.append((columns, columns @ late + rng.standard_normal(64)))
    pool = pool_of([statistics(*one) for one in rows], [0, 0, 1, 0])
    latency, bias = (next(t for t in pool.terms if t.label[0] == n)
                     for n in ("latency", "range_bias"))  # fmt: skip
    apart = fitted(pool, [Scoped(latency, "build"), Scoped(bias, "start")])
    design = np.concatenate([
        np.column_stack([x[:, 0], x[:, 4] * (k != 2), x[:, 4] * (k == 2)])
        for k, (x, _) in enumerate(rows)
    ])  # fmt: skip
    covariance = np.linalg.inv(design.T @ design)
    told = np.array([0.0, -1.0, 1.0])
    found = _difference(apart)
    assert found.model[0, 0] == pytest.approx(told @ covariance @ told, rel=1e-6)
    assert covariance[1, 1] > 300.0 * found.model[0, 0]
    # and the effect that is named is the latency, which needs no parameter more
    whole = pool_of([statistics(*one) for one in rows], list(range(4)))
    (one,) = unlike_logs(whole, [t for t in whole.terms if t.label[0] == "latency"])
    assert (one.run, one.term.label[0]) == (2, "latency")


def test_the_parts_of_one_vector_are_told_in_one_unit() -> None:
    """A centimetre beside a part that is nearly nothing: no `-148 ± 3540 µm`."""
    names = ("x_m", "y_m", "z_m")
    figures = ((0.296, 0.010), (-0.205, 0.003), (-0.000148, 0.00354))
    differs = {n: estimate(v, s, "m") for n, (v, s) in zip(names, figures, strict=True)}
    one = UnlikeOthers(4, ("d.csv",), "lever_arm", "position", "car", differs, -12.0)
    said = unlike_words(one)
    assert "x by 29.6 ± 1.0 cm, y by -20.5 ± 0.3 cm and z by 0.0 ± 0.4 cm" in said.replace(
        "-0.0", "0.0"
    )


def test_another_value_in_every_log_is_no_odd_one() -> None:
    spread = [np.array([x, 0.0, 0.0, 0.0, 0.0]) * UNITS for x in (-1.5, -0.5, 0.6, 1.6)]
    pool, _ = logs_of(spread, np.random.default_rng(5))
    assert unlike_logs(pool, [t for t in pool.terms if t.label[0] == "latency"]) == ()


@pytest.mark.parametrize("count", [3, 6])
def test_alike_logs_are_said_to_differ_as_seldom_as_stated(count: int) -> None:
    """1 % of sets of alike logs: of 300, more than 9 have a chance of 0.1 %."""
    rng = np.random.default_rng(count)
    same = np.array([0.5, 0.3, 0.0, -0.4, 0.2]) * UNITS
    said = 0
    for _ in range(300):
        pool, _ = logs_of([same] * count, rng)
        said += bool(unlike_logs(pool, pool.terms))
    assert said <= 9


def test_two_logs_or_shared_starts_have_no_odd_one() -> None:
    same = np.array([0.6, 0.0, 0.0, 0.0, 0.0]) * UNITS
    pool, _ = logs_of([same, -same], np.random.default_rng(3))
    assert unlike_logs(pool, pool.terms) == ()


def said_to_differ(runs: list[Sufficient]) -> bool:
    """Whether any look at a series says that an effect has another value in every run."""
    changes = Changes(pool_of(runs, list(range(len(runs)))))
    looks = range(3, len(runs) + 1)
    return any(list(scattering(changes, (), look)) for look in looks)


def test_four_runs_that_scatter_by_chance_are_not_said_to_differ() -> None:
    """What is freed for caution's sake, from three standard deviations of Q on, is not said yet:
    of three degrees of freedom that is one in sixty by chance, of each of many effects."""
    turns = np.array([1.0, -1.0, 1.0, -1.0])

    def runs(size: float) -> list[Sufficient]:
        rng = np.random.default_rng(2)
        first = np.eye(5)[0]
        return [day_of(rng, size * t * BOUND * first) for t in turns]

    for size in np.arange(0.5, 8.0, 0.25):
        if Changes(pool_of(runs(size), [0, 1, 2, 3])).differing(4):
            break
    assert not said_to_differ(runs(size))
    assert said_to_differ(runs(4.0 * size))


def test_a_run_that_is_left_out_is_counted_no_more_and_said(tmp_path: Path) -> None:
    """A store with one wild run rings; left out it does not, the line is chained, and every later
    look says so."""
    spec = car_spec(tmp_path / "car.yaml")
    found_in = series(4, 6, np.array([20.0, 0, 0, 0, 0]) * BOUND, 5)
    runs = [run_of(one, k) for k, one in enumerate(found_in)]
    store = kept(spec, tmp_path, runs)
    assert told(spec, store, tmp_path, 1)["verdict"] == "alarm"
    before = store.read_bytes()
    missing = watch(store, "--leave-out", "6")
    assert missing.exit_code == 2
    assert "--reason" in missing.output
    said = watch(store, "--leave-out", "6", "--reason", "another vehicle")
    assert said.exit_code == 0
    assert store.read_bytes().startswith(before)
    found = told(spec, store, tmp_path, 0)
    assert found["verdict"] == "unchanged"
    assert any("run 6" in one and "another vehicle" in one for one in found["cautions"])
    assert [one.get("left_out") for one in found["runs"]] == [None] * 5 + [True]
    stored = read_store(store)
    assert stored is not None
    assert [one.number for one in stored.counted] == [1, 2, 3, 4, 5]
    assert watch(store, "--leave-out", "6", "--reason", "again").exit_code == 2
    assert watch(store, "--leave-out", "7", "--reason", "none").exit_code == 2
    lines = store.read_text(encoding="ascii").splitlines()
    at = next(k for k, one in enumerate(lines) if json.loads(one)["body"]["kind"] == "left_out")
    forged = [*lines[:at], lines[at].replace("another vehicle", "a vehicle"), *lines[at + 1 :]]
    store.write_text("\n".join(forged) + "\n", encoding="ascii")
    assert watch(store, spec).exit_code == 2


def test_a_run_that_was_left_out_is_taken_back_and_both_are_told(tmp_path: Path) -> None:
    """It rings, does not without the run, and rings again; the file only grows."""
    spec = car_spec(tmp_path / "car.yaml")
    found_in = series(4, 6, np.array([20.0, 0, 0, 0, 0]) * BOUND, 5)
    store = kept(spec, tmp_path, [run_of(one, k) for k, one in enumerate(found_in)])
    first = told(spec, store, tmp_path, 1)
    for run, words in (("6", "not left out"), ("7", "there is no run 7")):
        refused = watch(store, "--take-back", run, "--reason", "x")
        assert refused.exit_code == 2
        assert words in refused.output + refused.stderr
    assert watch(store, "--leave-out", "6", "--reason", "another vehicle").exit_code == 0
    told(spec, store, tmp_path, 0)
    before = store.read_bytes()
    for words in (("--take-back", "6"), ("--take-back", "6", "--accept", "--reason", "x")):
        assert watch(store, *words).exit_code == 2
    assert store.read_bytes() == before
    said = watch(store, "--take-back", "6", "--reason", "a wrong label")
    assert said.exit_code == 0, said.output
    assert store.read_bytes().startswith(before)
    again = told(spec, store, tmp_path, 1)
    assert again["alarms"] == first["alarms"]
    assert all("left_out" not in one for one in again["runs"])
    for page in (again["cautions"][0], (tmp_path / "watch.html").read_text("utf-8")):
        assert "run 6 (day5.csv) counts again since" in page
        assert "a wrong label" in page
        assert "another vehicle" in page
    assert watch(store, "--leave-out", "6", "--reason", "after all").exit_code == 0
    (out,) = [one for one in told(spec, store, tmp_path, 0)["cautions"] if "run 6" in one]
    assert out.endswith(": after all")


def test_another_run_of_the_time_of_one_that_is_left_out_may_be_added(tmp_path: Path) -> None:
    """A log with wrong columns, and the same drive exported anew; one of them counts."""
    spec = car_spec(tmp_path / "car.yaml")
    runs = [run_of(one, k) for k, one in enumerate(series(4, 4, 0.0 * BOUND, 9))]
    anew = replace(runs[3], first_s=runs[2].first_s, date=runs[2].date, files=("day2b.csv",))
    store, case = kept(spec, tmp_path, runs[:3]), load(spec)
    with pytest.raises(BadInput, match="--leave-out 3"):
        add_run(store, "car", pinned_system(case), anew)
    assert watch(store, "--leave-out", "3", "--reason", "wrong columns").exit_code == 0
    with pytest.raises(BadInput, match=r"left out since .*--take-back 3"):
        add_run(store, "car", pinned_system(case), runs[2])
    add_run(store, "car", pinned_system(case), anew)
    refused = watch(store, "--take-back", "3", "--reason", "both")
    assert refused.exit_code == 2
    assert "of the same time as run 4" in " ".join((refused.output + refused.stderr).split())
    assert watch(store, "--leave-out", "4", "--reason", "the first was right").exit_code == 0
    assert watch(store, "--take-back", "3", "--reason", "the first was right").exit_code == 0
    nothing = tmp_path / "none.jsonl"
    assert watch(nothing, "--leave-out", "1", "--reason", "x").exit_code == 2
    assert not nothing.exists()
