"""Effects whose size is known: what tells them apart beyond first order."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import syncline_design as sd
from syncline_design.effects.record import Array
from syncline_design.planning.lacking import lacking
from syncline_design.planning.pairs import (
    NONCENTRALITY,
    noncentrality_of_first,
    noncentrality_of_second,
)
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import PlanWanted, separate_of
from syncline_design.report.on_plan import on_plan
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from tests.planned_specs import call, spec_with, world
from tests.world.hidden import hidden
from tests.world.worldlog import make_log

LARGE_S = 0.3
LATENCY, LAG = "latency(position)", "filter_lag(position)"


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return spec_with(tmp_path_factory.mktemp("plan"))


@pytest.fixture(scope="module")
def sized(spec: Path) -> PlanRun:
    return sd.plan(spec, separate=(f"{LATENCY}={LARGE_S} s", LAG))


def test_a_large_latency_is_told_from_a_filter_lag_that_a_small_one_is_like(
    spec: Path, sized: PlanRun
) -> None:
    """To first order both shift by -T v.  Of a known size they are judged as they are."""
    assert sized.result.reached
    assert sized.result.sized
    assert sized.result.inseparable == ()
    first = call(spec, "--separate", LATENCY, LAG)
    small = call(spec, "--separate", f"{LATENCY}=2 ms", LAG)
    for done, words in (
        (first, "apart, as far as their effects of first order go"),
        (small, "apart, at the size that is known, in these minutes"),
    ):
        assert done.exit_code == 1
        assert "Not reachable: no drive of this platform tells it" in " ".join(done.stdout.split())
        assert f"No drive of this platform tells {LATENCY} and {LAG} {words}" in " ".join(
            done.stdout.split()
        )


def _weighed(apart: Array, weight: Array, state: Array | None = None) -> float:
    """apart' W apart, less what a state of three axes that decays with the low pass explains."""
    whole = float(np.einsum("ri,rij,rj->", apart, weight, apart))
    if state is None:
        return whole
    pulled = np.einsum("r,rij,rj->i", state, weight, apart)
    told = np.einsum("r,rij->ij", state**2, weight)
    return whole - float(pulled @ np.linalg.solve(told, pulled))


def test_by_how_much_a_latency_beats_a_lag_is_what_the_world_says(sized: PlanRun) -> None:
    """The errors of both by a simulator of its own, with the same noise, weighted by the scatter of
    its own draws, row by row; the lag nearest to the latency by looking.  A fit of the lag takes
    some of what the time before the log left in it as well: between all of it and nothing."""
    run, draws = world(sized), 200
    clean = make_log(run).error()
    scattered = np.array([make_log(replace(run, seed=k)).error() for k in range(draws)])
    scattered -= scattered.mean(axis=0)
    covariance = np.einsum("kri,krj->rij", scattered, scattered) / (draws - 1)
    weight = np.linalg.inv(covariance) * (draws - 5) / (draws - 1)  # mean of an inverse Wishart
    late = make_log(run, (hidden("latency", "position", latency_s=LARGE_S),)).error() - clean

    def left(constant_s: float, *, fitted: bool) -> float:
        lag = hidden("filter_lag", "position", time_constant_s=constant_s)
        apart = late - (make_log(run, (lag,)).error() - clean)
        state = np.exp(-(run.stamps_s - run.stamps_s[0]) / constant_s)
        return _weighed(apart, weight, state if fitted else None)

    free, held = (
        minimize_scalar(partial(left, fitted=fitted), bounds=(0.2, 0.4), method="bounded").fun
        for fitted in (True, False)
    )
    (pair,) = sized.result.pairs
    assert 0.95 * free < pair.noncentrality < 1.05 * held
    assert held < 0.5 * left(0.2, fitted=False)


def test_a_latency_told_by_its_size_is_as_certain_as_without_the_lag(sized: PlanRun) -> None:
    """To first order neither has a figure with both free: the page said "reached" and "not seen" of
    the same.  Without the lag the sigma is that of the world's slope, weighted by its scatter."""
    run, draws, small_s = world(sized), 200, 1e-3
    clean = make_log(run).error()
    scattered = np.array([make_log(replace(run, seed=k)).error() for k in range(draws)])
    scattered -= scattered.mean(axis=0)
    covariance = np.einsum("kri,krj->rij", scattered, scattered) / (draws - 1)
    weight = np.linalg.inv(covariance) * (draws - 5) / (draws - 1)
    late = make_log(run, (hidden("latency", "position", latency_s=small_s),)).error() - clean
    last = sized.result.after[-1]
    assert last.sigma == {
        f"{LATENCY}.latency_s": pytest.approx(_weighed(late / small_s, weight) ** -0.5, rel=0.06)
    }
    grown = [one.noncentrality for one in sized.result.after]
    assert grown == sorted(grown)  # type: ignore[type-var]
    assert grown[-1] == sized.result.pairs[0].noncentrality
    assert LAG not in " ".join(sized.result.unseen)
    words = " ".join(console(on_plan(sized)).split())
    assert "Noncentrality of the pair" in words
    assert "only the size of latency (position) tells them apart" in words
    own = words.split("The field's standard line plans")[0]
    assert "not seen" not in own
    assert "Correlation" not in own


def test_a_noncentrality_is_of_the_effect_that_it_stands_beside(spec: Path) -> None:
    """One parameter each: v^2 / sigma^2, both ways.  It was the smaller one, said of the first."""
    found = sd.plan(spec, separate=("latency(attitude)", LATENCY)).result
    (pair,) = found.pairs
    sigma = found.after[-1].sigma
    assert pair.back is not None
    own = (pair.sizes["latency_s"] / sigma["latency(attitude).latency_s"]) ** 2
    back = (pair.back.sizes["latency_s"] / sigma[f"{LATENCY}.latency_s"]) ** 2
    assert own != pytest.approx(back, rel=0.1)
    assert pair.noncentrality == pytest.approx(own, rel=0.01)
    assert pair.back.noncentrality == pytest.approx(back, rel=0.01)
    assert pair.separated == (min(own, back) >= pair.wanted)


def test_what_fails_is_named_first(spec: Path) -> None:
    """Of a drive that is next to nothing: the weaker of the two, with its own figure."""
    pair = separate_of("latency(attitude)", LATENCY)
    setup = Setup.begun(load(spec), PlanRequest(PlanWanted((), pair), line_plans=False))
    (goal,) = setup.goal.pairs
    named = set()
    for information in (told.at(0, 0.0) for told in setup.told[:8]):
        first, second = (
            noncentrality_of_first(information, goal), noncentrality_of_second(information, goal)
        )  # fmt: skip
        lost = lacking(setup, information)
        if lost is not None and lost.asked == NONCENTRALITY:
            assert lost.value == min(first, second)
            named.add(lost.what.split(" and ")[0])
            assert lost.what.startswith("latency(attitude)" if first <= second else LATENCY)
    assert LATENCY in named


def test_a_class_is_told_at_once_and_what_no_drive_tells_is_left_out(spec: Path) -> None:
    """Several rivals in one plan: each with its figures."""
    rivals = "lever_arm(position), datum_offset(target)"
    found = sd.plan(spec, separate=(f"{LATENCY}=20 ms", rivals)).result
    assert found.reached
    assert [pair.second for pair in found.pairs] == ["lever_arm(position)", "datum_offset(target)"]
    assert all(pair.separated and pair.sizes == {"latency_s": 0.02} for pair in found.pairs)


@pytest.mark.parametrize(
    ("first", "words"),
    [
        (f"{LATENCY}=5 m", "cannot read latency_s"),
        (f"{LATENCY}=0 s", "expected a size other than 0"),
        (f"{LATENCY}=[1 s, 2 s]", "expected 1 size, of latency_s; found 2"),
        ("lever_arm(position)=1 cm", "expected 3 sizes, of x_m, y_m, z_m; found 1"),
        (f"{LATENCY}=", "cannot read latency_s"),
    ],
)
def test_sizes_that_are_none_are_refused(spec: Path, first: str, words: str) -> None:
    done = call(spec, "--separate", first, LAG)
    assert done.exit_code == 2
    assert words in done.stderr


def test_doubles_are_said_to_be_doubles(spec: Path) -> None:
    """Only R (l_L - l_G) is in the error at equal stamps: no drive tells the two lever arms."""
    done = call(spec, "--separate", "lever_arm(position)", "lever_arm(ranging)")
    assert done.exit_code == 1
    assert "No drive of this platform tells lever_arm(position) and lever_arm(ranging)" in " ".join(
        done.stdout.split()
    )
