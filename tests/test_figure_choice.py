"""Choice under figures of the error against plain enumeration, and the bounds that it rests on."""

from __future__ import annotations

import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from figure_problems import Raw, drawn, rmse_3d_m, written
from syncline_design import api
from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.outcome import Choice
from syncline_design.choice.table import Problem
from syncline_design.cli.app import app
from syncline_design.model.system import System
from syncline_design.model.timing import TimingError, Uniform
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_html import html
from syncline_design.simulation.noise_shares import (
    least_quantile,
    most_noise,
    noise_at,
    surely_keeps,
)
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import (
    Wanted,
    exceeds_at,
    statistical_figures,
    worst_point,
)
from syncline_design.spec.case import Case
from syncline_design.spec.load import load_text
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.figure_front import drawn_requirement, figure_front
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.stated import Certified, stated, value_m, wanted_of
from syncline_design.verdict.verify import check_loaded
from syncline_design.verdict.worst_cuts import taught
from test_statistical_figures import chain


def loaded(raw: Raw, folder: Path) -> tuple[Case, Problem]:
    case = load_text(written(raw, folder), folder / "spec.yaml")
    return case, Simulations().problem_of(case)


def cost_of(problem: Problem, design: object) -> float | None:
    if not isinstance(design, Choice):
        return None
    options = zip(problem.roles, design.design.options, strict=True)
    return float(sum(table.options[i].resources.cost or 0 for table, i in options))


def cheapest_by_hand(raw: Raw) -> float | None:
    """The cheapest of all designs by the closed form of the root mean square."""
    by_role: dict[str, list[str]] = {"position": [], "attitude": [], "ranging": []}
    for name, one in raw["sensors"].items():
        by_role[one["role"]].append(name)
    stamp = min(cost for _, cost in raw["methods"].values())
    limit = min(limit for _, limit in raw["requirements"])
    return min(
        (
            float(sum(raw["sensors"][name]["cost"] + stamp for name in names))
            for names in itertools.product(*by_role.values())
            if rmse_3d_m(raw, names) <= limit
        ),
        default=None,
    )


def test_the_root_mean_square_decides_as_by_hand(tmp_path: Path) -> None:
    found, impossible = 0, 0
    for seed in (*range(12), 41, 54):
        raw = drawn(seed, ("rmse",))
        wanted = cheapest_by_hand(raw)
        _, problem = loaded(raw, tmp_path)
        assert cost_of(problem, choose(problem)) == wanted, seed
        found, impossible = found + (wanted is not None), impossible + (wanted is None)
    assert found == 12
    assert impossible == 2


def few(seed: int, kind: str, sensors: tuple[int, int, int]) -> Raw:
    """A problem with so many sensors a role, and one way to stamp them."""
    raw = drawn(seed, (kind,))
    names = zip(("position", "attitude", "ranging"), sensors, strict=True)
    kept = {f"{role}{k}" for role, count in names for k in range(count)}
    raw["sensors"] = {name: one for name, one in raw["sensors"].items() if name in kept}
    raw["methods"] = {"good": raw["methods"]["good"]}
    raw["requirements"] = [(kind, 1e6)]
    return raw


@pytest.mark.parametrize("kinds", [("thu", "tvu"), ("quantile", "worst_case")])
def test_other_figures_decide_as_when_all_designs_are_judged(
    kinds: tuple[str, ...], tmp_path: Path
) -> None:
    """Every design's figures, one by one by their own search, no bound between."""
    for seed in (102,):
        raw = few(seed, kinds[0], (2, 2, 3))
        raw["requirements"] = drawn(seed, kinds)["requirements"]
        case, problem = loaded(raw, tmp_path)
        asked = [(wanted_of(one), float(one.limit)) for one in case.spec.requirements[:-1]]
        best = None
        ordered = sorted(all_designs(problem), key=lambda pair: pair[1].cost or 0)
        for design, sums in ordered:
            system = system_of(case, problem, design)
            if all(value_m(system, wanted, limit, 0) <= limit for wanted, limit in asked):
                best = float(sums.cost or 0)
                break
        assert cost_of(problem, choose(problem)) == best, seed
        assert any(isinstance(one, Certified) for one, _ in asked) == ("worst_case" in kinds)


def exact_stamps(seed: int) -> System:
    """A random chain with short shifts."""
    system = chain(seed)
    short = TimingError(Uniform(-1e-4, 1e-4))
    stages = tuple(
        replace(stage, **{
            role: replace(sensor, timing=short)
            for role in ("position", "attitude", "ranging")
            if (sensor := getattr(stage, role)) is not None
        })
        for stage in system.stages
    )  # fmt: skip
    return replace(system, stages=stages, clock_offsets=())


@pytest.mark.parametrize(
    "wanted",
    [Wanted("3d"), Wanted("horizontal", 0.95), Wanted("vertical", 0.9), Wanted("3d", 0.5)],
)
def test_noise_of_a_situation_is_never_more_than_a_figure(wanted: Wanted) -> None:
    """The sum over sensors at any situation, put as a figure, against the figure's own search;
    a quick yes against the same."""
    for seed in (0, 1, 2):
        system = exact_stamps(seed)
        value = statistical_figures(system, (wanted,), seed=0)[0].value_m
        points = Situations(system).starting_points(seed, 12)
        for point in points.T:
            noise = noise_at(system, wanted, point)
            total = sum(
                float(
                    np.array(sensor.sigma) ** 2 @ noise.least((k, sensor.role), {0: 2e-4, 1: 2e-4})
                )
                for k, stage in enumerate(system.stages)
                for sensor in stage.sensors()
            )
            assert total <= most_noise(wanted, 1.005 * value)
        assert not surely_keeps(system, wanted, 0.999 * value)
        assert surely_keeps(system, wanted, 4.0 * value)


def test_quantiles_of_unit_trace_by_sampling() -> None:
    """No split of the trace over the axes has a smaller quantile, by 400 000 normal numbers."""
    z = np.random.default_rng(1).standard_normal((3, 400_000)) ** 2
    for axis, size in (("vertical", 1), ("horizontal", 2), ("3d", 3)):
        splits = np.random.default_rng(2).dirichlet(np.ones(size), 12)
        found = min(float(np.quantile(split @ z[:size], 0.95)) for split in splits)
        least = least_quantile(axis, 0.95)  # type: ignore[arg-type]
        isotropic = float(np.quantile(np.full(size, 1.0 / size) @ z[:size], 0.95))
        assert least <= min(found, isotropic) * 1.001
        assert least >= 0.97 * min(found, isotropic)
    assert math.isclose(least_quantile("vertical", 0.95), 0.99 * 1.959964**2, rel_tol=1e-3)


def test_a_situation_that_was_worst_for_another_says_no_at_once() -> None:
    """At its own worst situation a figure is what it is; elsewhere less; other systems' are none
    of its situations."""
    system, wanted = exact_stamps(3), Wanted("vertical", 0.95)
    (worst,) = statistical_figures(system, (wanted,), seed=0)
    assert exceeds_at(system, wanted, 0.9999 * worst.value_m, worst)
    assert not exceeds_at(system, wanted, 1.0001 * worst.value_m, worst)
    elsewhere = replace(worst, point=Situations(system).starting_points(5, 1)[:, 0])
    assert not exceeds_at(system, wanted, 0.9999 * worst.value_m, elsewhere)
    assert not exceeds_at(replace(system, stages=system.stages[:1]), wanted, 0.0, worst)


def test_failures_teach_from_situations_that_are_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where every design fails, a handful of situations is searched, not one a design; what has
    kept a limit is not looked at again under a larger one."""
    searched: list[Wanted] = []

    def counted(system: System, wanted: Wanted, seed: int) -> np.ndarray:
        searched.append(wanted)
        return worst_point(system, wanted, seed)

    monkeypatch.setattr("syncline_design.verdict.cuts.worst_point", counted)
    raw = drawn(7, ("thu",))
    raw["requirements"] = [("thu", 0.05)]
    case = load_text(written(raw, tmp_path), tmp_path / "s.yaml")
    simulations = Simulations()
    problem = simulations.problem_of(case)
    designs = [one for one, *_ in all_designs(problem)]
    assert problem.judge is not None
    assert all(problem.judge.judge(problem, one).failed for one in designs)
    assert len(designs) >= 50
    assert len(searched) <= 4
    system = simulations.systems.pop()
    wanted = Wanted("horizontal", 0.95)
    assert simulations.figure_keeps(system, wanted, 10.0)
    monkeypatch.setattr("syncline_design.verdict.acceptance.reached", None)
    assert simulations.figure_keeps(system, wanted, 11.0)


def front_by_hand(raw: Raw) -> list[tuple[float, float]]:
    """(cost, root mean square) of the designs that none beats, by the closed form."""
    by_role: dict[str, list[str]] = {"position": [], "attitude": [], "ranging": []}
    for name, one in raw["sensors"].items():
        by_role[one["role"]].append(name)
    stamp = min(cost for _, cost in raw["methods"].values())
    found: list[tuple[float, float]] = []
    for cost, value in sorted(
        (float(sum(raw["sensors"][n]["cost"] + stamp for n in names)), rmse_3d_m(raw, names))
        for names in itertools.product(*by_role.values())
    ):
        if not found or value <= found[-1][1] * (1.0 - 1e-3):
            found.append((cost, value))
    return found


def test_a_front_over_a_figure_is_that_by_hand(tmp_path: Path) -> None:
    """Timestamps of 20 us count for less than 1 in 10 000 here; gains below 0.1 % are no points."""
    several = 0
    for seed in (0, 7):
        raw = few(seed, "tvu", (2, 2, 2))
        case = load_text(written(raw, tmp_path), tmp_path / "spec.yaml")
        asked = drawn_requirement(case, "rmse")
        points = figure_front(case, asked, "cost", 0)
        kept = [(float(point.amount), point.drawn_m) for point in points]
        wanted = front_by_hand(raw)
        assert [cost for cost, _ in kept] == [cost for cost, _ in wanted], seed
        assert np.allclose([v for _, v in kept], [v for _, v in wanted], rtol=2e-4), seed
        several += len(wanted) > 2
    assert several > 0


def test_what_a_front_is_drawn_over_is_said(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(written(few(3, "thu", (2, 1, 1)), tmp_path))
    found = api.optimize(tmp_path / "s.yaml", pareto=True, against="thu").to_json()
    assert found["front_figure"] == "95 % of horizontal errors (THU)"
    figures = [point["figure_m"] for point in found["front"]]
    assert figures == sorted(figures, reverse=True)
    assert [step["tightest_m"] for step in found["staircase"]] == figures
    with pytest.raises(ValueError, match="against"):
        api.optimize(tmp_path / "s.yaml", pareto=True, against="tallness")  # type: ignore[arg-type]


LATE = {
    "effects": [
        {"effect": "latency", "sensor": "attitude", "parameters": {"latency_s": "3 ms"}},
        {"effect": "range_bias", "sensor": "ranging", "parameters": {"bias_m": "5 cm"}},
        {"effect": "heading_bias", "sensor": "attitude", "parameters": {"bias_rad": "0.2 deg"}},
    ]
}


def with_keys(raw: Raw, folder: Path, **keys: object) -> Case:
    """The problem with delays on one side and more keys in its spec."""
    document = json.loads(written(raw, folder))
    own = json.loads((folder / "own.yaml").read_text())
    for number, method in enumerate(own["timestamping"].values()):
        method["error"] = {"distribution": "uniform", "low": f"{-20 * number} ms", "high": "1 ms"}
    (folder / "own.yaml").write_text(json.dumps(own))
    return load_text(json.dumps({**document, **keys}), folder / "spec.yaml")


@pytest.mark.parametrize("keys", [{}, LATE])
def test_what_a_worst_case_teaches_is_below_every_worst_case(
    keys: dict[str, object], tmp_path: Path
) -> None:
    """The sum that rules designs out against the certificate itself, design by design."""
    wanted = Certified()
    for seed in (3, 4):
        raw = drawn(seed, ("worst_case",))
        raw["d"] = 60.0 if seed == 3 else 5.0
        case = with_keys(raw, tmp_path, **keys)
        problem = Simulations().problem_of(case)
        every = [design for design, _ in all_designs(problem)]
        values = [value_m(system_of(case, problem, one), wanted, 1.0, 0) for one in every]
        for teacher in (0, len(every) // 2, len(every) - 1):
            system = system_of(case, problem, every[teacher])
            at = stated(system, wanted, 1.0, 0)
            rule = taught(case, problem, system, "R0", (wanted, at))
            cut = rule.cut(problem, 1.0)
            sums = [sum(float(w[i]) for w, i in zip(cut.weights, one.options, strict=True))
                    for one in every]  # fmt: skip
            assert np.all(np.array(sums) <= np.array(values) * (1.0 + 1e-9)), seed
            if not keys:  # what effects and the drift of one-sided delays add is left out
                assert sums[teacher] > 0.75 * values[teacher]
            limit = 0.5 * (min(sums) + max(sums))
            asked = [rule.rules_out(problem, one, limit) for one in every]
            assert asked == [total > limit * (1.0 + 1e-9) for total in sums]


@pytest.mark.parametrize(
    ("kind", "keys"), [("worst_case", {}), ("worst_case", LATE), ("rmse", LATE)]
)
def test_choices_that_learn_agree_with_judging_all(
    kind: str, keys: dict[str, object], tmp_path: Path
) -> None:
    """Cheapest of all designs, each by its own figure, against the search that leaves some out."""
    for seed in (5, 6, 7, 8) if kind == "worst_case" else (5,):
        raw = drawn(seed, (kind,))
        if kind != "worst_case":
            raw["sensors"] = few(seed, kind, (2, 2, 2))["sensors"]
        raw["requirements"] = [(kind, 0.8 if kind == "worst_case" else 0.3)]
        case = with_keys(raw, tmp_path, **keys)
        problem = Simulations().problem_of(case)
        wanted = wanted_of(case.spec.requirements[0])
        limit, best = raw["requirements"][0][1], None
        for design, sums in sorted(all_designs(problem), key=lambda pair: pair[1].cost or 0):
            if value_m(system_of(case, problem, design), wanted, limit, 0) <= limit:
                best = float(sums.cost or 0)
                break
        assert cost_of(problem, choose(problem)) == best, seed


def test_a_front_over_a_figure_is_drawn(tmp_path: Path) -> None:
    """The page has it as a staircase of its own beside that of the Syncline error."""
    raw = few(3, "rmse", (2, 2, 1))
    (tmp_path / "spec.yaml").write_text(written(raw, tmp_path))
    page = tmp_path / "page.html"
    command = ["optimize", str(tmp_path / "spec.yaml"), "--pareto", "--against", "rmse",
               "-o", f"html:{page}"]  # fmt: skip
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    drawn = page.read_text().split('aria-labelledby="fig-front-figure-title')[1]
    title = re.search(r"<title[^>]*>([^<]*)<", drawn)
    assert title is not None
    assert title[1] == "Pareto front of cost against RMS of 3D errors"


def test_a_checked_page_shows_the_designs_of_the_front_by_the_figure_that_is_limited(
    tmp_path: Path,
) -> None:
    """Each at the root mean square by hand; what a cheaper one equals is no step of the drawing."""
    raw = few(0, "rmse", (2, 2, 2))
    raw["requirements"] = [("rmse", 9.0)]
    case = load_text(written(raw, tmp_path), tmp_path / "spec.yaml")
    verdict = check_loaded(case, CheckSettings(monte_carlo=False, cloud=True))
    assert verdict.choice is not None
    found = verdict.choice.by_figure
    assert found is not None
    assert (found.requirement, found.figure, found.limit_m) == ("R0", "RMS of 3D errors", 9.0)
    least, steps = math.inf, 0
    for one in found.designs:
        names = [role.sensor for _, _, role in one.design.roles]
        wanted = rmse_3d_m(raw, (str(names[0]), str(names[1]), str(names[2])))
        assert one.figure_m == pytest.approx(wanted, rel=2e-4)
        assert one.beaten == (wanted > least * (1.0 - 1e-3))
        least, steps = min(least, wanted), steps + (not one.beaten)
    assert steps > 2
    drawn = html(on_verdict(verdict)).split('aria-labelledby="fig-by-figure-title')
    assert len(drawn) == 2
    assert "--pareto --against rmse" in drawn[1]
