"""`accept` with messages of two times: what receipts near their stamps bear out, and what not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.auditing.run import audit
from tests.acceptance_samples import run
from tests.test_acceptance_clocks import CLOCKED, OWN_CLOCK

Errors = Callable[[np.ndarray, np.random.Generator], np.ndarray]
START_S = 1.7e9


def accepted(folder: Path, log: Path, horizon: str = "1 h") -> tuple[dict[str, Any], int]:
    """The row of the position's timing, of which 2 ms are assumed."""
    (folder / "clocks.yaml").write_text(OWN_CLOCK, "utf-8")
    spec = folder / "clocked.yaml"
    text = CLOCKED.replace("stages:", f"horizon: {{duration: {horizon}}}\nstages:")
    spec.write_text(text, "utf-8")
    done = run("accept", spec, log, "--only", "timing", "-o", "json:-")
    rows = {row["role"]: row for row in json.loads(done.stdout)["assumptions"]}
    return rows["position"], done.exit_code


def messages(
    folder: Path,
    late: Errors,
    transport: Errors,
    length_s: float = 600.0,
    drift_ppm: float = 0.0,
    set_at: float = 0.5,
    *,
    begins: bool = False,
) -> Path:
    """Messages of 10 Hz whose stamps are late by an error, received some transport after them.

    set_at: where in the log a clock that drifts is right.  begins: until then it always is.
    """
    source = np.random.default_rng(17)
    true_s = 0.1 * np.arange(round(10 * length_s))
    stamp_s = true_s + late(true_s, source)
    receive_s = stamp_s + transport(true_s, source)
    since_s = true_s - set_at * length_s
    stamp_s = stamp_s + 1e-6 * drift_ppm * (np.maximum(since_s, 0.0) if begins else since_s)
    rows = sorted(zip(receive_s, stamp_s, strict=True))
    path = folder / "uav_position.csv"
    lines = [f"{START_S + s:.7f},{START_S + r:.7f}" for r, s in rows]
    path.write_text("\n".join(["stamp_s,receive_s", *lines]) + "\n", "utf-8")
    return path


def none(true_s: np.ndarray, _: np.random.Generator) -> np.ndarray:
    return np.zeros(true_s.size)


def waits(true_s: np.ndarray, source: np.random.Generator) -> np.ndarray:
    return source.uniform(1e-4, 3e-4, true_s.size)


@pytest.mark.parametrize(
    ("late", "least_s"),
    [
        pytest.param(lambda t, r: r.uniform(0.0, 8e-3, t.size), 7.9e-3, id="a serial chip's timer"),
        pytest.param(lambda t, r: 3e-3 * r.normal(size=t.size), 15e-3, id="to both sides"),
        pytest.param(lambda t, _: 0.03 * (np.floor(t) % 10 == 3), 29e-3, id="1 s of 10"),
        pytest.param(lambda t, _: 5e-3 * np.sin(t / 9.5), 9.9e-3, id="a swing of a minute"),
    ],
)
def test_receipts_near_late_stamps_bear_nothing_out(
    tmp_path: Path, late: Errors, least_s: float
) -> None:
    """Receipts follow within 0.3 ms, as they come after the stamps whatever these were late by."""
    row, code = accepted(tmp_path, messages(tmp_path, late, waits))
    assert (row["status"], code) == ("not_shown", 3), row
    assert row["measured"]["value"] >= least_s
    assert "an even rhythm within" in row["evidence"]


def test_stamps_without_a_rhythm_are_not_told_from_late_ones(tmp_path: Path) -> None:
    """Of a sensor that is set off at random nothing but the receipts says when it measured."""

    def random(t: np.ndarray, r: np.random.Generator) -> np.ndarray:
        return np.asarray(np.sort(r.uniform(0.0, t[-1], t.size)) - t)

    row, code = accepted(tmp_path, messages(tmp_path, random, waits))
    assert (row["status"], code) == ("not_shown", 3), row
    assert "no even rhythm" in row["evidence"]


def test_what_stays_below_the_bound_is_borne_out(tmp_path: Path) -> None:
    """Stamps late by up to 1 ms by turns, received within 0.3 ms: both within 2 ms."""
    log = messages(tmp_path, lambda t, r: r.uniform(0.0, 1e-3, t.size), waits)
    row, _ = accepted(tmp_path, log)
    assert row["status"] == "holds", row
    assert 0.99e-3 < row["measured"]["value"] < 2e-3


@pytest.mark.parametrize("copy_s", [0.0, 1e-6, 1e-3])
def test_a_copy_of_the_stamp_is_no_second_time(tmp_path: Path, copy_s: float) -> None:
    def alike(true_s: np.ndarray, source: np.random.Generator) -> np.ndarray:
        return copy_s + 1e-7 * source.integers(0, 3, true_s.size)

    log = messages(tmp_path, none, alike if copy_s else none)
    row, code = accepted(tmp_path, log)
    assert (row["status"], code) == ("not_shown", 3), row
    assert "copies of the stamps" in row["evidence"]
    (stream,) = audit([log]).streams
    assert stream.copied
    assert "copies do" in stream.cannot_show[0] or "is a copy" in stream.cannot_show[0]


def test_receipts_of_whole_milliseconds_that_follow_their_stamps_may_be_copies(
    tmp_path: Path,
) -> None:
    """Receipts cut off to 1 ms that move by less than that against even stamps say no more."""
    log = messages(tmp_path, lambda t, _: 3.7e-5 * (np.arange(t.size) % 7), waits)
    lines = log.read_text("utf-8").splitlines()
    cut = [f"{line.split(',')[0]},{line.split(',')[0][:-4]}" for line in lines[1:]]
    log.write_text("\n".join([lines[0], *cut]) + "\n", "utf-8")
    row, _ = accepted(tmp_path, log)
    assert (row["status"], "copies of the stamps" in row["evidence"]) == ("not_shown", True), row


@pytest.mark.parametrize(
    ("length_s", "horizon", "status"),
    [(10.0, "1 h", "not_shown"), (10.0, "9 s", "holds"), (7.0, "1 h", "not_shown"),
     (30.0, "1 h", "not_shown"), (30.0, "1 min", "holds"), (600.0, "1 h", "holds")],
)  # fmt: skip
def test_a_log_is_held_against_the_horizon(
    tmp_path: Path, length_s: float, horizon: str, status: str
) -> None:
    """20 ppm make 72 ms in an hour and 0.1 ms in 7 s: too short a log bears an hour out for no
    sensor, whether its stamps drift or not."""
    row, _ = accepted(tmp_path, messages(tmp_path, none, waits, length_s), horizon)
    assert row["status"] == status, row
    assert ("horizon" in row["evidence"]) == (status == "not_shown")
    if status == "not_shown":
        drifting = messages(tmp_path, none, waits, length_s, 1.0)  # 3.6 ms in an hour
        assert accepted(tmp_path, drifting, horizon)[0]["status"] != "holds"


@pytest.mark.parametrize(
    ("length_s", "horizon", "status", "grown_s"),
    [
        (1800.0, "5 min", "holds", 0.9e-3),  # 5.4 ms over the log
        (1800.0, "20 min", "broken", 3.6e-3),
        (600.0, "5 min", "holds", 0.9e-3),
        (600.0, "1 h", "broken", 10.8e-3),  # 1.8 ms over the log
        (480.0, "8 min", "holds", 1.44e-3),
    ],
)
def test_a_drift_counts_over_the_horizon(
    tmp_path: Path, length_s: float, horizon: str, status: str, grown_s: float
) -> None:
    """3 ppm are 3e-6 times the horizon, whatever the log's length, of 2 ms that are assumed."""
    for ppm in (3.0, -3.0):
        log = messages(tmp_path, none, waits, length_s, ppm, set_at=0.0)
        row, _ = accepted(tmp_path, log, horizon)
        demand_counted(row, length_s, horizon, (status, grown_s))


def demand_counted(
    row: dict[str, Any], length_s: float, horizon: str, expected: tuple[str, float]
) -> None:
    status, grown_s = expected
    assert row["status"] == status, row
    if status == "broken":
        assert row["measured"]["value"] == pytest.approx(grown_s, rel=0.02)
    else:  # transport of 0.1 to 0.3 ms adds to it, or takes from it where stamps run ahead
        assert row["measured"]["value"] == pytest.approx(grown_s, abs=0.32e-3)
    amount, unit = horizon.split()
    told = f"over the spec's horizon of {horizon}" in row["evidence"]
    assert told == (length_s != float(amount) * {"min": 60.0, "h": 3600.0}[unit])


@pytest.mark.parametrize(("horizon", "status"), [("1 h", "broken"), ("5 min", "holds")])
def test_a_drift_that_began_within_the_log_goes_on(
    tmp_path: Path, horizon: str, status: str
) -> None:
    """A pulse that was lost half way: 3 ppm made 0.9 ms by the end of the log, of 2 ms, and make
    10.8 ms in an hour."""
    log = messages(tmp_path, none, waits, 600.0, 3.0, begins=True)
    row, _ = accepted(tmp_path, log, horizon)
    assert row["status"] == status, row
