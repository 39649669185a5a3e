"""The search for the noise: against dense covariances, another minimiser, and all active sets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize, rosen, rosen_der, rosen_hess

from fitted_data import data_from
from syncline_design.diagnosis.box_newton import CostHere, least, least_in_box
from syncline_design.diagnosis.candidates import candidates
from syncline_design.diagnosis.fitting import fit
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    Structure,
    common_loading,
    first_guess,
    loadings,
    precision,
    row_covariance,
    spec_bounds,
    white_covariance,
)
from syncline_design.diagnosis.noise_fit import Packing, fit_noise
from syncline_design.machine.linear_algebra import one_thread
from tests.world import hidden, make_log, scenario

LATE = hidden("latency", "position", latency_s=0.05)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    with one_thread():
        yield


def test_a_quadratic_in_a_box_is_least_where_all_active_sets_say() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        root = rng.normal(size=(4, 4))
        bend, slope = root @ root.T + 0.1 * np.eye(4), rng.normal(size=4)
        low, high = -rng.uniform(0.0, 0.5, 4), rng.uniform(0.0, 0.5, 4)
        best = np.inf
        for held in product((-1, 0, 1), repeat=4):
            at = np.array(held)
            tried = np.where(at < 0, low, np.where(at > 0, high, 0.0))
            free = at == 0
            right = -(slope + bend @ tried)[free]
            tried[free] = np.linalg.solve(bend[np.ix_(free, free)], right)
            if np.all((tried >= low - 1e-12) & (tried <= high + 1e-12)):
                best = min(best, slope @ tried + 0.5 * tried @ bend @ tried)
        found = least_in_box(slope, bend, low, high)
        assert np.all((found >= low) & (found <= high))
        assert slope @ found + 0.5 * found @ bend @ found == pytest.approx(best, abs=1e-7)


@pytest.mark.parametrize("high", [0.5, 2.0])
def test_a_bent_valley_in_a_box_is_followed_to_its_end(high: float) -> None:
    """Rosenbrock's, positive part of its bend; a library's minimiser for the least value."""
    start, box = np.array([-1.2, 1.0]), (np.array([-2.0, -2.0]), np.array([high, 2.0]))

    def bend(place: np.ndarray) -> np.ndarray:
        values, vectors = np.linalg.eigh(rosen_hess(place))
        return (vectors * np.maximum(values, 0.1)) @ vectors.T

    def look(place: np.ndarray) -> CostHere | None:
        if place[0] < -1.5:  # where there is no value
            return None
        return CostHere(float(rosen(place)), rosen_der(place), lambda: bend(place))

    place, value = least(look, start, box, lambda _: 1e-8, 200)
    wanted = minimize(rosen, start, jac=rosen_der, method="L-BFGS-B", bounds=np.array(box).T)
    assert value == pytest.approx(wanted.fun, abs=1e-4)
    assert place == pytest.approx(wanted.x, abs=1e-2)


def dense(structure: Structure, level: NoiseLevel) -> np.ndarray:
    """C (3n, 3n) of all rows, entry by entry; survey errors apart."""
    time_s, loading = structure.time_s, loadings(structure, level)
    apart = np.abs(time_s[:, None] - time_s)
    white = row_covariance if structure.shared else white_covariance
    total = block_diag(*white(structure, level))
    for k, constant in enumerate(loading[1]):
        column = loading[0][:, :, k].ravel()
        total += np.outer(column, column) * np.kron(np.exp(-apart / constant), np.ones((3, 3)))
    if structure.shared:
        for column in np.moveaxis(common_loading(structure, level), 2, 0):
            flat = column.ravel()
            total += np.outer(flat, flat) * np.kron((apart == 0.0) * 1.0, np.ones((3, 3)))
    return total


@pytest.mark.parametrize("shared", [False, True])
def test_the_average_information_is_that_of_dense_matrices(shared: bool, tmp_path: Path) -> None:
    """e' C^-1 C_j C^-1 C_k C^-1 e / 2, every C_j by differences; no prior, no damping."""
    data = data_from(make_log(scenario("car_stops", 3, 10.0, 4.0)), tmp_path)
    structure, error = data.structure, data.error(())
    if shared:
        time_s = structure.time_s.copy()
        time_s[1::2] = time_s[0:-1:2]
        structure = replace(structure, time_s=time_s)
    sizes = tuple(range(len(structure.directed)))[:2]
    packing = Packing(structure, replace(spec_bounds(structure), factor=(9.0,) * 3), sizes)
    guess = first_guess(structure)
    level = replace(
        guess,
        factor=(1.3, *guess.factor[1:]),
        time_constant_s=tuple((2.0 + k,) * 3 for k in range(len(structure.slow))),
        size=tuple(0.003 if k in sizes else 0.0 for k in range(len(structure.directed))),
    )
    vector = packing.pack(level)
    level = packing.unpack(vector)
    known = precision(structure, level)
    moved = packing.moved(level, known, packing.slopes_at(level, known, error))
    weighted = np.linalg.solve(dense(structure, level), error.ravel())
    for k, step in enumerate(1e-4 * np.eye(len(vector))):
        ahead, behind = (dense(structure, packing.unpack(vector + s)) for s in (step, -step))
        wanted = (ahead - behind) @ weighted / 2e-4
        scale = np.max(np.abs(wanted))
        assert moved[:, :, k].ravel() == pytest.approx(wanted, rel=1e-4, abs=1e-5 * scale)


@pytest.mark.parametrize("missing", [(), (LATE,)])
def test_the_fit_ends_where_another_minimiser_does(missing: tuple, tmp_path: Path) -> None:
    """From far off, in a log that lacks nothing and in one that lacks 50 ms: within half a nat."""
    data = data_from(make_log(scenario("multirotor_lines", 4, 80.0, 5.0), missing), tmp_path)
    structure, error = data.noise_structure, data.error(())
    bounds, start = spec_bounds(structure), first_guess(structure)
    packing = Packing(structure, bounds, ())

    def cost(place: np.ndarray) -> tuple[float, np.ndarray]:
        level = packing.unpack(place)
        known = precision(structure, level)
        slopes = packing.slopes(level, packing.slopes_at(level, known, error))
        return known.negative_log_likelihood(error) + packing.prior(level), slopes

    level, nll = fit_noise(structure, error, bounds, start)
    reached = nll + packing.prior(level)
    best = minimize(cost, packing.pack(start), jac=True, method="L-BFGS-B",
                    bounds=packing.limits(), options={"maxiter": 500, "ftol": 1e-12})  # fmt: skip
    assert nll == pytest.approx(precision(structure, level).negative_log_likelihood(error))
    assert reached < best.fun + 0.5


def test_noise_fitted_on_some_rows_does_not_suit_all_of_them_worse(tmp_path: Path) -> None:
    """Again from its own level, a model only gets better; 1500 rows, 800 for the noise."""
    log = make_log(scenario("car_stops", 8, 150.0, 10.0), (LATE,))
    data = data_from(log, tmp_path)
    late = next(c for c in candidates(data.view) if c.label[:2] == ("latency", "position"))
    model = fit(data, (late.acting({"latency_s": 0.0}),))
    for other in (model.level, first_guess(data.structure), fit(data).level):
        again = fit(data, model.acting, start=other)
        assert fit(data, again.acting, start=again.level).nll <= again.nll + 1e-9
