"""A delay that is another one every few seconds is said to vary; noise of other kinds is not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import candidates, directed_parts, slopes
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import Data, Model, data_of, fit
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.wandering import Wandering, wanderings
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.spec.load import load
from tests.world import hidden, make_log, scenario

LATENCY_S, BY_S, EVERY_S = 0.1, 0.02, 5.0
LABEL = ("latency", "ranging", 0)
Figures = NDArray[np.float64]


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> Iterator[None]:
    with one_thread():
        yield


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> tuple[Data, Model, Figures]:
    """A delay of one value, fitted, with its column in the error."""
    folder = tmp_path_factory.mktemp("wandering")
    truth = (hidden("latency", "ranging", latency_s=LATENCY_S),)
    log = make_log(scenario("multirotor_lines", 5, 120.0, 5.0), truth)
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(folder / "spec.yaml"), [log.to_csv(folder / "log.csv")])
    view = scene(inputs.system, inputs.log, inputs.known)
    found = candidates(view)
    data = data_of(view, structure_of(view, directed_parts(view, found)))
    one = next(c for c in found if c.label == LABEL)
    model = fit(data, (one.acting({"latency_s": LATENCY_S}),))
    return data, model, slopes(view, model.acting)[:, :, 0]


def _with(steady: tuple[Data, Model, Figures], added: Figures) -> dict[object, Wandering]:
    data, model, _ = steady
    found: dict[object, Wandering] = dict(wanderings(
        data, replace(model, error=model.error + added), 0.1, 0
    ))  # fmt: skip
    return found


def test_one_value_is_one_value(steady: tuple[Data, Model, Figures]) -> None:
    assert not _with(steady, np.zeros_like(steady[2]))


def test_a_delay_of_another_size_every_few_seconds_is_said_with_its_size(
    steady: tuple[Data, Model, Figures],
) -> None:
    """Sizes drawn for every five seconds are laid onto the error by hand."""
    data, _, column = steady
    time_s = data.view.log.time_s - data.view.log.time_s[0]
    rng = np.random.default_rng(8)
    sizes = rng.normal(0.0, BY_S, int(time_s[-1] / EVERY_S) + 1)
    sizes -= sizes.mean()
    own = sizes[(time_s / EVERY_S).astype(int)]
    found = _with(steady, own[:, None] * column)[LABEL]
    assert found.std == pytest.approx(np.std(sizes), rel=0.35)
    assert 0.5 * EVERY_S < found.over_s < 2.0 * EVERY_S
    middles = np.array([0.5 * (a + b) for a, b, _ in found.values]) - data.view.log.time_s[0]
    laid = np.array([own[np.argmin(np.abs(time_s - middle))] for middle in middles])
    told = np.array([value for *_, value in found.values])
    assert np.corrcoef(laid, told)[0, 1] > 0.8


@pytest.mark.parametrize("kind", ["grows with the motion", "wanders in yaw"])
def test_noise_that_is_no_delay_is_not_said_to_be_one_that_varies(
    steady: tuple[Data, Model, Figures], kind: str
) -> None:
    data, _, column = steady
    rng, rows = np.random.default_rng(9), len(column)
    if kind == "grows with the motion":  # fresh in every row: stamps that jitter
        added = rng.normal(0.0, 0.02, rows)[:, None] * column
    else:  # slow noise of the spec's size, by the hand's rule for a small turn about down
        sigma = data.view.system.stages[0].attitude
        assert sigma is not None
        walk = np.zeros(rows)
        for k in range(1, rows):
            walk[k] = 0.98 * walk[k - 1] + 0.2 * rng.standard_normal()
        arm = data.view.log.truth_m - data.view.rows[0].position_m
        turned = np.stack([-arm[:, 1], arm[:, 0], np.zeros(rows)], axis=1)
        added = float(sigma.sigma[2]) * walk[:, None] * turned
    assert LABEL not in _with(steady, added)
