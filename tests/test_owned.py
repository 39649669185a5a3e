"""What is owned costs nothing and weighs what it weighs; money adds up to the cent in any currency.

The oracle is plain enumeration over a catalog whose prices were changed by hand: 0 for what is
owned, converted and rounded piece by piece in decimals.
"""

from __future__ import annotations

import copy
import random
from collections import Counter
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed, read_catalog
from syncline_design.choice.decide import choose
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem, selection_of
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.choice_data import front_designs
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.verify import CheckSettings, check_loaded
from test_random_specs import draw_spec

QUIET = CheckSettings(monte_carlo=False)
RATES = ["0.9173", "1.25", "11.7351", "0.0861"]
OWNABLE = ("sensors", "infrastructure", "clocks")


def case_of(spec: dict[str, Any]) -> Any:
    return load_text(yaml.safe_dump(spec, sort_keys=False), "specs/drawn.yaml")


def priced_anew(owned: list[str], rate: str | None) -> dict[str, Any]:
    """The catalogs with prices as the spec has to pay them."""
    catalog = copy.deepcopy(read_catalog(families=True))
    for section in ("sensors", "timestamping", "infrastructure", "clocks"):
        for name, entry in catalog[section].items():
            if "cost" in entry:
                written = entry["cost"]["value"] if isinstance(entry["cost"], dict) else None
                amount = Decimal(str(written or entry["cost"]).split(" ")[0]) * Decimal(rate or "1")
                entry["cost"] = f"{amount.quantize(Decimal('0.01'), ROUND_HALF_UP)} EUR"
            if name in owned and section in OWNABLE:
                entry["cost"] = "0 EUR"
    return catalog


def with_money(spec: dict[str, Any], rng: random.Random) -> tuple[dict[str, Any], Enumeration]:
    """A drawn spec with owned entries, in half of them with another currency; and its oracle."""
    plain = Enumeration(spec)
    names = {option.sensor for slot in plain.slots for option in plain.options(slot)}
    methods = [plain.catalog["timestamping"][m] for m in spec["timestamping"]["candidates"]]
    names |= {item for one in methods for item in one.get("requires", {})}
    names |= {c for v in plain.vehicles for c in plain.clocks(v) if c is not None}
    owned = [name for name in sorted(names) if rng.random() < 0.3]
    rate = rng.choice(RATES) if rng.random() < 0.5 else None
    spec = spec | {"owned": owned}
    if rate:
        spec |= {"currency": "USD", "exchange_rates": {"EUR": f"{rate} USD"}}
    return spec, Enumeration(spec, catalog=priced_anew(owned, rate))


def cents(amount: float) -> int:
    return round(100 * amount)


def staircase(spec: dict[str, Any], outcomes: list[Outcome]) -> list[tuple[int, float]]:
    kept = {(cents(one.cost), one.total_m) for one in outcomes if not failed(spec, one)}
    points: list[tuple[int, float]] = []
    for cost, error in sorted(kept):
        if not points or error < points[-1][1] * (1 - 1e-12):
            points.append((cost, error))
    return points


def test_fronts_designs_and_bills_agree_to_the_cent_with_what_is_owned() -> None:
    rng, seen = random.Random(15), Counter[str]()
    while seen["specs"] < 14:
        seen += compare_money(rng, by_program=seen["specs"] == 6)
    assert seen["several points"] >= 4
    assert seen["boards and clocks"] >= 2


def compare_money(rng: random.Random, *, by_program: bool = False) -> Counter[str]:
    """The next spec of a size that can be enumerated, with money; counts what was compared."""
    drawn = draw_spec(rng)
    if not 2 <= Enumeration(drawn).count <= 1500:
        return Counter()
    spec, plain = with_money(drawn, rng)
    expected = staircase(spec, list(plain))
    case = case_of(spec)
    problem = build_problem(case)
    points = tuple(front(problem))
    assert [cents(float(p.amount)) for p in points] == [cost for cost, _ in expected]
    assert [p.error_m for p in points] == pytest.approx([e for _, e in expected], rel=1e-9)
    seen = Counter({"specs": 1, "several points": len(points) > 1})
    if not points:
        return seen
    verdict = check_loaded(case, QUIET)
    assert verdict.design is not None
    assert verdict.bill_of_materials is not None
    paid = [Decimal(repr(line.cost)) for line in verdict.bill_of_materials]
    assert cents(verdict.design.cost or 0.0) == expected[0][0] == 100 * sum(paid)
    assert front_designs(case, problem, points)[0].cost == verdict.design.cost
    for line in verdict.bill_of_materials:
        mine = line.entry in spec["owned"] and not line.use.endswith("timestamping")
        assert line.basis.startswith("owned") == mine
        assert not (mine and line.cost)
        seen["boards and clocks"] += mine and line.use in ("shared hardware", "host clock")
    design = choose(problem)
    assert isinstance(design, Choice)
    exact = recheck(case, selection_of(problem, design.design))
    assert exact.cost == evaluate(problem, design.design).cost
    assert exact.mass == evaluate(problem, design.design).mass
    if by_program:
        found = choose(problem, "milp")
        assert isinstance(found, Choice)
        assert evaluate(problem, found.design).cost == exact.cost
    return seen


ONE = """\
syncline: 1
name: A track
owned: [{owned}]
requirements:
  - {{id: ACC, kind: accuracy, limit: 5 m}}
  - {{id: COST, kind: cost, limit: {limit}}}
stages:
  - name: rover
    platform: {{name: rover, v_max: 1 m/s, omega_max: 10 deg/s, distance: 20 m, baseline: 1 m}}
    clock: {{candidates: [rubidium, ntp]}}
    position: {{candidates: {query}}}
timestamping: {{candidates: [hardware, gpio]}}
"""


def one(owned: str, limit: str = "100000 EUR", query: str = "[ublox_f9p_rtk]") -> Any:
    return load_text(ONE.format(owned=owned, limit=limit, query=query), "specs/one.yaml")


def test_what_is_owned_is_free_but_not_massless() -> None:
    catalog = read_catalog(families=True)
    free = check_loaded(one("ublox_f9p_rtk"), QUIET)
    paid = check_loaded(one(""), QUIET)
    assert free.design is not None
    assert paid.design is not None
    assert free.design.mass == paid.design.mass
    saved = Decimal(repr(paid.design.cost)) - Decimal(repr(free.design.cost))
    assert saved == Decimal(catalog["sensors"]["ublox_f9p_rtk"]["cost"].split(" ")[0])
    assert [a.figure for a in free.assumptions if a.entry == "ublox_f9p_rtk"] == [
        a.figure for a in paid.assumptions if a.entry == "ublox_f9p_rtk" and a.figure != "cost"
    ]


def test_a_query_with_a_price_finds_what_is_owned() -> None:
    query = "{modality: position, max_cost: 1 EUR}"
    with pytest.raises(BadInput, match="no sensor of the catalogs matches"):
        one("", query=query)
    found = check_loaded(one("trimble_r12_rtk", query=query), QUIET)
    assert found.design is not None
    assert {role.sensor for _, _, role in found.design.roles} == {"trimble_r12_rtk"}


def test_how_many_pieces_it_takes_and_what_is_of_no_use_is_said() -> None:
    two = yaml.safe_load(ONE.format(owned="ntp", limit="1 EUR", query="[x]"))
    platform = two["stages"].pop()["platform"]
    two["owned"], two["timestamping"] = ["sbg_apogee", "timing_board", "ntp"], "hardware"
    two["requirements"] = [{"id": "ACC", "kind": "accuracy", "limit": "900 m"}]
    for name in ("rover", "boat"):
        stage = {
            "name": name, "platform": dict(platform),
            "attitude": {"sensor": "sbg_apogee"}, "ranging": {"sensor": "riegl_vux1uav"},
        }  # fmt: skip
        if name == "rover":
            stage["position"] = {"sensor": "ublox_f9p_rtk"}
        two["stages"].append(stage)
    warned = {
        (w.code, w.entry): w.message
        for w in check_loaded(case_of(two), QUIET).warnings
        if w.code.startswith("owned")
    }
    assert set(warned) == {
        ("owned-pieces", "sbg_apogee"), ("owned-pieces", "timing_board"), ("owned-unused", "ntp"),
    }  # fmt: skip
    assert "takes 2 of sbg_apogee" in warned["owned-pieces", "sbg_apogee"]


@pytest.mark.parametrize(
    ("owned", "column", "words"),
    [
        ("ublox_f9p_rtc", 9, "did you mean ublox_f9p_rtk"),
        ("ntp, hardware", 14, "hardware is a timestamping method, which each sensor that uses it"),
        ("ntp, uav_fixed_wing", 14, "nothing to own"),
        ("ntp, ntp", 14, "owned twice"),
        ("12", 9, "text"),
    ],
)
def test_what_cannot_be_owned_is_refused_in_its_place(owned: str, column: int, words: str) -> None:
    with pytest.raises(BadInput) as caught:
        one(owned)
    text = str(caught.value)
    assert text.startswith(f"specs/one.yaml:3:{column}:"), text
    assert words in text


def test_a_sensor_of_the_spec_itself_can_be_owned(tmp_path: Path) -> None:
    spec = yaml.safe_load(ONE.format(owned="", limit="1000 EUR", query="x"))
    own = {"modality": "position", "sigma_position": "1 cm", "primitives": ["pps"]}
    spec["stages"][0]["position"] = {"sensor": own}
    text = yaml.safe_dump(spec)
    with pytest.raises(BadInput, match="has no cost"):
        load_text(text, "specs/one.yaml")
    spec["owned"] = ["rover.position"]
    verdict = check_loaded(case_of(spec), QUIET)
    assert verdict.bill_of_materials is not None
    assert (verdict.bill_of_materials[0].cost, verdict.bill_of_materials[0].basis) == (0.0, "owned")
