"""A choice that holds for any figures within their datasheet intervals."""

from __future__ import annotations

import itertools
import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from checked import check_file
from syncline_design.machine.records import read_as
from syncline_design.report.checks import render_checks
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings

QUICK = CheckSettings(monte_carlo=False)
DISTANCE, SPEED, TURN = 50.0, 20.0, math.radians(60.0)
TAUS = {"fine": 1e-5, "coarse": 1e-3, "late": 4e-3}  # uniform, plus and minus
PRICES = {"fine": 300, "coarse": 20, "late": 1}


class Figures:
    """Random sensors: sigmas with intervals, prices."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        self.limit = rng.uniform(0.1, 0.5)
        self.sync = rng.choice([1.0, 1.0, 0.5, 0.2])
        self.sensors: dict[str, list[tuple[str, int, tuple[tuple[float, float], ...]]]] = {}
        for role, (low, high), count in (
            ("position", (0.01, 0.08), 1), ("attitude", (0.0003, 0.002), 1),
            ("ranging", (0.01, 0.06), 2),
        ):  # fmt: skip
            own = []
            for i in range(3):
                spans = []
                for _ in range(count):
                    middle = rng.uniform(low, high)
                    wide = rng.choice([0.0, 0.2, 0.5])
                    spans.append((round(middle * (1 - wide), 6), round(middle * (1 + wide), 6)))
                if count == 2:  # the bearing, in rad
                    spans[1] = (spans[1][0] / 50, spans[1][1] / 50)
                own.append((f"{role}_{i}", rng.randint(100, 9000), tuple(spans)))
            self.sensors[role] = own

    def catalog(self) -> str:
        lines = ["sensors:"]
        keys = {"position": ["sigma_position"], "attitude": ["sigma_attitude"],
                "ranging": ["sigma_range", "sigma_bearing"]}  # fmt: skip
        for role, own in self.sensors.items():
            for name, price, spans in own:
                figures = ", ".join(
                    f"{key}: {low!r} {unit} .. {high!r} {unit}"
                    if low < high
                    else f"{key}: {low!r} {unit}"
                    for key, (low, high) in zip(keys[role], spans, strict=True)
                    for unit in ["rad" if key in ("sigma_attitude", "sigma_bearing") else "m"]
                )
                lines.append(
                    f"  {name}: {{modality: {role}, {figures}, primitives: [pps], "
                    f"cost: {price} EUR, source: t}}"
                )
        lines.append("timestamping:")
        lines += [
            f"  {name}: {{primitives: [pps], timeline: host, cost: {PRICES[name]} EUR, source: t, "
            f"error: {{distribution: uniform, low: {-tau!r} s, high: {tau!r} s}}}}"
            for name, tau in TAUS.items()
        ]
        return "\n".join(lines) + "\n"

    def spec(self, choose_for: str) -> str:
        roles = "\n".join(
            f"    {role}: {{candidates: [{', '.join(name for name, *_ in own)}]}}"
            for role, own in self.sensors.items()
        )
        return f"""syncline: 1
name: intervals
catalogs: [own.yaml]
choose_for: {choose_for}
requirements:
  - {{id: ACC, kind: accuracy, limit: {self.limit!r} m}}
  - {{id: SYNC, kind: sync, limit: {self.sync}}}
stages:
  - name: uav
    platform: {{v_max: {SPEED} m/s, omega_max: 60 deg/s, distance: {DISTANCE} m, baseline: 1 m}}
{roles}
timestamping: {{candidates: [{", ".join(TAUS)}]}}
"""

    def by_price(self) -> list[tuple[int, Any, tuple[str, ...]]]:
        """Every design with its price, the cheapest first."""
        return sorted(
            (sum(price for _, price, _ in chosen) + sum(PRICES[m] for m in stamps), chosen, stamps)
            for chosen in itertools.product(*self.sensors.values())
            for stamps in itertools.product(TAUS, repeat=3)
        )

    def cheapest(self, *, always: bool) -> float | None:
        """By trying every design at every corner of its intervals, or in their middle."""
        for cost, chosen, stamps in self.by_price():
            spans = [span for _, _, own in chosen for span in own]
            corners: list[tuple[float, ...]] = [tuple((low + high) / 2 for low, high in spans)]
            if always:
                corners = list(itertools.product(*(dict.fromkeys(span) for span in spans)))
            if all(self._holds(corner, [TAUS[m] for m in stamps]) for corner in corners):
                return cost
        return None

    def _holds(self, figures: tuple[float, ...], taus: list[float]) -> bool:
        position = math.sqrt(3) * figures[0]
        attitude = math.sqrt(3) * figures[1] * DISTANCE
        ranging = figures[2] + math.sqrt(2) * figures[3] * DISTANCE
        rate = SPEED + DISTANCE * TURN
        error, tau = position + attitude + ranging, max(taus[0], taus[1]) + taus[2]
        ratios = [taus[0] * SPEED / position, taus[1] * rate / attitude, taus[2] * rate / ranging,
                  tau * rate / error]  # fmt: skip
        return error + rate * tau <= self.limit and max(ratios) < self.sync

    def probable(self, probability: float) -> tuple[float | None, float]:
        """The cheapest that holds in the middle and with a probability; how close any came to it.

        By 20 000 samples of a generator of its own.
        """
        rng = np.random.default_rng(99)
        best, nearest = None, 1.0
        for chosen in itertools.product(*self.sensors.values()):
            spans = [span for _, _, own in chosen for span in own]
            middle = tuple((low + high) / 2 for low, high in spans)
            drawn = [low + (high - low) * rng.random(20_000) for low, high in spans]
            for stamps in itertools.product(TAUS, repeat=3):
                cost = sum(price for _, price, _ in chosen) + sum(PRICES[m] for m in stamps)
                taus = [TAUS[m] for m in stamps]
                if (best is not None and cost >= best) or not self._holds(middle, taus):
                    continue
                share = float(np.mean(self._holds_each(drawn, taus)))
                if cost > 0:
                    nearest = min(nearest, abs(share - probability))
                if share >= probability:
                    best = cost
        return best, nearest

    def _holds_each(self, figures, taus: list[float]):
        position = math.sqrt(3) * figures[0]
        attitude = math.sqrt(3) * figures[1] * DISTANCE
        ranging = figures[2] + math.sqrt(2) * figures[3] * DISTANCE
        rate = SPEED + DISTANCE * TURN
        error, tau = position + attitude + ranging, max(taus[0], taus[1]) + taus[2]
        keeps = error + rate * tau <= self.limit
        for own, moves, sigma in zip(
            [*taus, tau], [SPEED, rate, rate, rate], [position, attitude, ranging, error],
            strict=True,
        ):  # fmt: skip
            keeps = keeps & (own * moves / sigma < self.sync)
        return keeps


def checked(folder: Path, figures: Figures, choose_for: str):
    (folder / "own.yaml").write_text(figures.catalog(), "utf-8")
    path = folder / "spec.yaml"
    path.write_text(figures.spec(choose_for), "utf-8")
    return check_file(path, QUICK)


def test_always_is_the_cheapest_that_holds_at_every_corner(tmp_path: Path) -> None:
    dearer = none = 0
    for seed in range(14):
        figures = Figures(seed)
        always, given = (figures.cheapest(always=one) for one in (True, False))
        found = checked(tmp_path, figures, "always")
        if always is None:
            none += 1
            assert found.verdict == "infeasible", seed
            continue
        assert found.verdict == "meets", seed
        assert found.design is not None
        assert found.design.cost == always, seed
        assert found.robustness is not None
        assert found.robustness.nominal is not None
        assert found.robustness.nominal.cost == given, seed
        assert given is not None
        assert found.robustness.price == always - given
        dearer += always > given
    assert dearer >= 2
    assert none >= 1


def test_the_worst_end_is_shown_beside_the_given_figures(tmp_path: Path) -> None:
    figures = next(f for f in map(Figures, range(20)) if f.cheapest(always=True) is not None)
    found = checked(tmp_path, figures, "always")
    rows = {row.id: row for row in found.requirements}
    assert found.syncline is not None
    assert rows["ACC"].value is not None
    assert rows["ACC"].value >= found.syncline.total_m
    assert "at given figures" in rows["ACC"].note
    text = render_checks("json", [found])
    assert json.loads(text)["robustness"]["choose_for"] == "always"
    assert read_as(Verdict, text) == found
    assert "What robustness costs" in render_checks("markdown", [found])


def test_a_probability_is_reached_by_the_cheapest_that_reaches_it(tmp_path: Path) -> None:
    between = 0
    for seed in range(40):
        figures = Figures(seed)
        cost, nearest = figures.probable(0.9)
        if nearest < 0.015 or cost is None:  # too close for two sets of samples to agree
            continue
        found = checked(tmp_path, figures, "0.9")
        assert found.design is not None
        assert found.design.cost == cost, seed
        assert found.robustness is not None
        estimate = found.robustness.probability
        assert estimate is not None
        assert estimate.low >= 0.9
        row = next(row for row in found.requirements if row.id == "CHOOSE_FOR")
        assert row.status == "pass"
        assert row.value == pytest.approx(1.0 - estimate.value)
        between += cost != figures.cheapest(always=False) or cost != figures.cheapest(always=True)
        if between == 4:
            break
    assert between == 4


def test_a_pinned_design_below_the_probability_fails(tmp_path: Path) -> None:
    figures = Figures(0)
    figures.limit = 0.3
    text = figures.spec("0.9")
    for role, own in figures.sensors.items():
        name = own[0][0]
        text = text.replace(
            f"{role}: {{candidates: [{', '.join(one for one, *_ in own)}]}}",
            f"{role}: {{sensor: {name}, primitive: pps, timestamping: fine}}",
        )
    (tmp_path / "own.yaml").write_text(figures.catalog(), "utf-8")
    path = tmp_path / "spec.yaml"
    rng = np.random.default_rng(5)
    drawn = [low + (high - low) * rng.random(50_000)
             for own in figures.sensors.values() for low, high in own[0][2]]  # fmt: skip
    words = set()
    for limit in (0.1, 0.15, 0.2, 0.25, 0.3, 0.4):
        figures.limit, figures.sync = limit, 1.0
        path.write_text(text.replace("limit: 0.3 m", f"limit: {limit} m"), "utf-8")
        share = float(np.mean(figures._holds_each(drawn, [1e-5] * 3)))
        found = check_file(path, QUICK)
        if abs(share - 0.9) > 0.01:
            assert found.verdict == ("meets" if share > 0.9 else "fails"), (limit, share)
            words.add(found.verdict)
    assert words == {"meets", "fails"}


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("kind: accuracy", "kind: thu", "6:21"),
        ("name: intervals", "name: intervals\nobjective: error", "5:13"),
    ],
)
def test_what_a_probability_does_not_go_with(old: str, new: str, place: str) -> None:
    text = Figures(0).spec("0.9").replace(old, new)
    with pytest.raises(BadInput) as refused:
        load_text(text, "spec.yaml")
    assert f"spec.yaml:{place}: " in str(refused.value)
    assert "choose_for" in str(refused.value)


@pytest.mark.parametrize("value", ["alwas", "1.5", "0.4", "[0.9]"])
def test_what_choose_for_cannot_be(value: str) -> None:
    with pytest.raises(BadInput) as refused:
        load_text(Figures(0).spec(value).replace("catalogs: [own.yaml]\n", ""), "spec.yaml")
    assert "spec.yaml:3:13: choose_for" in str(refused.value)
