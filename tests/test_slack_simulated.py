"""The slack ledger where simulation decides: its edges, and what they cost.

A vessel that locates itself: |e| = |n + v mu|, n normal with sigma an axis, mu uniform in +-a, so
P(|e| <= L) = E[F(L^2 / sigma^2; 3, (v mu / sigma)^2)], F the non-central chi-squared distribution.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import ncx2

from syncline_design.choice.problem import sole_design
from syncline_design.choice.slack import slack_ledger
from syncline_design.model.timing import Uniform
from syncline_design.spec.load import load_text
from syncline_design.verdict import acceptance
from syncline_design.verdict.optimize import Optimization, OptimizeSettings, optimize

LIMIT, SHARE = 0.5, 0.9
SIGMA, LATE, SPEED = 0.1, 0.1, 2.0
SPEC = f"""\
syncline: 1
name: drifter
catalogs: [alone.yaml]
requirements:
  - {{id: ACC, kind: accuracy, limit: 100 m}}
  - {{id: SYNC, kind: sync, limit: 1.0e6}}
  - {{id: MC, kind: monte_carlo, quantile: {SHARE}, limit: {LIMIT} m}}
monte_carlo: {{samples: 10000}}
stages:
  - name: boat
    platform: {{v_max: {SPEED} m/s, omega_max: 10 deg/s, distance: 1 m, baseline: 0 m}}
    position: {{candidates: [cheap, dear], lever_arm: [0 m, 0 m, 0 m]}}
timestamping: {{candidates: [serial]}}
"""
CATALOG = f"""\
sensors:
  cheap: {{modality: position, type: lbl, sigma_position: {SIGMA} m, primitives: [], cost: 10 EUR}}
  dear: {{modality: position, type: lbl, sigma_position: 1 cm, primitives: [], cost: 90 EUR}}
timestamping:
  serial:
    primitives: [arrival]
    timeline: utc
    cost: 1 EUR
    error: {{distribution: uniform, low: -{LATE} s, high: {LATE} s}}
"""


def within(sigma: float, late: float, speed: float) -> float:
    """P(|e| <= LIMIT) by Gauss-Legendre quadrature over mu."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    shift = (speed * late * nodes / sigma) ** 2
    return float(0.5 * weights @ ncx2.cdf((LIMIT / sigma) ** 2, 3, np.maximum(shift, 1e-12)))


def edge(of: Callable[[float], float], now: float) -> float:
    """Where the share that keeps the limit falls to what is asked."""
    assert of(now) > SHARE
    return float(brentq(lambda value: of(value) - SHARE, now, 20.0 * now))


EDGES = {
    "position sensor error": np.sqrt(3.0) * edge(lambda s: within(s, LATE, SPEED), SIGMA),
    "position timestamp error": edge(lambda a: within(SIGMA, a, SPEED), LATE),
    "speed v_max": edge(lambda v: within(SIGMA, LATE, v), SPEED),
}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Optimization, list[tuple[bool, int]]]:
    """The ledger, and of each decision whether it was of the spec itself and its largest look."""
    folder: Path = tmp_path_factory.mktemp("ledger")
    (folder / "alone.yaml").write_text(CATALOG)
    loaded = load_text(SPEC, folder / "spec.yaml")
    looks: list[tuple[bool, int]] = []
    plain = acceptance.decide

    def counted(system, settings, quantile, limit_m, cap):  # type: ignore[no-untyped-def]
        boat, mu = system.stages[0], system.stages[0].position.timing.distribution
        own = boat.position.sigma[0] in (SIGMA, 0.01) and boat.platform.v_max_mps == SPEED
        own &= mu == Uniform(-LATE, LATE) and limit_m == LIMIT
        decision = plain(system, settings, quantile, limit_m, cap)
        looks.append((own, decision.samples))
        return decision

    patch = pytest.MonkeyPatch()
    patch.setattr(acceptance, "decide", counted)
    try:
        return optimize(loaded, OptimizeSettings()).result, looks
    finally:
        patch.undo()


@pytest.mark.parametrize("term", EDGES)
def test_edges_are_where_the_quantile_reaches_its_limit(
    found: tuple[Optimization, list[tuple[bool, int]]], term: str
) -> None:
    """To the 1 % that simulation tells values apart, and half of one for its own error."""
    (row,) = [one for one in found[0].slack or () if one.term == term]
    assert row.limited_by == "monte_carlo"
    assert row.fails_at == pytest.approx(EDGES[term], rel=0.015)
    # then the dear sensor is the choice: where the cheap one fails
    assert row.payload_changes_at == pytest.approx(EDGES[term], rel=0.015)


def test_what_ifs_are_left_open_after_as_many_samples_as_stated(
    found: tuple[Optimization, list[tuple[bool, int]]],
) -> None:
    what_ifs = [samples for own, samples in found[1] if not own]
    assert len(what_ifs) > 20
    assert max(what_ifs) <= acceptance.WHAT_IF_CAP


def test_what_breaks_is_named_by_its_kind(tmp_path: Path) -> None:
    """A limit of the vertical: straight up, true stamps, 1.96 sigma reaches it."""
    (tmp_path / "alone.yaml").write_text(CATALOG.replace(f"{LATE} s", "0 s"))
    own = f"kind: tvu, limit: {LIMIT} m"
    text = SPEC.replace(f"kind: monte_carlo, quantile: {SHARE}, limit: {LIMIT} m", own)
    case = load_text(text.replace("[cheap, dear]", "[cheap]"), tmp_path / "spec.yaml")
    build = acceptance.Simulations().problem_of
    problem = build(case)
    sole = sole_design(problem)
    assert sole is not None
    rows = slack_ledger(case, *sole, build)
    (row,) = [one for one in rows if one.term == "position sensor error"]
    assert row.limited_by == "tvu"
    assert row.fails_at == pytest.approx(np.sqrt(3.0) * LIMIT / 1.959964, rel=0.015)
