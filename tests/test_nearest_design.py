"""Fixes in the order of what they ask, and the design nearest to an infeasible spec.

Oracle: plain enumeration.  Of each requirement alone the least value over the designs that keep the
rest; the one that has to move by the smallest share of itself is moved, and the best design then is
the nearest.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed, limits_of
from syncline_design.choice.problem import build_problem
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.spec.load import load_text
from syncline_design.verdict.named import PricedError
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPECS = Path(__file__).parent.parent / "specs"
QUIET = CheckSettings(monte_carlo=False)


def spec_of(accuracy: str, cost: str) -> dict[str, Any]:
    spec: dict[str, Any] = yaml.safe_load((SPECS / "infeasible_example.yaml").read_text("utf-8"))
    for one in spec["requirements"]:
        one["limit"] = {"accuracy": accuracy, "cost": cost}.get(one["kind"], one["limit"])
    return spec


def value(one: Outcome, kind: str) -> float:
    return {"accuracy": one.total_m, "cost": one.cost, "sync": one.sync}[kind]


@pytest.mark.parametrize(
    ("accuracy", "cost"), [("5 cm", "60000 EUR"), ("5 cm", "130000 EUR"), ("28 cm", "59000 EUR")]
)
def test_the_nearest_design_is_that_of_the_least_change(accuracy: str, cost: str) -> None:
    spec = spec_of(accuracy, cost)
    every = list(Enumeration(spec))
    assert not any(not failed(spec, o) for o in every)
    least: dict[str, tuple[float, float]] = {}
    for name, (kind, limit) in limits_of(spec).items():
        rest = [o for o in every if failed(spec, o) <= {name}]
        if rest and kind != "sync":
            reached = min(value(o, kind) for o in rest)
            least[name] = (reached / limit - 1, reached)
    expected = min(least, key=lambda name: least[name][0])
    verdict = check_loaded(load_text(yaml.safe_dump(spec), "specs/near.yaml"), QUIET)
    near, why = verdict.nearest, verdict.infeasibility
    assert near is not None
    assert why is not None
    (missed,) = near.misses
    assert missed.requirement == expected
    kind, limit = limits_of(spec)[expected]
    # a limit is written in so many figures, or whole units of money, rounded up
    to = next(fix.to for fix in why.fixes if fix.requirement == expected)
    assert to is not None
    assert least[expected][1] <= to <= least[expected][1] * 1.01 + 1.0 * (kind == "cost")
    kept = [
        o for o in every if failed(spec, o) <= {expected} and value(o, kind) <= to * (1 + 1e-12)
    ]
    best = min((round(o.cost, 6), o.total_m) for o in kept)
    assert (near.cost, near.error_m) == pytest.approx(best, rel=1e-9)
    assert missed.value == pytest.approx(near.error_m if kind == "accuracy" else near.cost)
    assert missed.limit == pytest.approx(limit)
    sizes = [math.inf if fix.relative is None else fix.relative for fix in why.fixes]
    assert sizes == sorted(sizes)
    for fix in why.fixes:
        if fix.from_ and fix.to:
            assert fix.relative == pytest.approx(abs(fix.to - fix.from_) / fix.from_)
    priced = [(p.cost, p.error_m) for p in near.front]
    assert priced == plain_front(spec, every)
    for point in near.front:
        same = twin(every, point)
        told = {one.requirement: (one.value, one.limit) for one in point.misses or ()}
        assert told == {
            name: pytest.approx((value(same, limits_of(spec)[name][0]), limits_of(spec)[name][1]))
            for name in failed(spec, same)
        }
    assert "The nearest design" in console(on_verdict(verdict))
    if accuracy == "5 cm":
        assert "Nearest: " in html(on_verdict(verdict))  # drawn, and said for those who cannot see


def twin(every: list[Outcome], point: PricedError) -> Outcome:
    """The enumerated design of the same sensors and stamps; it costs and errs as much."""
    assert point.design is not None
    named = [(role.sensor, role.primitive, role.timestamping) for _, _, role in point.design.roles]
    (found,) = (
        one for one in every if [(o.sensor, o.primitive, o.method) for o in one.options] == named
    )
    assert (found.cost, found.total_m) == pytest.approx((point.cost, point.error_m), rel=1e-9)
    return found


def test_the_front_of_an_infeasible_spec_says_which_designs_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both ends in words with what they miss, on the console too; every dot by its sensors."""
    text = (SPECS / "infeasible_example.yaml").read_text("utf-8")
    verdict = check_loaded(load_text(text, "specs/infeasible_example.yaml"), QUIET)
    monkeypatch.setenv("COLUMNS", "300")
    said = console(on_verdict(verdict))
    cheapest, exact = (
        next(line for line in said.splitlines() if line.strip().startswith(end))
        for end in ("cheapest", "most exact")
    )
    assert "32 742.35 EUR  575.6 cm  ACC-1: 575.6 cm where 5 cm is asked" in cheapest
    assert "u-blox F9P, no corrections" in cheapest
    assert "COST-1: 141 762.35 EUR where 60 000 EUR is asked" in exact
    page = html(on_verdict(verdict)).replace('<span class="whole">u-blox</span>', "u-blox")
    values = page[page.index("fig-front") :]
    assert "u-blox F9P with RTK corrections (hardware), Kongsberg Seatex MRU 5" in values


def plain_front(spec: dict[str, Any], every: list[Outcome]) -> list[Any]:
    """Cost against error over what keeps everything but those two."""
    free = {name for name, (kind, _) in limits_of(spec).items() if kind in ("accuracy", "cost")}
    points: list[tuple[float, float]] = []
    for cost, error in sorted(
        (round(o.cost, 6), o.total_m) for o in every if failed(spec, o) <= free
    ):
        if not points or error < points[-1][1] * (1 - 1e-12):
            points.append((cost, error))
    return [pytest.approx(point, rel=1e-9) for point in points]


def test_a_role_without_options_is_nearest_at_a_looser_sync_limit() -> None:
    text = (SPECS / "infeasible_no_option.yaml").read_text("utf-8")
    case = load_text(text, "specs/none.yaml")
    assert not all(len(table.options) for table in build_problem(case).roles)
    near = check_loaded(case, QUIET).nearest
    assert near is not None
    assert [one.requirement for one in near.misses] == ["SYNC-1"]
    spec = yaml.safe_load(text)
    limit = next(r for r in spec["requirements"] if r["id"] == "SYNC-1")
    limit["limit"] = near.misses[0].value
    kept = [o for o in Enumeration(spec) if not failed(spec, o)]
    assert near.cost == pytest.approx(min(o.cost for o in kept), abs=1e-6)
    assert near.front == ()  # no design keeps the sync limit at any price


def test_a_simulated_limit_is_missed_by_what_is_simulated() -> None:
    """The figure is that of the design's own verdict, not the limit that would let it pass."""
    spec = yaml.safe_load((SPECS / "usv_mapping.yaml").read_text("utf-8"))
    (simulated,) = [one for one in spec["requirements"] if one["kind"] == "monte_carlo"]
    simulated["limit"] = "20 cm"
    pinned = check_loaded(load_text(yaml.safe_dump(spec), "specs/pinned.yaml"), CheckSettings())
    own = next(one for one in pinned.requirements if one.id == simulated["id"])
    assert own.low is not None
    assert own.high is not None
    position = spec["stages"][0]["position"]
    position["candidates"] = [position.pop("sensor")]
    position.pop("primitive", None)
    case = load_text(yaml.safe_dump(spec), "specs/open.yaml")
    near = check_loaded(case, CheckSettings()).nearest
    assert near is not None
    (missed,) = near.misses
    assert missed.requirement == simulated["id"]
    assert own.low <= missed.value <= own.high
