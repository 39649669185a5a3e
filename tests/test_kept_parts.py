"""What is kept of one computation for the next changes nothing of what it gives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.candidates import candidates, zero_values
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.noise import as_specified
from syncline_design.diagnosis.recent import Recent
from syncline_design.diagnosis.scene import PARTS, Scene
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.effects.acting import Acting
from tests.fitted_data import data_from
from tests.world import make_log, scenario


@pytest.mark.parametrize("platform", ["car_stops", "survey_chain"])
def test_an_error_is_the_same_whatever_was_asked_before(platform: str, tmp_path: Path) -> None:
    """Every effect beside others, each of its figures moved: as on a log that was asked nothing."""
    view = data_from(make_log(scenario(platform, 5, 20.0, 5.0)), tmp_path).view
    moving = [c for c in candidates(view) if c.effect.sensitivity is not None]
    rows = [r.rotation.flags.writeable for r in view.rows]
    beside: tuple[Acting, ...] = ()
    made = 0
    for one in moving:
        for p in one.effect.slopes():
            tried = one.acting({**zero_values(one.effect), p.name: 0.3 * p.high})
            fresh = Scene(view.system, view.log, _forgetful(view), view.rows, view.known)
            assert np.array_equal(
                view.error((*beside, tried)), fresh.error((*beside, tried)), equal_nan=True
            )
            made += 1
        there = {p.name: 7.0 if p.located else 0.1 * p.high for p in one.effect.parameters}
        beside = (*beside[-2:], one.acting(there))
    assert made > 30
    assert len(view.parts.kept) == PARTS
    assert [r.rotation.flags.writeable for r in view.rows] == rows


def _forgetful(view: Scene) -> tuple:
    return tuple(replace(m, recent=Recent(1)) for m in view.motions)


def test_blocks_of_any_kind_share_the_rows_that_they_are_made_of(tmp_path: Path) -> None:
    """What is judged in blocks of a stretch is what states that judged nothing before say."""
    data = data_from(make_log(scenario("car_stops", 3, 60.0, 5.0)), tmp_path)
    model = fit(data, start=as_specified(data.structure))
    used, column = slow_states(data), np.zeros((len(data.view), 3, 1))
    inside = (data.view.log.time_s > 20.0) & (data.view.log.time_s < 45.0)
    column[inside, 0, 0] = 1.0
    whole, part = (
        used.judged(model, [column])[0],
        used.within(inside, 12).judged(model, [column])[0],
    )
    for judged, fresh in ((whole, slow_states(data)), (part, slow_states(data).within(inside, 12))):
        [alone] = fresh.judged(model, [column])
        assert np.array_equal(judged.values, alone.values)
        assert np.array_equal(judged.spread, alone.spread)
    assert not np.array_equal(whole.spread, part.spread)
    assert len(used.whitened.kept) == 1
