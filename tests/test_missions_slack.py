"""What a family's payload hinges on: each figure moved in spec and catalog, every payload tried."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from family_specs import Raw, Tried, drawn, grown, payload, sheet_figures, written
from syncline_design.choice.slack import Slack
from syncline_design.spec.load import load
from syncline_design.verdict.optimization import Optimization
from syncline_design.verdict.optimize import OptimizeSettings, optimize

NEAR = 1e-5


class Family:
    """A spec, what is said of it, and what trying every payload says."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.spec, self.parts = drawn(seed)
        case = load(written(folder, self.spec, self.parts))
        self.said: Optimization = optimize(case, OptimizeSettings()).result
        self.tried = Tried(self.spec, self.parts)
        self.roles = [(role, one) for _, role, one in self.said.designs[0].design.roles]
        self.own = tuple((one.sensor, one.timestamping) for _, one in self.roles)

    def at(self, row: Slack, value: float) -> tuple[bool, bool]:
        """Whether the payload meets every mission, and is chosen, with a row at a value."""
        chosen = [(role, one.sensor, one.timestamping) for role, one in self.roles]
        asked = SimpleNamespace(term=row.term, value=row.value, mission=row.mission, payload=chosen)
        found = Tried(*grown(self.spec, self.parts, asked, value))
        names: Callable[[Any], Any] = lambda one: tuple(  # noqa: E731
            (sensor, chosen[r][2] if method == "grown" else method)
            for r, (sensor, method) in enumerate(payload(one) or ())
        )
        return self.own in map(names, found.good), names(found.best()) == self.own


def compare_slack(family: Family) -> int:
    """Every threshold of the ledger, from both sides; how many there were."""
    rows, compared = family.said.slack, 0
    assert rows is not None
    assert {row.mission for row in rows} >= {one["name"] for one in family.spec["missions"]}
    for row in rows:
        for value in {row.fails_at, row.payload_changes_at} - {None}:
            below = family.at(row, max(row.value, value * (1 - NEAR)))
            above = family.at(row, value * (1 + NEAR))
            if value == row.fails_at:
                assert (below[0], above[0]) == (True, False), row
            if value == row.payload_changes_at:
                assert (below[1], above[1]) == (True, False), row
            compared += 1
    return compared


def compare_measurements(family: Family) -> int:
    """Every datasheet figure 20 % up and down; how many flip the choice."""
    best, wanted = family.tried.best(), {}
    for sensor, key in sheet_figures(family.parts):
        for share in (0.8, 1.2):
            parts: Raw = copy.deepcopy(family.parts)
            size, unit = parts["sensors"][sensor][key].split()
            parts["sensors"][sensor][key] = f"{float(size) * share:.15f} {unit}"
            other = Tried(family.spec, parts)
            then = other.best()
            if payload(then) != payload(best):
                more = None if then is None else other.good[then][0] - family.tried.good[best][0]
                wanted[f"{sensor} {key}", share > 1] = more
    said = {
        (one.figure, one.at > one.value): one.objective_change
        for one in family.said.measure_next or ()
    }
    assert said == pytest.approx(wanted)
    return len(wanted)


@pytest.fixture(scope="module")
def family(tmp_path_factory: pytest.TempPathFactory) -> Family:
    return Family(tmp_path_factory.mktemp("family"), 7)


def test_each_term_fails_and_changes_the_payload_where_it_is_said(family: Family) -> None:
    assert compare_slack(family) >= 15


def test_what_to_measure_next_is_every_figure_that_flips_the_choice(family: Family) -> None:
    assert compare_measurements(family) >= 5
