"""How far each term of the Syncline may grow before the verdict, or the payload, changes.

For sensor errors and timestamp bounds the verdict's threshold has a closed form: the total grows
by the error itself, or by rate * tau once a pair is the largest; platform figures are bisected.
The payload changes when the choice, made anew, names another sensor or method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.core import Beside, best_from
from syncline_design.choice.decide import choose
from syncline_design.choice.edges import CLOSE, edge, first_failing, tried
from syncline_design.choice.evaluate import broken, chosen_options, evaluate, pair_bound
from syncline_design.choice.judged import judgement
from syncline_design.choice.narrowed import kept
from syncline_design.choice.option import Option
from syncline_design.choice.options import Bools, Options
from syncline_design.choice.outcome import Choice, NoVerdict, OutOfTime, Unfinished
from syncline_design.choice.parts import SIMULATED
from syncline_design.choice.problem import build_problem
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.rivals import Changed, Growing, rivals
from syncline_design.choice.table import NOTHING, Design, Problem, RoleTable
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    PLATFORM_UNITS,
    Build,
    PlatformFigure,
    platform_figure,
)
from syncline_design.choice.what_if import (
    WhatIf,
    hangs_on_motion,
    of_method,
    of_sensor,
    platform_what_if,
    same_design,
    same_places,
    with_method_tau,
    with_sensor_error,
)
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.spec.case import Case

# Values tried, over the term's own: from a nudge that only settles ties to a million times.
GROWTHS = (1.0 + 1e-9, 1.0001, 1.01, 1.05, *(1.3**k for k in range(1, 53)), 1e6)
COARSE = (1.0 + 1e-9, 1.1, 1.5, 2.0, 4.0, 10.0, 30.0, 100.0)  # where each try is a simulation
SIMULATED_CLOSE = 1e-2  # simulation tells values apart no better at a bearable number of samples


@dataclass(frozen=True, slots=True)
class Slack(Record):
    """One term: its value, and the values at which verdict and payload change.

    None: not up to searched_to (None: no value was left out).  limited_by: kind of the requirement
    that then breaks.  unit: of all four figures.  never: which of the two is proven never to come,
    `verdict` or `payload`.
    """

    term: str
    stage: str
    value: float
    unit: str
    fails_at: float | None
    limited_by: str | None
    payload_changes_at: float | None
    searched_to: float | None = None
    never: tuple[str, ...] = ()
    mission: str | None = optional()


def slack_ledger(
    case: Case, problem: Problem, design: Design, build: Build = build_problem
) -> tuple[Slack, ...]:
    """Slack of every sensor error, timestamp bound and platform figure of a chosen design.

    A sensor whose noise enters no error (the attitude of a stage without ranging) has no such row.
    """
    rows: list[Slack] = []
    kinds = {one.id: one.kind for one in case.spec.requirements}
    asked = _Asked(problem, design, Beside(problem), kinds)
    for index, stage in enumerate(case.spec.stages):
        for r, table in enumerate(problem.roles):
            if table.stage == index:
                if chosen_options(problem, design)[r].error() > 0:
                    rows.append(_error_slack(asked, r))
                rows.append(_tau_slack(asked, r))
        what_if = platform_what_if(case, problem, build, index)
        for figure in PLATFORM_FIGURES:
            value = float(platform_figure(case, index, figure))
            row = _platform_slack(asked, value, figure, what_if, _moved(case, problem, index))
            rows += [replace(row, stage=stage.name)] if row else []
    return tuple(rows)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a ledger is of; kinds: of requirements by their ids."""

    problem: Problem
    design: Design
    beside: Beside
    kinds: Mapping[str, str]

    def alone(self) -> tuple[Problem, Design]:
        """The problem with the design's options alone, whatever else there is to choose."""
        roles = tuple(
            replace(table, options=table.options.take([place]), excluded=NOTHING)
            for table, place in zip(self.problem.roles, self.design.options, strict=True)
        )
        return replace(self.problem, roles=roles), Design((0,) * len(roles), self.design.clocks)


Limit = tuple[Fraction, str]  # value at which a requirement of a kind breaks


def _error_slack(asked: _Asked, r: int) -> Slack:
    """A sensor error may grow by what is left of the accuracy limit; sync only gains from it.

    What known effects add in proportion to the noise grows with it.
    """
    problem, design = asked.problem, asked.design
    table, own = problem.roles[r], chosen_options(problem, design)[r]
    limit, fails = problem.limits.accuracy_m, error_limit(problem, design, r)

    def vary(problem: Problem, design: Design) -> Changed:
        rows = of_sensor(problem, r, design.options[r])
        return lambda value: with_sensor_error(problem, r, rows, Fraction(value))

    row = Slack(f"{table.role} sensor error", table.stage_name, own.sensor_error_m, "m", fails,
                None if fails is None else "accuracy", None)  # fmt: skip
    sure = limit is None and problem.judge is None
    worse = all(option.noise_systematic_m >= 0 for option in _alike(problem, design, r))
    return _with_payload(row, asked, Growing(vary, (r,), only_worse=worse), fails_never=sure)


def _alike(problem: Problem, design: Design, r: int) -> Iterator[Option]:
    """The options of a role that have the sensor of a design's."""
    pool = problem.roles[r].pool()
    return (
        pool[place] for place in np.flatnonzero(of_sensor(problem, r, design.options[r])).tolist()
    )


def error_limit(problem: Problem, design: Design, r: int) -> float | None:
    """Value of one sensor's error [m] at which the accuracy limit is reached; None without one."""
    own, limit = chosen_options(problem, design)[r], problem.limits.accuracy_m
    if limit is None:
        return None
    slope = 1 + own.noise_systematic_m / own.error()
    return float(own.error() + (Fraction(limit) - evaluate(problem, design).total_m) / slope)


def _tau_slack(asked: _Asked, r: int) -> Slack:
    """A timestamp bound may grow until its own tau_crit, the system's, or the accuracy is met."""
    problem, design = asked.problem, asked.design
    table, own = problem.roles[r], chosen_options(problem, design)[r]
    limits = list(tau_limits(problem, design, r))
    fails, kind = min(limits) if limits else (None, None)
    row = Slack(f"{table.role} timestamp error", table.stage_name, own.tau_s, "s",
                None if fails is None else float(fails), kind, None)  # fmt: skip

    def vary(problem: Problem, design: Design) -> Changed:
        rows = of_method(problem, r, design.options[r])
        return lambda value: with_method_tau(problem, r, rows, Fraction(value))

    sure = not limits and problem.judge is None
    return _with_payload(row, asked, Growing(vary), fails_never=sure)


def tau_limits(problem: Problem, design: Design, r: int) -> Iterator[Limit]:
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
    error, slower = found.tightest
    if math.isfinite(limits.sync) and slower > 0:
        allowed = Fraction(limits.sync) * error / slower
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


def _moved(case: Case, problem: Problem, stage: int) -> tuple[int, ...] | None:
    """The roles that a stage's platform moves; None where more hangs on how it moves."""
    if hangs_on_motion(case, problem):
        return None
    return tuple(r for r, table in enumerate(problem.roles) if table.stage == stage)


def _platform_slack(
    asked: _Asked, value: float, figure: PlatformFigure, what_if: WhatIf,
    moved: tuple[int, ...] | None,
) -> Slack | None:  # fmt: skip
    """Growth of a platform figure: the same design evaluated, and the choice made, anew.

    moved: the roles that it moves, where designs only get worse.
    """
    if value <= 0.0:
        return None
    alone, only = asked.alone()

    def kinds_broken(at: float) -> tuple[str, ...]:
        other = what_if(alone, figure, at)
        same = same_design(alone, only, other)
        if same is not None:
            return broken(other, evaluate(other, same))
        return (gone(other),)

    fails = first_failing(lambda at: not kinds_broken(at), tried(value, GROWTHS))
    unit = PLATFORM_UNITS[figure]
    kind = None if fails is None else next(iter(kinds_broken(fails)), None)
    row = Slack(PLATFORM_FIGURES[figure][0], "", value, unit, fails, kind, None)

    def vary(problem: Problem, _: Design) -> Changed:
        return lambda at: what_if(problem, figure, at)

    noisier = moved or () if figure == "distance" else ()
    growing = Growing(vary, noisier, RoleTable.anywhere, only_worse=moved is not None)
    return _with_payload(row, asked, growing, fails_never=False)


def gone(problem: Problem) -> str:
    """Why the one option of a role is no longer there: kind of what is broken."""
    for table in problem.roles:
        beyond = table.excluded.beyond
        if len(beyond):
            distance = float(table.distance_m)
            return "sample_spacing" if beyond.reach(distance, distance).all() else "feasible"
    return "sync"


def payload(problem: Problem, design: Design) -> tuple[tuple[str, str], ...]:
    """What a payload is told by: sensor and timestamping method of every role."""
    return tuple((option.sensor, option.method) for option in chosen_options(problem, design))


def _with_payload(row: Slack, asked: _Asked, growing: Growing, *, fails_never: bool) -> Slack:
    """The row with the least value at which the choice, made anew, names another payload.

    A term that grows can lose a tie of price long before a limit, and a worse sensor can make a
    cheaper design keep its sync limit: every value is solved again, among the design's rivals as
    long as it stands itself, else among all designs.
    """
    problem, design = asked.problem, asked.design
    changed = growing.vary(problem, design)
    row = _simulated(row, problem, design, changed, asked.kinds)
    never = ("verdict",) if fails_never else ()
    if fails_never and _is_sole(problem):
        return replace(row, never=(*never, "payload"))
    now = payload(problem, design)
    few = None
    if problem.judge is None:
        few = rivals(problem, design, growing, row.value, asked.beside)

    def same(at: float) -> bool:
        best = None if few is None else few.best(at)
        if best is not None:
            return payload(*best) == now
        other = changed(at)
        own = same_design(problem, design, other)
        if other.judge is not None and own is not None and not _stands(other, own):
            return False  # without simulating every other design
        found = _chosen(asked, other, own)
        return found is not None and payload(other, found) == now

    if problem.judge is None:
        return with_change(row, same, GROWTHS, never)
    return with_change(row, same, COARSE, never, SIMULATED_CLOSE)


def with_change(
    row: Slack,
    same: Callable[[float], bool],
    growths: Sequence[float],
    never: tuple[str, ...],
    close: float = CLOSE,
) -> Slack:
    """The row with the figure's value from which on another payload is chosen.

    same: whether the payload stays at a value; growths: at which multiples that is asked first;
    never: which of verdict and payload the figure is proven never to change.
    """
    values = tried(row.value, growths, row.fails_at)
    try:
        at = first_failing(same, values, row.value, close)
    except OutOfTime:
        raise
    except NoVerdict:  # what cannot be proven is not claimed
        return replace(row, searched_to=row.value, never=never)
    if at is not None and row.fails_at is not None and abs(at - row.fails_at) <= 1e-6 * at:
        at = row.fails_at
    return replace(row, payload_changes_at=at, searched_to=values[-1], never=never)


def _simulated(
    row: Slack,
    problem: Problem,
    design: Design,
    changed: Callable[[float], Problem],
    kinds: Mapping[str, str],
) -> Slack:
    """The row with the value at which the design fails what is judged design by design, where that
    comes first, and of which kind that is; kinds: of requirements by their ids."""
    if problem.judge is None or not row.value > 0.0:
        return row

    breaks = ""

    def holds(at: float) -> bool:
        nonlocal breaks
        other = changed(at)
        same = same_design(problem, design, other)
        failed = () if same is None else judgement(other, same).failed
        breaks = failed[0] if failed else breaks
        return not failed

    works, fails = row.value, row.fails_at or row.value * COARSE[-1]
    try:
        if fails <= works or holds(fails):
            return row
        at = edge(holds, works, fails, SIMULATED_CLOSE)
    except Unfinished:
        return row
    return replace(row, fails_at=at, limited_by=kinds.get(breaks, SIMULATED))


def _chosen(asked: _Asked, other: Problem, at_hand: Design | None) -> Design | None:
    """The choice of a changed problem; None where nothing meets it."""
    if other.judge is None:
        near = (tuple(same_places(asked.problem, asked.design, other)), asked.design)
        return best_from(other, at_hand, asked.beside, near)
    found = choose(other, "front")
    return found.design if isinstance(found, Choice) else None


def _stands(problem: Problem, design: Design) -> bool:
    """Whether a design, or one of its payload, meets every requirement, simulated ones included."""

    def its_own(r: int, options: Options) -> Bools:
        place = design.options[r]
        same = options.sensor == options.sensor[place]
        return np.asarray(same & (options.method == options.method[place]))

    alone = kept(problem, its_own, lambda _, clock: True).problem
    try:
        return any(not judgement(alone, one).failed for one in iter_best(alone, in_force()))
    except Unfinished:  # the choice itself says what to make of that
        return True


def _is_sole(problem: Problem) -> bool:
    """Whether there is one payload only, sync limit or not."""
    for table in problem.roles:
        pool = table.pool()
        if len(set(zip(pool.sensor.tolist(), pool.method.tolist(), strict=True))) > 1:
            return False
    return True
