"""The statistical budget: quantiles and root mean squares at the worst situation.

For a situation g (`situations`) and timestamp errors m the error is taken to first order in the
sensor noise z only, e = mu(g, m) + J(g, m) z; m runs over its distribution, and the largest figure
over all g counts (JCGM 100:2008 with exact shifts).  Units SI; errors north, east, down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation.approximation import Asked, three_moments
from syncline_design.simulation.ascent import Ascent, FreeVector, Index
from syncline_design.simulation.lattice import MANY_POINTS, POINTS, sphere_lattice
from syncline_design.simulation.propagation import Law, propagation
from syncline_design.simulation.settings import demand_simulable
from syncline_design.simulation.situations import Moments, Situations

Axis = Literal["horizontal", "vertical", "3d"]
AXES: dict[Axis, slice] = {
    "horizontal": slice(0, 2),
    "vertical": slice(2, 3),
    "3d": slice(0, 3),
}
_QUICK_NODES = 1021
_SEARCH_NODES, _CANDIDATES = 31, 3  # where shifts are long
CLOSE, CLOSE_LONG = 1e-2, 5e-2  # what one search may miss, with long shifts
_MORE_SEARCHES = 6  # where a figure is that close to its limit
_POOL, _STARTS, _STARTS_EXACT, _ITERATIONS = 512, 6, 2, 60
_ROUGH, _SETTLED = 1e-4, 1e-6  # gain of an iteration below which ascents end: all, the best


@dataclass(frozen=True, slots=True)
class Wanted:
    """A figure of |P e|: its p-quantile, or its root mean square where p is None.

    rule: (a [m], b) of a limit sqrt(a^2 + (b d)^2) in the last stage's distance d; the figure is
    then looked for where it is the largest share of that limit, not where it is largest.
    """

    axis: Axis
    p: float | None = None
    rule: tuple[float, float] | None = None

    def weight(self, situations: Situations, point: Array) -> Array | float:
        """Limit at the far end of the last stage's distances over that at each point's (n,)."""
        stage = situations.system.stages[-1]
        if self.rule is None or stage.platform.nearest_m is None:
            return 1.0
        a, b = self.rule
        found: Array = math.hypot(a, b * stage.platform.distance_m) / np.hypot(
            a, b * situations.last_ranges_m(point)
        )
        return found

    def weight_slopes(self, situations: Situations, point: Array) -> tuple[Array, Array]:
        """`weight` (n,) and its slopes (p, n)."""
        weight, slopes = self.weight(situations, point), np.zeros(point.shape)
        if self.rule is not None and not isinstance(weight, float):
            a, b = self.rule
            far, by_point = situations.last_ranges_m(point), situations.last_range_slopes_m()
            slopes = by_point[:, None] * (-weight * b * b * far / (a * a + b * b * far * far))
        return np.broadcast_to(weight, point.shape[1:]), slopes


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest value [m] of a figure, and the situation in which it stands (p,).

    blocks: what the situation chooses; weighted_m: the value times `Wanted.weight`, what is largest
    there; distance_m: of the last stage's object there.
    """

    wanted: Wanted
    value_m: float
    point: Array
    weighted_m: float
    distance_m: float
    blocks: tuple[FreeVector, ...] = ()


def statistical_figures(
    system: System, wanted: Sequence[Wanted], one_mission: bool = False, *, seed: int
) -> tuple[Worst, ...]:
    """Each wanted figure at its own worst situation.

    one_mission: what is constant in a mission is held at its worst value instead of drawn.
    """
    demand_simulable(system)
    situations = Situations(system, one_mission)
    found = _worst_points(situations, wanted, seed)
    promising = _promising(situations, wanted, found)
    nodes = situations.nodes(POINTS if situations.linear else MANY_POINTS)
    seen: dict[tuple[int, int], Worst] = {}  # by figure and point; a point serves several figures
    for at in sorted({at for kept in promising for at in kept}):
        in_force().check()
        moments = situations.moments(found[:, at : at + 1], nodes)
        for k, one in enumerate(wanted):
            if at in promising[k]:
                seen[k, at] = _evaluated(situations, one, found[:, at], moments)
    return tuple(
        max((seen[k, at] for at in kept), key=lambda worst: worst.weighted_m)
        for k, kept in enumerate(promising)
    )


def _promising(
    situations: Situations, wanted: Sequence[Wanted], found: Array
) -> tuple[list[int], ...]:
    """For each figure its own point and the best of the others', so that none contradicts another.

    What is largest in space is at least as large as what is largest horizontally.
    """
    mean, covariance = propagation(situations).of(found)
    out = []
    for k, one in enumerate(wanted):
        order = np.argsort(-approximate(mean, covariance, one) * one.weight(situations, found))
        out.append(list(dict.fromkeys([k, *order.tolist()]))[:_CANDIDATES])
    return tuple(out)


def figure(system: System, wanted: Wanted, limit_m: float, seed: int) -> Worst:
    """A figure to be held against a limit [m]; near it, the largest of several searches."""
    found = statistical_figures(system, (wanted,), seed=seed)[0]
    near = CLOSE if Situations(system).linear else CLOSE_LONG
    if abs(found.weighted_m - limit_m) <= near * limit_m:
        for more in range(1, _MORE_SEARCHES + 1):
            again = statistical_figures(system, (wanted,), seed=seed + more)[0]
            found = max(found, again, key=lambda worst: worst.weighted_m)
    return found


def surely_exceeds(system: System, wanted: Wanted, limit_m: float, seed: int) -> bool:
    """Whether some situation at random already exceeds a limit: a quick no, never a yes."""
    situations = Situations(system)
    pool = situations.starting_points(seed, _POOL)
    weight = wanted.weight(situations, pool)
    best = int(np.argmax(approximate(*propagation(situations).of(pool), wanted) * weight))
    nodes, point = situations.nodes(_QUICK_NODES), pool[:, best : best + 1]
    moments = situations.moments(point, nodes)
    least = float(limit_m * (1.0 + CLOSE) / np.max(wanted.weight(situations, point)))
    if wanted.p is None:
        return exact(moments, wanted, situations.dimensions) > least
    return rays(moments, wanted, situations.dimensions).within(least) < wanted.p


def exceeds_at(system: System, wanted: Wanted, limit_m: float, worst: Worst) -> bool:
    """Whether a figure exceeds a limit where that of another system was worst; False where the
    situation is none of this system's."""
    situations = Situations(system)
    if situations.blocks != worst.blocks:
        return False
    nodes = situations.nodes(POINTS if situations.linear else MANY_POINTS)
    moments = situations.moments(worst.point[:, None], nodes)
    return _evaluated(situations, wanted, worst.point, moments).weighted_m > limit_m


def worst_point(system: System, wanted: Wanted, seed: int) -> Array:
    """A situation (p,) in which a figure is about as large as anywhere."""
    return _worst_points(Situations(system), (wanted,), seed)[:, 0]


def _worst_points(situations: Situations, wanted: Sequence[Wanted], seed: int) -> Array:
    """For each figure the point that the best ascent of its approximation ends in, (p, figures).

    First by propagation; where shifts are long or effects act, the best of these go on with the
    shifts as they are.
    """
    count, law = len(wanted), propagation(situations)
    pool = situations.starting_points(seed, _POOL)
    mean, covariance = law.of(pool)
    ranked = [
        np.argsort(-approximate(mean, covariance, one) * one.weight(situations, pool))[:_STARTS]
        for one in wanted
    ]
    point, of = pool[:, np.concatenate(ranked)], np.repeat(np.arange(count), _STARTS)
    value = _ascent(law, wanted).ascend(point, of, np.full(count, np.inf), _ROUGH, _ITERATIONS)
    kept = 1
    if not situations.linear:
        kept = _STARTS_EXACT
        law = Law(situations, "averaged", situations.nodes(_SEARCH_NODES))
    best = np.argsort(-value.reshape(count, _STARTS), axis=1)[:, :kept]
    point = point[:, (best + _STARTS * np.arange(count)[:, None]).ravel()]
    of = np.repeat(np.arange(count), kept)
    value = _ascent(law, wanted).ascend(
        point, of, np.full(count, np.inf), _SETTLED if situations.linear else _ROUGH, _ITERATIONS
    )
    return point[:, value.reshape(count, kept).argmax(axis=1) + kept * np.arange(count)]


def _ascent(law: Law, wanted: Sequence[Wanted]) -> Ascent:
    situations, all_asked = law.situations, asked_of(wanted)
    ruled = [k for k, one in enumerate(wanted) if one.rule is not None]

    def asked(of: Index) -> Asked:
        return Asked(all_asked.axes[of], all_asked.normal[of])

    def objective(point: Array, of: Index) -> Array:
        value = three_moments(*law.of(point), asked(of)).figures()
        for k in ruled:
            mine = of == k
            value[mine] *= wanted[k].weight(situations, point[:, mine])
        return value

    def slopes(point: Array, of: Index) -> Array:
        at = law.sloped(point)
        moments = three_moments(at.mean, at.covariance, asked(of))
        found = at.slopes(*moments.slopes())
        for k in ruled:
            mine = np.flatnonzero(of == k)
            weight, bent = wanted[k].weight_slopes(situations, point[:, mine])
            found[:, mine] = found[:, mine] * weight + bent * moments.figures()[mine]
        return found

    return Ascent(situations.blocks, objective, None if situations.acting else slopes)


def _evaluated(situations: Situations, wanted: Wanted, point: Array, moments: Moments) -> Worst:
    """A figure at a point (p,) of these moments."""
    value, at = exact(moments, wanted, situations.dimensions), point[:, None]
    weighted = float(np.max(value * wanted.weight(situations, at)))
    away = float(situations.last_ranges_m(at)[0])
    return Worst(wanted, value, point, weighted, away, situations.blocks)


def approximate(mean: Array, covariance: Array, wanted: Wanted) -> Array:
    """A figure by three moments, (n,): only to find where it is largest."""
    one = asked_of((wanted,))
    asked = Asked(np.repeat(one.axes, len(mean), axis=0), np.repeat(one.normal, len(mean)))
    return three_moments(mean, covariance, asked).figures()


def asked_of(wanted: Sequence[Wanted]) -> Asked:
    """The axes and the shares of figures."""
    axes = np.zeros((len(wanted), 3))
    for row, one in zip(axes, wanted, strict=True):
        row[AXES[one.axis]] = 1.0
    normal = [math.nan if one.p is None else NormalDist().inv_cdf(one.p) for one in wanted]
    return Asked(axes, np.array(normal))


def exact(moments: Moments, wanted: Wanted, skipped: int) -> float:
    """A figure of one situation: of a mixture of M equally likely Gaussians.

    Root mean square: mean of |P mu|^2 + tr P C P'.  Quantile: with z = rho u, u a direction and
    rho of chi distribution, P(|mu + rho L u| < r) = F(rho2) - F(rho1), rho1 and rho2 >= 0 where
    the ray enters and leaves the ball; the directions go over a lattice.
    skipped: lattice dimensions that the nodes have used.
    """
    mean_square = _mean_square(moments, wanted)
    if wanted.p is None or mean_square == 0.0:
        return math.sqrt(mean_square)
    return rays(moments, wanted, skipped).quantile(wanted.p, math.sqrt(mean_square))


def _mean_square(moments: Moments, wanted: Wanted) -> float:
    axes = AXES[wanted.axis]
    slopes = moments.slopes_m[0, :, axes]
    square = np.sum(moments.mean_m[0, :, axes] ** 2, axis=1) + np.sum(slopes**2, axis=(1, 2))
    return float(np.mean(square))


def rays(moments: Moments, wanted: Wanted, skipped: int) -> Rays:
    """The errors of one situation as rays: mu + rho L u, u on a lattice, L L' = P C P'."""
    axes = AXES[wanted.axis]
    m, c = moments.mean_m[0, :, axes], moments.covariance()[0, :, axes, axes]
    size = m.shape[1]
    values, vectors = np.linalg.eigh(c)
    scale = np.sqrt(np.maximum(values, 0.0))
    ray = np.einsum("mij,mj,jm->mi", vectors, scale, sphere_lattice(skipped, size, m.shape[0]))
    least = 1e-12 * math.sqrt(_mean_square(moments, wanted))
    length = np.maximum(np.sqrt(np.sum(ray * ray, axis=1)), max(least, 1e-300))
    foot = np.einsum("mi,mi->m", ray, m) / length
    return Rays(size, foot, np.sum(m * m, axis=1) - foot * foot, length)


@dataclass(frozen=True, slots=True)
class Rays:
    """Scatter of chi distribution along rays: P(rho) per ray is `axes`-dimensional.

    foot: how far along its ray the start lies; across: its squared distance from the origin
    besides; length: of one unit of rho.
    """

    axes: int
    foot: Array
    across: Array
    length: Array

    def within(self, radius: float) -> float:
        """Share that lies within a radius."""
        room = radius * radius - self.across
        half = np.sqrt(np.maximum(room, 0.0))
        upper, lower = (half - self.foot) / self.length, (-half - self.foot) / self.length
        inside = chi_share(self.axes, upper) - chi_share(self.axes, lower)
        return float(np.mean(np.where(room > 0.0, inside, 0.0)))

    def quantile(self, p: float, about: float) -> float:
        """The radius that a share p lies within, by bisection and secants (Illinois)."""
        low, high = 0.0, about
        at_low, at_high = -p, self.within(high) - p
        while at_high < 0.0:
            low, at_low = high, at_high
            high *= 2.0
            at_high = self.within(high) - p
        kept = 0  # the side that the last radius left where it was
        for _ in range(60):
            if high - low <= 1e-8 * high:
                break
            radius = high - at_high * (high - low) / (at_high - at_low)
            value = self.within(radius) - p
            if abs(value) <= 1e-12:
                return radius
            if value < 0.0:
                low, at_low, at_high = radius, value, at_high * (0.5 if kept > 0 else 1.0)
                kept = 1
            else:
                high, at_high, at_low = radius, value, at_low * (0.5 if kept < 0 else 1.0)
                kept = -1
        return high


def chi_share(axes: int, rho: Array) -> Array:
    """P(chi <= rho) of 1, 2 or 3 degrees of freedom, 0 below 0; (n,); right to 2e-7.

    erf(rho / sqrt 2), 1 - exp(-rho^2 / 2), erf(rho / sqrt 2) - sqrt(2 / pi) rho exp(-rho^2 / 2);
    those with erf from a table, between whose points a straight line is off by at most
    h^2 / 8 max |f''|.
    """
    if axes == 2:
        found: Array = -np.expm1(-0.5 * np.maximum(rho, 0.0) ** 2)
        return found
    at, share = _chi_table(axes)
    between: Array = np.interp(rho, at, share)
    return between


@lru_cache(maxsize=2)
def _chi_table(axes: int) -> tuple[Array, Array]:
    at = np.linspace(0.0, 9.0, 9001)
    one = np.array([math.erf(x) for x in (at * math.sqrt(0.5)).tolist()])
    if axes == 3:
        one -= math.sqrt(2.0 / math.pi) * at * np.exp(-0.5 * at * at)
    return at, one
