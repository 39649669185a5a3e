"""Choice under figures of the error against plain enumeration by closed forms.

Random problems (`tests/figure_problems.py`): isotropic sensors on a level vehicle with all but true
stamps, whose figures are known by hand, so that judging every design costs next to nothing.  With
s_p, s_T, s_r, s_u the deviations per axis, d the range and e the elevation of the look, the error's
covariance has the variances
  along the sight  s_p^2 + s_r^2
  across it, up    s_p^2 + (s_T^2 + s_u^2) d^2
  across it, level s_p^2 + (s_T^2 + s_u^2 cos^2 e) d^2
and a figure is the largest over e.  The certified worst case is the formula of docs/simulation.md.
Problems with a design within `CLOSE` of the limit are left out and counted: a search for the worst
situation and its lattice may be off by as much.

    python benchmarks/figure_choice.py [COUNT OF EACH KIND] [SEED] [KIND ...]
"""

from __future__ import annotations

import itertools
import math
import sys
import tempfile
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from figure_problems import DEGREE, drawn, rmse_3d_m, written
from syncline_design.choice.decide import choose
from syncline_design.spec.load import load_text
from syncline_design.verdict.acceptance import Simulations
from test_figure_choice import cost_of

CLOSE = 5e-3
Raw = dict[str, Any]
Names = tuple[str, str, str]


@lru_cache(maxsize=4096)
def plane_quantile(ratio: float) -> float:
    """q95 of sqrt(x^2 + ratio y^2), x, y standard normal."""

    def inside(r: float) -> float:
        def ring(x: float) -> float:
            left = math.sqrt(max(r * r - x * x, 0.0) / ratio)
            return math.exp(-0.5 * x * x) * math.erf(left / math.sqrt(2.0))

        return math.sqrt(2.0 / math.pi) * float(quad(ring, 0.0, r, limit=200)[0])

    return float(brentq(lambda r: inside(r) - 0.95, 1.5, 3.0))


@lru_cache(maxsize=4096)
def space_quantile(ratio: float) -> float:
    """q95 of sqrt(ratio x^2 + y^2 + z^2)."""

    def inside(r: float) -> float:
        def disc(x: float) -> float:
            left = max(r * r - ratio * x * x, 0.0)
            return math.exp(-0.5 * x * x) * float(chi2.cdf(left, 2))

        return math.sqrt(2.0 / math.pi) * float(quad(disc, 0.0, min(r / math.sqrt(ratio), 9.0))[0])

    return float(brentq(lambda r: inside(r) - 0.95, 1.9, 3.0 * max(1.0, math.sqrt(ratio))))


def variances(raw: Raw, names: Names, elevation: float) -> tuple[float, float, float]:
    """Along the sight, across it upwards, across it level [m2]."""
    position, attitude, ranging = (raw["sensors"][name] for name in names)
    turn = (attitude["sigma"] * DEGREE * raw["d"]) ** 2
    sight = (ranging["bearing"] * DEGREE * raw["d"]) ** 2
    own = position["sigma"] ** 2
    level = own + turn + sight * math.cos(elevation) ** 2
    return own + ranging["sigma"] ** 2, own + turn + sight, level


def vertical(raw: Raw, names: Names) -> float:
    """Level looks, or straight down."""
    along, up, _ = variances(raw, names, 0.0)
    return 1.959963984540054 * math.sqrt(max(along, up))


def horizontal(raw: Raw, names: Names) -> float:
    """The largest over elevations, on a grid that is finer than what is left out as close."""
    best = 0.0
    for elevation in np.linspace(0.0, 0.5 * math.pi, 19):
        along, up, level = variances(raw, names, float(elevation))
        radial = along * math.cos(elevation) ** 2 + up * math.sin(elevation) ** 2
        large, small = max(radial, level), min(radial, level)
        best = max(best, plane_quantile(max(round(small / large, 3), 1e-3)) * math.sqrt(large))
    return best


def space(raw: Raw, names: Names) -> float:
    """Level looks: there the covariance is largest in every direction."""
    along, up, _ = variances(raw, names, 0.0)
    return space_quantile(float(f"{along / up:.3g}")) * math.sqrt(up)


def worst(raw: Raw, names: Names, taus: tuple[float, float, float]) -> float:
    """The certificate with sensors at 3 sigma, level, no arms, uniform stamps of +-tau."""
    position, attitude, ranging = (raw["sensors"][name] for name in names)
    d, v, w = raw["d"], raw["v"], raw["w"] * DEGREE
    turn, own = w * (taus[1] + taus[2]), 3.0 * math.sqrt(3.0) * attitude["sigma"] * DEGREE
    off = turn + own * math.sqrt(1.0 + math.sin(min(turn + own, 0.5 * math.pi)))
    angle = off + 3.0 * math.sqrt(2.0) * ranging["bearing"] * DEGREE
    longer, swing = 3.0 * ranging["sigma"], 2.0 * math.sin(0.5 * min(angle, math.pi))
    moved = v * (taus[0] + taus[2]) + 3.0 * math.sqrt(3.0) * position["sigma"]
    return moved + math.sqrt(longer**2 + d * (d + longer) * swing**2)


FIGURES: dict[str, Callable[[Raw, Names], float]] = {
    "rmse": rmse_3d_m, "thu": horizontal, "tvu": vertical, "quantile": space,
}  # fmt: skip


def by_hand(raw: Raw, kind: str) -> tuple[float | None, bool]:
    """(cost of the cheapest design, whether a design is close to the limit)."""
    by_role: dict[str, list[str]] = {"position": [], "attitude": [], "ranging": []}
    for name, one in raw["sensors"].items():
        by_role[one["role"]].append(name)
    (_, limit), best, close = raw["requirements"][0], None, False
    cheapest = min(raw["methods"].values(), key=lambda method: method[1])
    ways = itertools.product(raw["methods"].values(), repeat=3)
    stamps = list(ways) if kind == "worst_case" else [(cheapest,) * 3]
    for names in itertools.product(*by_role.values()):
        sensors = sum(raw["sensors"][name]["cost"] for name in names)
        for used in stamps:
            if kind == "worst_case":
                value = worst(raw, names, (used[0][0], used[1][0], used[2][0]))
            else:
                value = FIGURES[kind](raw, names)
            margin = 1e-6 if kind == "worst_case" else CLOSE
            close = close or abs(value - limit) <= margin * limit
            cost = float(sensors + sum(price for _, price in used))
            if value <= limit and (best is None or cost < best):
                best = cost
    return best, close


def problem_drawn(number: int, kind: str) -> Raw:
    """Limits where some designs keep them and some do not."""
    raw = drawn(number, (kind,))
    factor = {"rmse": 1.0, "thu": 2.0, "tvu": 1.5, "quantile": 2.0, "worst_case": 6.0}[kind]
    raw["requirements"] = [(kind, round(factor * raw["requirements"][0][1], 4))]
    if kind == "worst_case":  # stamps that matter
        raw["methods"] = {"good": (1e-4, 300), "fair": (2e-2, 10)}
    return raw


def study(kind: str, count: int, seed: int) -> None:
    """One line about one kind of requirement."""
    wrong = none = close = 0
    spent = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(seed, seed + count):
            raw = problem_drawn(number, kind)
            wanted, near = by_hand(raw, kind)
            close += near
            if near:
                continue
            problem = Simulations().problem_of(load_text(written(raw, folder), folder / "s.yaml"))
            start = time.process_time()
            found = cost_of(problem, choose(problem))
            spent += time.process_time() - start
            none += wanted is None
            if found != wanted:
                wrong += 1
                print(f"{kind}, seed {number}: {found} instead of {wanted}", flush=True)
    judged = count - close
    print(f"{kind}: {judged} problems from seed {seed} ({close} more are close calls): {wrong} "
          f"differ, {none} without a design, {1e3 * spent / max(judged, 1):.1f} ms of processor "
          "time each", flush=True)  # fmt: skip


if __name__ == "__main__":
    numbers = [int(one) for one in sys.argv[1:3]]
    each, first = (*numbers, *(250, 0)[len(numbers) :])
    for asked in sys.argv[3:] or ("rmse", "thu", "tvu", "quantile", "worst_case"):
        study(asked, each, first)
