"""How far each term of the Syncline may grow before the verdict, or the payload, changes.

For sensor errors and timestamp bounds the verdict's threshold has a closed form: the total grows
by the error itself, or by rate * tau once a pair is the largest; platform figures are bisected.
The payload changes when the choice, made anew, names another sensor or method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from syncline_design.choose.decide import choose
from syncline_design.choose.evaluate import broken, chosen_options, evaluate, pair_bound
from syncline_design.choose.outcome import Choice, NoVerdict, OutOfTime
from syncline_design.choose.variations import (
    PLATFORM_FIGURES,
    Build,
    PlatformFigure,
    platform_figure,
    quantity,
    with_platform_figure,
)
from syncline_design.design_space import Design, Option, Problem, RoleTable
from syncline_design.loading import LoadedSpec
from syncline_design.problem import build_problem

GROWTHS = (1.02, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)
BISECTIONS = 30
CLOSE = 1e-4


@dataclass(frozen=True, slots=True)
class Slack:
    """One term: its value, and the values at which verdict and payload change.

    None: not up to a hundred times the value, or (payload only) not proven.

    limited_by: kind of the requirement that then breaks.  unit: of all three figures.
    """

    term: str
    stage: str
    value: float
    unit: str
    fails_at: float | None
    limited_by: str | None
    payload_changes_at: float | None

    def to_json(self) -> dict[str, Any]:
        """The entry under `slack`."""
        return {
            "term": self.term,
            "stage": self.stage,
            "value": self.value,
            "unit": self.unit,
            "fails_at": self.fails_at,
            "limited_by": self.limited_by,
            "payload_changes_at": self.payload_changes_at,
        }


def slack_ledger(
    loaded: LoadedSpec, problem: Problem, design: Design, build: Build = build_problem
) -> tuple[Slack, ...]:
    """Slack of every sensor error, timestamp bound and platform figure of a chosen design."""
    rows: list[Slack] = []
    for index, stage in enumerate(loaded.spec.stages):
        for r, table in enumerate(problem.roles):
            if table.stage == index:
                rows += [_error_slack(problem, design, r), _tau_slack(problem, design, r)]
        for figure in PLATFORM_FIGURES:
            row = _platform_slack(loaded, problem, design, build, index, figure)
            rows += [replace(row, stage=stage.name)] if row else []
    return tuple(rows)


Limit = tuple[Fraction, str]  # value at which a requirement of a kind breaks


def _error_slack(problem: Problem, design: Design, r: int) -> Slack:
    """A sensor error may grow by what is left of the accuracy limit; sync only gains from it."""
    table, own = problem.roles[r], chosen_options(problem, design)[r]
    limit, fails = problem.limits.accuracy_m, None
    if limit is not None:
        total = evaluate(problem, design).total_m
        fails = float(own.error() + Fraction(limit) - total)

    def changed(factor: float) -> Problem:
        return _with_sensor(problem, r, own.sensor, factor)

    until = fails / float(own.error()) if fails and own.error() else None
    factor = _payload_factor(problem, design, changed, until)
    value = own.sensor_error_m
    at = None if factor is None else value * factor
    kind = "accuracy" if fails is not None else None
    return Slack(f"{table.role} sensor error", table.stage_name, value, "m", fails, kind, at)


def _with_sensor(problem: Problem, r: int, sensor: str, factor: float) -> Problem:
    """The problem with one sensor's error in one role grown; its exclusions are judged anew."""

    def grown(option: Option) -> Option:
        if option.sensor != sensor:
            return option
        exact = option.error() * Fraction(factor)
        crit = option.tau_crit_s * factor
        return replace(option, sensor_error_m=float(exact), exact_error_m=exact, tau_crit_s=crit)

    return _with_options(problem, grown, {r})


def _with_options(problem: Problem, change: Callable[[Option], Option], rows: set[int]) -> Problem:
    """The problem with options changed; those that now keep or break their tau_crit move over."""
    from syncline_design.design_space import with_limits

    def pooled(table: RoleTable) -> RoleTable:
        back = tuple(one.option for one in table.excluded if one.option is not None)
        options = tuple(change(option) for option in (*table.options, *back))
        rest = tuple(one for one in table.excluded if one.option is None)
        return replace(table, options=options, excluded=rest)

    roles = tuple(pooled(t) if r in rows else t for r, t in enumerate(problem.roles))
    open_limits = replace(problem.limits, sync=math.inf)
    return with_limits(replace(problem, roles=roles, limits=open_limits), problem.limits)


def _tau_slack(problem: Problem, design: Design, r: int) -> Slack:
    """A timestamp bound may grow until its own tau_crit, the system's, or the accuracy is met."""
    table, own = problem.roles[r], chosen_options(problem, design)[r]
    limits = list(_tau_limits(problem, design, r))
    value = own.tau_s
    name = f"{table.role} timestamp error"
    if not limits:
        return Slack(name, table.stage_name, value, "s", None, None, None)
    fails, kind = min(limits)
    # A larger tau makes nothing else feasible or cheaper: the payload changes when this one fails.
    at = float(fails)
    if problem.objective == "error":
        factor = None
        if own.tau() > 0:
            factor = _payload_factor(
                problem, design, lambda f: _with_method(problem, r, own, f), at / value
            )
        at = at if factor is None else value * factor
    return Slack(name, table.stage_name, value, "s", float(fails), kind, at)


def _with_method(problem: Problem, r: int, own: Option, factor: float) -> Problem:
    """The problem with the tau of one method in one role grown."""

    def grown(option: Option) -> Option:
        if (option.method, option.primitive) != (own.method, own.primitive):
            return option
        exact = option.tau() * Fraction(factor)
        return replace(option, tau_s=float(exact), exact_tau_s=exact)

    return _with_options(problem, grown, {r})


def _tau_limits(problem: Problem, design: Design, r: int) -> Iterator[Limit]:
    """Values of one tau at which a requirement breaks."""
    options, found = chosen_options(problem, design), evaluate(problem, design)
    own, limits = options[r], problem.limits
    if math.isfinite(own.tau_crit_s) and math.isfinite(limits.sync):
        yield Fraction(own.tau_crit_s) * Fraction(limits.sync), "sync"
    rate = problem.sync_rate()
    others = {
        pair: pair_bound(problem, design, options, pair) - own.tau()
        for pair in problem.pairs
        if r in (pair.role, pair.reference)
    }
    if not others or rate == 0:
        return
    if math.isfinite(limits.sync):
        allowed = Fraction(limits.sync) * found.sensor_error_m / rate
        yield min(allowed - other for other in others.values()), "sync"
    if limits.accuracy_m is None:
        return
    left = Fraction(limits.accuracy_m) - found.total_m
    if problem.sync_model == "per_sensor":
        moving = sum((pair.rate() for pair in others), Fraction(0))
        if moving > 0:
            yield own.tau() + left / moving, "accuracy"
        return
    allowed = found.tau_sys_s + left / rate
    yield min(allowed - other for other in others.values()), "accuracy"


def _platform_slack(
    loaded: LoadedSpec,
    problem: Problem,
    design: Design,
    build: Build,
    stage: int,
    figure: PlatformFigure,
) -> Slack | None:
    """Growth of a platform figure: the same design evaluated, and the choice made, anew.

    A faster vehicle makes no other design feasible, so that a payload chosen by cost, mass or
    power changes when it fails; a larger distance also raises a tau_crit.
    """
    words, dimension = PLATFORM_FIGURES[figure]
    value = float(platform_figure(loaded, stage, figure))
    if value <= 0.0:
        return None

    def changed(factor: float) -> Problem:
        grown = quantity(value * factor, dimension)
        return build(with_platform_figure(loaded, stage, figure, grown))

    def kinds_broken(factor: float) -> tuple[str, ...]:
        other = changed(factor)
        same = same_design(problem, design, other)
        return ("sync",) if same is None else broken(other, evaluate(other, same))

    fails = _first(lambda factor: not kinds_broken(factor), None)
    factor = fails
    if problem.objective == "error" or figure == "distance":
        factor = _payload_factor(problem, design, changed, fails)
    unit = {"v_max": "m/s", "distance": "m", "omega_max": "rad/s"}[figure]
    return Slack(
        words,
        "",
        value,
        unit,
        None if fails is None else value * fails,
        None if fails is None else next(iter(kinds_broken(fails)), None),
        None if factor is None else value * factor,
    )


def same_design(problem: Problem, design: Design, other: Problem) -> Design | None:
    """The design of the same names in another problem; None where an option is gone."""
    places = []
    for table, option in zip(other.roles, chosen_options(problem, design), strict=True):
        names = [one.names for one in table.options]
        if option.names not in names:
            return None
        places.append(names.index(option.names))
    return Design(tuple(places), design.clocks)


def payload(problem: Problem, design: Design) -> tuple[tuple[str, str], ...]:
    """What a payload is told by: sensor and timestamping method of every role."""
    return tuple((option.sensor, option.method) for option in chosen_options(problem, design))


def _payload_factor(
    problem: Problem, design: Design, changed: Callable[[float], Problem], until: float | None
) -> float | None:
    """Least growth, up to a factor, at which the choice names another payload."""
    now = payload(problem, design)

    def same(factor: float) -> bool:
        other = changed(factor)
        found = choose(other, "front")
        return isinstance(found, Choice) and payload(other, found.design) == now

    try:
        return _first(same, until)
    except OutOfTime:
        raise
    except NoVerdict:  # what cannot be proven is not claimed
        return None


def _first(holds: Callable[[float], bool], until: float | None) -> float | None:
    """Least factor above 1 at which something no longer holds, to 1e-4; None: not up to 100."""
    last = 1.0
    for factor in (*(g for g in GROWTHS if until is None or g < until), until):
        if factor is None or factor <= last:
            continue
        if not holds(factor * (1.0 + CLOSE) if factor == until else factor):
            return _edge(holds, last, factor)
        last = factor
    return None


def _edge(holds: Callable[[float], bool], works: float, fails: float) -> float:
    for _ in range(BISECTIONS):
        if fails - works <= CLOSE * works:
            break
        middle = 0.5 * (works + fails)
        works, fails = (middle, fails) if holds(middle) else (works, middle)
    return fails
