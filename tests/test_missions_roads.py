"""A family's payload by every road, in hand before the proof, and what else it could buy."""

from __future__ import annotations

import functools
import random
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
import yaml

from checked import check_file
from random_families import Tried, all_tried, plain_front, plain_order, random_family
from syncline_design.choice import family_roads
from syncline_design.choice.evaluate import error_key
from syncline_design.choice.family import Family
from syncline_design.choice.family_best import family_front, iter_differing
from syncline_design.choice.family_parts import sensor_groups, without_sensor
from syncline_design.choice.family_roads import choose_by_road, in_hand
from syncline_design.choice.outcome import OutOfTime, TooLarge
from syncline_design.machine.deadline import Deadline, within
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings

SHIPPED = Path(__file__).parent.parent / "examples" / "uav_three_heights.yaml"
FEASIBLE = (14, 26, 31, 35, 60, 80)  # with several designs that meet every mission
WITHOUT = (0,)  # families that no design meets


SMALL = 250  # combinations of the families that are tried out whole


@functools.cache
def _family(seed: int) -> Family:
    return random_family(random.Random(seed), 24)


@functools.cache
def _tried(seed: int) -> tuple[Tried, ...]:
    """Every design of a family, once for all tests."""
    return tuple(all_tried(_family(seed)))


def _families(first: int, last: int) -> Iterator[tuple[int, Family]]:
    for seed in range(first, last):
        family = _family(seed)
        if family.combinations <= SMALL:
            yield seed, family


@pytest.mark.parametrize("seed", [*FEASIBLE, *WITHOUT])
def test_every_road_comes_to_the_same_payload(seed: int) -> None:
    family = _family(seed)
    wanted = plain_order(family, _tried(seed))[:1]
    for method in ("milp", "enumerate", "front", "auto"):
        choice = choose_by_road(family, method)
        found = [] if choice.found is None else [choice.found.rank[:2]]
        assert found == wanted, method
        assert choice.proof.optimal
        if method == "milp" and not family.is_empty:
            assert choice.proof.agrees_with == ("front",)


def _sensors(one: Tried) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(names[0] for names in way) for way in one.names)


def _key(family: Family, one: Tried) -> tuple[Fraction | float, float]:
    error = error_key(one.error_m)
    return (error if family.objective == "error" else one.amounts[family.objective], error)


def test_the_next_payloads_differ_in_sensors() -> None:
    compared = 0
    for seed, family in _families(0, 36):
        best: dict[Any, Any] = {}
        for one in all_tried(family):
            if one.keeps and one.accurate:
                key, own = _sensors(one), _key(family, one)
                best[key] = min(own, best.get(key, own))
        groups = [sensor_groups(family, r) for r in range(len(family.roles))]
        found = [one.rank[:2] for one in iter_differing(family, groups)]
        assert found == sorted(best.values()), seed
        compared += len(found)
    assert compared > 30


def test_the_best_without_a_sensor_and_the_accurate_front() -> None:
    compared = points = 0
    for seed, family in _families(60, 92):
        kept = [one for one in all_tried(family) if one.keeps and one.accurate]
        out: list[tuple[Fraction, float]] = []
        for own in sorted((one.amounts["cost"], error_key(one.error_m)) for one in kept):
            if not out or own[1] < out[-1][1]:
                out.append(own)
        front = family_front(family, accuracy=True)
        assert [(p.amount, error_key(p.error_m)) for p in front] == out, seed
        points += len(out)
        for sensor in sorted({name for one in kept for way in _sensors(one) for name in way})[:2]:
            rest = [o for o in kept if not any(sensor in way for way in _sensors(o))]
            wanted = min((_key(family, one) for one in rest), default=None)
            found = choose_by_road(without_sensor(family, sensor)).found
            assert (found and found.rank[:2]) == wanted, (seed, sensor)
            compared += 1
    assert compared > 10
    assert points > 10


def test_where_merging_gives_up_other_roads_take_over(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_large(*_: object, **__: object) -> None:
        raise TooLarge("too large")

    for name in ("best_of_family", "family_front"):
        monkeypatch.setattr(family_roads, name, too_large)
    points = 0
    for seed in (26, 31, *WITHOUT):
        family = _family(seed)
        choice = choose_by_road(family)
        assert choice.proof.method == "milp"
        best = [] if choice.found is None else [choice.found.rank[:2]]
        assert best == plain_order(family, _tried(seed))[:1]
        wanted = plain_front(family, "cost", _tried(seed))
        for most in (0, 10**6):  # by integer programs, by enumeration
            monkeypatch.setattr(family_roads, "MOST_ENUMERATED", most)
            front = family_roads.front_by_road(family)
            assert [(p.amount, error_key(p.error_m)) for p in front] == wanted, seed
        points += len(wanted)
    assert points > 2


def test_a_design_in_hand_meets_and_its_gap_holds() -> None:
    met = 0
    for seed in FEASIBLE:
        family = _family(seed)
        order = plain_order(family, _tried(seed))
        with within(Deadline(60.0)):
            held = in_hand(family)
        assert held is not None
        assert held.found.rank[:2] in order
        value, best = float(held.found.rank[0]), float(order[0][0])
        gap = held.proof(family, "auto").gap
        assert gap is not None
        assert value * (1.0 - gap) <= best * (1.0 + 1e-12)
        met += 1
    assert met == len(FEASIBLE)


def test_a_time_limit_leaves_a_rechecked_payload(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> None:
        raise OutOfTime("over")

    monkeypatch.setattr("syncline_design.verdict.family.choose_by_road", late)
    with within(Deadline(60.0)):
        found = check_file(SHIPPED, CheckSettings(monte_carlo=False))
    assert found.verdict == "meets"
    assert found.exit_code == 0
    assert found.choice is not None
    assert found.choice.proof is not None
    assert found.choice.proof.optimal is False
    assert found.choice.proof.rechecked
    assert found.choice.proof.gap is not None
    assert "not-proven-optimal" in {one.code for one in found.warnings}


def _shipped_without(tmp_path: Path, sensor: str) -> Verdict:
    spec = yaml.safe_load(SHIPPED.read_text("utf-8"))
    for role in ("position", "attitude", "ranging"):
        names = spec["stages"][0][role]["candidates"]
        spec["stages"][0][role]["candidates"] = [name for name in names if name != sensor]
    path = tmp_path / f"{sensor}.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    return check_file(path, CheckSettings(monte_carlo=False))


def test_alternatives_are_what_the_spec_without_the_sensor_says(tmp_path: Path) -> None:
    found = check_file(SHIPPED, CheckSettings(monte_carlo=False, road="milp"))
    assert found.choice is not None
    assert found.choice.proof is not None
    assert (found.choice.proof.method, found.choice.proof.agrees_with) == ("milp", ("front",))
    assert found.design is not None
    assert found.design.cost is not None
    assert found.choice.alternatives
    for one in found.choice.alternatives:
        other = _shipped_without(tmp_path, one.sensor)
        assert other.verdict == one.verdict
        if other.design is None:
            assert one.cost is None
            continue
        assert one.cost == other.design.cost
        assert one.dearer_by == pytest.approx(other.design.cost - found.design.cost, abs=1e-9)
    following = found.choice.next_best
    assert following is not None
    costs = [one.cost for one in following]
    assert costs == sorted(costs)
    assert found.choice.next_best_every is not None
    first = found.choice.next_best_every[0].cost
    assert first is not None
    assert found.design.cost <= first
    assert costs[0] is not None
    assert first <= costs[0]
    stamped = following[0].stampings
    assert stamped is not None
    assert stamped.cost is not None
    assert stamped.cost[0] == costs[0]


def test_what_nothing_asks_for_may_be_unknown(tmp_path: Path) -> None:
    """A sensor without a price may have the least error; it has no place on the front of cost."""
    spec = yaml.safe_load(SHIPPED.read_text("utf-8"))
    spec |= {"objective": "error", "catalogs": ["mine.yaml"]}
    spec["requirements"] = [one for one in spec["requirements"] if one["kind"] != "cost"]
    spec["stages"][0]["attitude"] = {"candidates": ["novatel_cpt7"]}
    spec["stages"][0]["position"] = {"candidates": ["ublox_f9p_rtk", "mine"]}
    own = {"name": "mine", "modality": "position", "type": "gnss", "sigma_position": "1 mm"}
    catalog = {"sensors": {"mine": own | {"primitives": ["pps"], "source": "measured"}}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(catalog), "utf-8")
    path = tmp_path / "unpriced.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    found = check_file(path, CheckSettings(monte_carlo=False))
    assert found.verdict == "meets"
    assert found.design is not None
    assert found.design.cost is None
    assert found.design.stages[0].roles["position"].sensor == "mine"
    assert found.choice is not None
    assert found.choice.front
    drawn = {one.design.stages[0].roles["position"].sensor for one in found.choice.front}
    assert drawn == {"ublox_f9p_rtk"}
