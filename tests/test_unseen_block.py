"""A block of the log that nothing has seen, and what is left in the span of the dictionary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.remainder import Remainder, remainder
from syncline_design.diagnosis.search import SearchResult
from syncline_design.diagnosis.searched import started
from syncline_design.diagnosis.spans import StampSpan
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.diagnosis.unseen_block import unseen_block
from syncline_design.logs.log import Log
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.report.numbers import from_to
from syncline_design.report.on_gap import _unseen_text
from syncline_design.spec.load import load
from tests.world import Hidden, WorldLog, hidden, make_log, scenario


@pytest.fixture(autouse=True)
def _small_matrices() -> Iterator[None]:
    with one_thread():
        yield


LATE = hidden("latency", "position", latency_s=0.05)


def inputs_of(log: WorldLog, folder: Path) -> Measured:
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    return measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])


def world(*effects: Hidden) -> WorldLog:
    return make_log(scenario("car_stops", 6, 60.0, 8.0), effects)


def test_the_block_is_in_nothing_that_was_found_without_it(tmp_path: Path) -> None:
    log = world(LATE)
    inputs = inputs_of(log, tmp_path)
    search = started(inputs, inputs.log, DiagnosisSettings())
    result = search.run()
    stamps: list[float] = []

    def spied(rows: Log) -> object:
        stamps.extend(rows.time_s)
        return started(inputs, rows, DiagnosisSettings())

    block = unseen_block(search.data, result, spied)  # type: ignore[arg-type]
    assert block is not None
    assert not [s for s in stamps if block.from_s - 0.5 < s < block.to_s + 0.5]
    assert len(stamps) > 3 * block.rows
    assert block.found == ("latency (position)",)
    inside = (inputs.log.time_s >= block.from_s) & (inputs.log.time_s <= block.to_s)
    assert int(inside.sum()) == block.rows
    by_the_world = float(np.sqrt(np.mean(np.sum(log.error()[inside] ** 2, axis=1))))
    assert block.before.rms_m == pytest.approx(by_the_world, rel=1e-3)
    assert block.after.rms_m < 1.15 * block.expected_rms_m < 0.5 * block.before.rms_m
    assert block.closed_fraction is not None
    assert block.closed_fraction > 0.95
    words = _unseen_text(block)
    assert "names latency (position)" in words
    assert from_to(block.from_s, block.to_s) in words


def test_where_nothing_moves_the_mean_no_block_is_kept_back(tmp_path: Path) -> None:
    inputs = inputs_of(world(), tmp_path)
    search = started(inputs, inputs.log, DiagnosisSettings())
    base = fit(search.data)
    result = SearchResult(base, search.settled(base))
    assert unseen_block(search.data, result, lambda _: search) is None


def test_what_the_rest_does_not_bear_out_goes(tmp_path: Path) -> None:
    inputs = inputs_of(world(), tmp_path)
    search = started(inputs, inputs.log, DiagnosisSettings())
    bias = next(c for c in search.proposals.candidates if c.label[:2] == ("range_bias", "ranging"))
    claimed = fit(search.data, [bias.acting({"bias_m": 0.02})])
    assert claimed.labels == (bias.label,)
    assert search.confirmed(claimed).labels == ()
    late = float(search.data.view.log.time_s[-1]) + 1.0  # only in a block that was held out
    part = replace(claimed.acting[0], effect=StampSpan(bias.effect, late, late + 5.0).cut)
    elsewhere = fit(search.data, [part])
    assert search.confirmed(elsewhere).labels == ()


def left_in(log: WorldLog, folder: Path) -> Remainder:
    inputs = inputs_of(log, folder)
    search = started(inputs, inputs.log, DiagnosisSettings())
    rng = np.random.default_rng(3)
    return remainder(search.data, fit(search.data), rng, search.proposals.candidates)


def test_what_is_left_in_the_span_of_the_dictionary_is_seen(tmp_path: Path) -> None:
    clean, two = tmp_path / "clean", tmp_path / "two"
    clean.mkdir()
    two.mkdir()
    assert left_in(world(), clean).p_span > 1e-3
    some = left_in(
        world(
            hidden("latency", "attitude", latency_s=0.006),
            hidden("range_scale", "ranging", scale=0.0012),
        ),
        two,
    )
    assert some.p_span < 1e-6
    assert some.p <= 5.0 * some.p_span
