"""tau exactly at, just below and just above the sync limit: the tables decide as the recheck does.

Figures are decimal texts whose ratio is known in fractions: noises with a rational norm
(3, 4, 12 -> 13), no angles, so that nothing is rounded but by the product.
"""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from syncline_design.spec.load import load_text
from syncline_design.verdict.optimize import OptimizeSettings, optimize
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: At the limit
requirements: [{{id: S, kind: sync, limit: {limit}}}]
catalogs: [own.yaml]
stages:
  - name: boat
    platform: {{v_max: {speed} m/s, omega_max: 0 deg/s, distance: 1 m, baseline: 1 m}}
    position: {{candidates: [{candidates}]}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 1 deg, primitives: [], cost: 0 EUR}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 90000 m, sigma_bearing: 1 deg, primitives: [],
               cost: 0 EUR}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
timestamping: {{candidates: [bench]}}
"""
OWN = """\
sensors:
  tie: {{modality: position, sigma_position: [{axes}], primitives: [], cost: 10 EUR}}
  safe: {{modality: position, sigma_position: 900 m, primitives: [], cost: 90 EUR}}
timestamping:
  bench:
    {{primitives: [arrival], timeline: host, cost: 0 EUR,
      error: {{distribution: constant, value: {tau} s}}}}
"""
TRIPLES = ((3, 4, 12, 13), (1, 2, 2, 3), (2, 3, 6, 7), (4, 4, 7, 9), (6, 6, 7, 11), (2, 10, 11, 15))


def decimal_text(value: Fraction) -> str:
    """A fraction with a finite decimal expansion, in full."""
    digits = 0
    while (value * 10**digits).denominator != 1:
        digits += 1
        assert digits < 60
    whole = str(int(value * 10**digits)).rjust(digits + 1, "0")
    return f"{whole[: len(whole) - digits]}.{whole[len(whole) - digits :]}0"


def tie_case(rng: random.Random) -> tuple[dict[str, str], Fraction]:
    """Texts of a spec whose own ratio is exactly the limit, and the tau that does it [s]."""
    *axes, norm = rng.choice(TRIPLES)
    scale = Fraction(rng.randint(1, 999), 10 ** rng.randint(2, 5))
    speed = Fraction(2 ** rng.randint(0, 5) * 5 ** rng.randint(0, 3), 10 ** rng.randint(0, 3))
    limit = Fraction(rng.randint(1, 999), 10 ** rng.randint(1, 3))
    texts = {
        "axes": ", ".join(f"{decimal_text(a * scale)} m" for a in axes),
        "speed": decimal_text(speed),
        "limit": decimal_text(limit),
    }
    return texts, limit * norm * scale / speed


def loaded(folder: Path, texts: dict[str, str], tau: Fraction, candidates: str) -> Any:
    (folder / "own.yaml").write_text(OWN.format(axes=texts["axes"], tau=decimal_text(tau)))
    text = SPEC.format(speed=texts["speed"], limit=texts["limit"], candidates=candidates)
    return load_text(text, folder / "spec.yaml")


@pytest.mark.parametrize("seed", range(30))
def test_strictly_below_the_limit_or_not_at_all(seed: int, tmp_path: Path) -> None:
    """The cheap sensor is taken exactly when its ratio, rounded once, is below the limit."""
    texts, tau = tie_case(random.Random(seed))
    limit = Fraction(texts["limit"])
    for below in (0, 1, 2, 3, 100):
        share = 1 - Fraction(below, 10**16)
        kept = float(limit * share) < float(limit)
        spec = loaded(tmp_path, texts, tau * share, "tie, safe")
        verdict = check_loaded(spec, CheckSettings(monte_carlo=False)).to_json()
        assert verdict["verdict"] == "meets"
        sensor = verdict["design"]["stages"][0]["roles"]["position"]["sensor"]
        assert (sensor == "tie") is kept
        pinned = check_loaded(
            loaded(tmp_path, texts, tau * share, "tie"), CheckSettings(monte_carlo=False)
        ).to_json()
        assert (pinned["verdict"] == "meets") is kept


@pytest.mark.parametrize("seed", range(8))
def test_optimize_and_check_agree_at_the_limit(seed: int, tmp_path: Path) -> None:
    texts, tau = tie_case(random.Random(100 + seed))
    spec = loaded(tmp_path, texts, tau, "tie, safe")
    found = optimize(spec, OptimizeSettings(pareto=True)).result
    verdict = check_loaded(spec, CheckSettings(monte_carlo=False)).to_json()
    assert found.exit_code == (0 if verdict["verdict"] == "meets" else 1)
    assert found.front is not None
    assert len(found.front) <= 1  # the sensor at the limit is on no front
