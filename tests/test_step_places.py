"""Where a step acts from: the place is the best there is, and is paid for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from syncline_design.diagnosis.candidates import candidates, directed_parts
from syncline_design.diagnosis.charges import charge, place_nats
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import Data, Model, data_of, fit
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.trials import located
from syncline_design.effects.acting import Acting
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.spec.load import load
from tests.world import hidden, make_log, scenario

STEP_S, AT_S, ARM_M = 0.04, 33.3, 0.05
ROWS, AXES = 300, 3


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> Iterator[None]:
    with one_thread():
        yield


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> tuple[Data, Model]:
    """A step beside an arm, fitted two seconds before its place."""
    folder = tmp_path_factory.mktemp("step")
    truth = (
        hidden("timestamp_step", "position", step_s=STEP_S, time_s=AT_S),
        hidden("lever_arm", "position", x_m=ARM_M, y_m=0.0, z_m=0.0),
    )
    log = make_log(scenario("multirotor_lines", 3, 60.0, 5.0), truth)
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log, inputs.known)
    found = candidates(view)
    data = data_of(view, structure_of(view, directed_parts(view, found)))

    def acting(name: str, **values: float) -> Acting:
        one = next(c for c in found if c.label[:2] == (name, "position"))
        return one.acting(values)

    arm = acting("lever_arm", x_m=ARM_M, y_m=0.0, z_m=0.0)
    step = acting("timestamp_step", step_s=0.01, time_s=AT_S - 2.0)
    return data, fit(data, (arm, step))


def test_the_place_of_a_step_is_the_best_of_all_rows(started: tuple[Data, Model]) -> None:
    """Every place near by is fitted in plain least squares, whitened by the full covariance."""
    data, model = started
    found = located(data, model)
    assert found.acting[-1].values["time_s"] == pytest.approx(AT_S, abs=0.6)
    assert found.acting[-1].values["step_s"] == pytest.approx(STEP_S, rel=0.1)
    best = min(_plain(data, model, AT_S + off) for off in np.arange(-3.0, 3.0, 0.2))
    assert found.nll < best + 0.5
    assert found.nll < model.nll - 20.0


def _plain(data: Data, model: Model, place: float) -> float:
    """NLL with a step from a place on and an arm, each column by a difference of its own."""
    arm, step = model.acting
    none = (replace(arm, values=dict.fromkeys(arm.values, 0.0)),)
    error = data.error(none)
    moved = [
        *((replace(arm, values={**none[0].values, name: 1e-3}),) for name in arm.values),
        (replace(step, values={"step_s": 1e-3, "time_s": place}),),
    ]
    columns = np.stack([(error - data.error(one)) / 1e-3 for one in moved], axis=-1)
    weighted = model.precision.solve(columns)
    normal = np.einsum("nip,niq->pq", columns, weighted)
    values = np.linalg.lstsq(normal, np.einsum("nip,ni->p", weighted, error), rcond=1e-9)[0]
    return model.precision.negative_log_likelihood(error - columns @ values)


def test_a_step_pays_for_its_size_and_its_place(started: tuple[Data, Model]) -> None:
    """Half of log N for the size; log(n / w) for a place known to w of n rows, N components.

    w by moving the step to every row in turn, each move weighed by the full covariance.
    """
    data, model = started
    assert len(data.view) == ROWS
    assert len(data.axes) == AXES
    label = model.acting[1].label
    found = located(data, model)
    step, none = found.acting[1], found.acting[:1]
    since = data.view.log.time_s - data.view.log.time_s[0]

    def cost(place: float) -> float:
        there = replace(step, values={**step.values, "time_s": place})
        off = data.error((*none, there)) - data.error((*none, step))
        return 0.5 * float(np.sum(off * found.precision.solve(off[:, :, None])[:, :, 0]))

    known_to = sum(math.exp(-cost(float(place))) for place in since)
    assert 1.0 < known_to < 0.2 * ROWS
    size, place = 0.5 * math.log(ROWS * AXES), math.log(ROWS / known_to)
    figures = charge(data, found, label, found).figures
    assert figures == pytest.approx(size + place, abs=0.5)


def test_a_place_that_the_log_does_not_tell_costs_nothing(started: tuple[Data, Model]) -> None:
    data, model = started
    step = model.acting[1]
    small = replace(step, values={**step.values, "step_s": 1e-9})
    assert place_nats(data, replace(model, acting=(model.acting[0], small)), step.label) < 1e-3
    assert place_nats(data, model, model.acting[0].label) == 0.0
