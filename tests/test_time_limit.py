"""A time limit binds a whole command; runners-up come in the documented order, by any road."""

from __future__ import annotations

import functools
import itertools
import json
import random
import resource
import subprocess
import sys
import tempfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from random_problems import random_problem
from syncline_design.choice import ranked
from syncline_design.choice.best_first import lower_bound
from syncline_design.choice.decide import best, choose
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.outcome import Choice
from syncline_design.choice.partition import iter_differing
from syncline_design.choice.problem import build_problem
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import Design, Problem
from syncline_design.cli.app import app
from syncline_design.machine.deadline import (
    Deadline,
    NoVerdict,
    OutOfTime,
    in_force,
    within,
    within_s,
)
from syncline_design.spec.load import load
from test_front_ties import ROLES, as_problem, coarse_options, plain_designs

SPECS = Path(__file__).parent.parent / "specs"

CHAIN = """\
syncline: 1
name: three open stages
requirements:
  - {id: ACC-1, kind: accuracy, limit: 30 m}
stages:
  - name: a
    platform: usv
    position: {candidates: {modality: position}}
    attitude: {candidates: {modality: attitude}}
    ranging: {candidates: {modality: ranging}}
  - name: b
    platform: usv
    attitude: {candidates: {modality: attitude}}
    ranging: {candidates: {modality: ranging}}
  - name: c
    platform: usv
    attitude: {candidates: {modality: attitude}}
    ranging: {candidates: {modality: ranging}}
timestamping:
  candidates: [hardware, mcu_capture, mcu_interrupt, gpio, gpio_rt, ptp, ntp, arrival, arrival_ros]
"""


@pytest.fixture
def chain(tmp_path: Path) -> Path:
    path = tmp_path / "chain.yaml"
    path.write_text(CHAIN, "utf-8")
    return path


def run(*words: str, most_bytes: int | None = None) -> tuple[int, float, str]:
    """Exit code, processor seconds and stderr of the command, in a process of its own."""

    def confine() -> None:
        if most_bytes is not None:
            resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "syncline_design.cli", *words],
        check=False, capture_output=True, text=True, preexec_fn=confine, timeout=120,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.returncode, used, done.stderr


@functools.cache
def startup_s() -> float:
    """Processor time of an interpreter, of reading and of drawing a page, twice for what varies.

    Measured where it is asked for: machines differ by a factor of four.
    """
    with tempfile.TemporaryDirectory() as folder:
        page = f"html:{folder}/page.html"
        code, used, complaint = run("check", str(SPECS / "uav_corridor.yaml"), "-q", "-o", page)
    assert code == 0, complaint
    return 2.0 * used


@pytest.mark.parametrize(
    "words", [("optimize", "--best", "6", "--pareto"), ("check",)], ids=["optimize", "check"]
)
def test_limit_binds_the_command_in_bounded_memory(
    chain: Path, tmp_path: Path, words: tuple[str, ...]
) -> None:
    """2e11 combinations, 1 s, 2 GB of addresses: a design, and what is missing is named.

    Processor time can only be less than what passes, so a busy machine does not fail this.
    """
    out = tmp_path / "out.json"
    pages = ("-o", f"html:{tmp_path / 'page.html'}", "-o", f"json:{out}")
    given = (*words, str(chain), "--time-limit", "1.5", "--quiet", *pages)
    code, used, complaint = run(*given, most_bytes=3 * 2**30)
    assert used < 1.5 + startup_s(), used
    assert "Traceback" not in complaint
    assert code in (0, 3)  # 3: no design by then, on a very busy machine
    if code == 0:
        data = json.loads(out.read_text("utf-8"))
        proof = data["proof"] if "proof" in data else data["choice"]["proof"]
        assert proof["rechecked"]
        assert data["verdict"] == "meets"


def test_runners_up_of_a_large_spec_need_no_time_limit(chain: Path) -> None:
    """The designs that differ in sensors alone come at once; the search did not end before."""
    problem = build_problem(load(chain))
    found = list(best(problem, 4))
    assert len({_sensors(problem, design) for design in found}) == 4
    costs = [evaluate(problem, design).cost or 0 for design in found]
    assert costs == sorted(costs)


def _sensors(problem: Problem, design: Design) -> tuple[str, ...]:
    pairs = zip(problem.roles, design.options, strict=True)
    return tuple(table.options[i].sensor for table, i in pairs)


def shared_names(problem: Problem) -> Problem:
    """Every two neighbours become one sensor under two methods."""
    roles = tuple(
        replace(
            table,
            options=tuple(
                replace(o, sensor=f"s{i // 2}", method=f"m{i}") for i, o in enumerate(table.options)
            ),
        )
        for table in problem.roles
    )
    return replace(problem, roles=roles)


@pytest.mark.parametrize("seed", range(25))
def test_designs_come_in_the_documented_order_by_splitting(seed: int) -> None:
    """Against every design written out and sorted; fixed seeds, exact figures."""
    rng = random.Random(seed)
    steps = [Fraction(n, 16) for n in (1, 2, 2, 3)]
    tables = [coarse_options(rng, rng.randint(2, 5), steps) for _ in ROLES]
    limits = {"cost": None, "mass": None, "power": Fraction(rng.randint(3, 8))}
    problem = shared_names(as_problem(tables, limits))
    keyed = sorted(
        (found["cost"], found["error"], found["cost"], found["mass"], found["power"], names)
        for found, names in plain_designs(tables)
        if found["power"] <= (limits["power"] or 0)
    )
    places = [tuple(int(name[1:]) for name in entry[-1]) for entry in keyed]
    # names s<i // 2>, m<i>: their order is that of the places, which have one digit here
    every = [d.options for d in iter_differing(problem, "names", clocks=True)]
    assert every == places
    seen: dict[tuple[int, ...], tuple[int, ...]] = {}
    for place in places:
        seen.setdefault(tuple(i // 2 for i in place), place)
    assert [d.options for d in best(problem, 10**6)] == list(seen.values())


@pytest.mark.parametrize("seed", range(8))
def test_search_gives_way_to_splitting_without_a_gap(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With next to no patience the same designs come in the same order, each once."""
    problem = random_problem(random.Random(seed), 60)
    whole = list(iter_best(problem))
    monkeypatch.setattr(ranked, "PATIENCE", 5)
    assert [evaluate(problem, d) for d in iter_best(problem)] == [
        evaluate(problem, d) for d in whole
    ]


@pytest.mark.parametrize("seed", range(12))
def test_design_in_hand_meets_and_its_gap_holds(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """When no proof comes in time: a design that meets, not below the bound, gap at least true."""
    from syncline_design.choice import decide

    problem = random_problem(random.Random(seed + 40), 100)
    proven = choose(problem)

    def late(*_: Any) -> Any:
        raise OutOfTime("the time limit was reached")

    monkeypatch.setattr(decide, "_proven", late)
    try:
        with within_s(60.0):
            found = choose(problem)
    except NoVerdict:
        assert not isinstance(proven, Choice) or problem.limits.sync < 1.0
        return
    assert isinstance(found, Choice)
    assert isinstance(proven, Choice)
    assert (found.proof.optimal, found.proof.rechecked) == (False, True)
    value, least = (_objective(problem, one.design) for one in (found, proven))
    bound = lower_bound(problem)
    assert bound <= least <= value
    gap = found.proof.gap
    assert gap is not None
    assert least >= (1 - Fraction(gap) - Fraction(1, 10**9)) * Fraction(value)


def _objective(problem: Problem, design: Design) -> Fraction:
    sums = evaluate(problem, design)
    if problem.objective == "error":
        return Fraction(sums.error_m)
    return Fraction(sums.amount(problem.objective) or 0)


def test_unproven_design_ends_zero_and_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from typer.testing import CliRunner

    from syncline_design.choice import decide

    def late(*_: Any) -> Any:
        raise OutOfTime("the time limit was reached")

    monkeypatch.setattr(decide, "_proven", late)
    spec = str(SPECS / "uav_corridor.yaml")
    for command in ("check", "optimize"):
        out = tmp_path / f"{command}.json"
        done = CliRunner().invoke(app, [command, spec, "--time-limit", "3", "-o", f"json:{out}"])
        assert done.exit_code == 0, done.output
        data = json.loads(out.read_text("utf-8"))
        proof = data["proof"] if command == "optimize" else data["choice"]["proof"]
        assert proof["optimal"] is False
        assert 0.0 <= proof["gap"] <= 1.0
        assert "not proven" in done.output or "a better design" in done.output
    monkeypatch.undo()
    done = CliRunner().invoke(app, ["check", spec, "--time-limit", "0"])
    assert done.exit_code == 3
    assert "time limit" in done.output


def test_several_specs_share_one_limit(chain: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    specs = [str(SPECS / "position_track.yaml"), str(chain), str(SPECS / "uav_corridor.yaml")]
    code, used, complaint = run("check", *specs, "--time-limit", "0", "-q", "-o", f"json:{out}")
    assert code == 3
    assert used < startup_s()
    if "nothing can be concluded" in complaint:  # a slow machine, ended while it was reading
        assert not out.exists()
        return
    words = [v["verdict"] for v in json.loads(out.read_text("utf-8"))["verdicts"]]
    assert words[1:] == ["indeterminate", "indeterminate"]


def test_deadline_in_force_reaches_every_search() -> None:
    problem = build_problem(load(SPECS / "uav_corridor.yaml"))
    assert in_force().left_s() is None
    with within(Deadline(0.0)):
        for search in (choose, lambda p: next(iter_best(p)), lambda p: list(best(p, 2))):
            with pytest.raises(NoVerdict, match="time limit"):
                search(problem)
    assert in_force().left_s() is None
    assert list(itertools.islice(iter_best(problem), 1))
