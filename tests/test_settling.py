"""What stays in the final model: every effect bears its own evidence, the last one as well."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from syncline_design.diagnosis.candidates import candidates, directed_parts
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import Data, data_of, fit
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.settling import Settled, settle
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.spans import StampSpan
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.trials import log_chance
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.spec.load import load
from tests.world import Hidden, hidden, make_log, scenario

LABEL = ("latency", "position", 0)
LATENCY_S = 0.03
LIMIT = math.log(1e-3)  # of the chance that noise alone does as well, for this one effect


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> Iterator[None]:
    with one_thread():
        yield


def _settled(folder: Path, truth: tuple[Hidden, ...]) -> Settled:
    """The final model, begun with a latency that noise of another kind does not speak against."""
    log = make_log(scenario("multirotor_lines", 3, 60.0, 5.0), truth)
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log, inputs.known)
    found = candidates(view)
    data: Data = data_of(view, structure_of(view, directed_parts(view, found)))
    one: Acting = next(c for c in found if c.label == LABEL).acting({"latency_s": LATENCY_S})
    states = slow_states(data)
    return settle(data, fit(data, (one,)), (), lambda _: LIMIT, states, lambda *_: True)


def test_an_effect_that_noise_alone_does_as_well_goes_even_as_the_last_one(tmp_path: Path) -> None:
    final = _settled(tmp_path, ())
    assert not final.model.labels
    assert not final.evidence
    assert not final.stairs


def test_the_last_effect_stays_where_the_log_bears_it_out(tmp_path: Path) -> None:
    final = _settled(tmp_path, (hidden("latency", "position", latency_s=LATENCY_S),))
    assert final.model.labels == (LABEL,)
    assert final.evidence[LABEL].log_p < 10.0 * LIMIT


def test_an_effect_in_a_part_of_a_log_pays_for_the_stretches_it_was_looked_for_in() -> None:
    """Bonferroni over stretches of 2 to 13 of 16 blocks, counted one by one."""
    stretches = sum(2 <= b - a <= 13 for a in range(17) for b in range(a + 1, 17))
    whole = registry()["latency"]
    part = StampSpan(whole, 10.0, 20.0).cut
    for gain in (5.0, 20.0, 300.0):
        paid = log_chance(part, gain, 1) - log_chance(whole, gain, 1)
        assert paid == pytest.approx(min(math.log(stretches), -log_chance(whole, gain, 1)))
    assert log_chance(part, 0.1, 1) == 0.0
