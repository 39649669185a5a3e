"""The exact front by merging: what couples the roles is fixed or carried along, the rest adds up.

Fixed: each vehicle's clock and, stage by stage, the timing class (tau, timeline) of the ranging
option, the reference of that stage.  Carried along: sums of resources, channels in use, sensor
error E and the largest pair bound M so far.  With the `syncline` model the total is
E + rate max(M, what follows), so a partial design with no larger sums, E and E + rate M replaces
another: whatever follows, it ends no worse.

One constraint bounds the sensor error from below: tau_sys < limit * E / rate.  There the better
sensor can be the one that fails.  The merge first ignores that constraint; if nothing on the
result breaks it, the result is exact.  Otherwise a second, guarded merge lets only those partial
designs replace others that satisfy the constraint whatever follows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import overload

import numpy as np

from syncline_design.choice.arrays import Tables, tabulate, tie_order, useful_options
from syncline_design.choice.evaluate import (
    Incumbent,
    Rank,
    error_key,
    evaluate,
    known_or_more,
    rank,
    total_error_m,
)
from syncline_design.choice.labels import Labels, total_m
from syncline_design.choice.merge import Merge
from syncline_design.choice.narrowed import Narrowed, says_all, whole_of
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import MARGIN, Bools, Column, Floats, Indices
from syncline_design.choice.outcome import Deadline, FrontPoint, TooLarge
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.remaining import Ceiling, lowered
from syncline_design.choice.searched_front import searched_front
from syncline_design.choice.stage_timings import StageTimings
from syncline_design.choice.table import ClockOption, Design, Nearer, Problem, is_empty
from syncline_design.machine.deadline import in_force, within
from syncline_design.machine.quick_dataclass import dataclass

APART = 3e-11  # errors that differ by a larger share differ in their 12 figures
ROUGH = (100, 300)  # partial designs that first passes go on with, to know what others must beat


@dataclass(frozen=True, slots=True)
class _Finished:
    """Complete designs by rising resource; clocks: of each vehicle those that are left."""

    labels: Labels
    total: Floats
    clocks: tuple[tuple[int, ...], ...]

    def take(self, rows: Indices) -> _Finished:
        """Some of them."""
        return _Finished(self.labels.take(rows), self.total[rows], self.clocks)


def merged_front(
    problem: Problem,
    resource: ResourceName,
    *,
    accuracy: bool,
    deadline: Deadline | None = None,
    known: Incumbent | None = None,
) -> Sequence[FrontPoint]:
    """The front; with `accuracy`, only designs whose error stays within the limit (1 + 1e-12).

    known: a design that meets every sum; then only what comes no later in the order, by objective
    and error, need be on it.
    """
    demand_structure(problem)
    if is_empty(problem):
        return ()
    with within(deadline or in_force()) as end:
        return _merged(problem, resource, accuracy, end, known)


def _merged(
    problem: Problem, resource: ResourceName, accuracy: bool, end: Deadline, known: Incumbent | None
) -> Sequence[FrontPoint]:
    tables = _one_timeline(tabulate(problem, resource))
    ceiling = None if known is None else _no_worse(tables, known)
    relaxed = _merge_all(_reduced(tables), accuracy, end, guarded=False, ceiling=ceiling)
    holds = _hold_sync(tables, relaxed)
    held = relaxed.take(np.flatnonzero(holds))
    if bool(holds.all()):
        return _points(tables, [held]) if len(held.total) else ()
    if problem.nearer:
        return tuple(searched_front(problem, resource, accuracy=accuracy, deadline=end))
    if bool(holds.any()):
        ceiling = lowered(ceiling, held.labels, held.total)
    guarded = _merge_all(tables, accuracy, end, guarded=True, ceiling=ceiling)
    parts = [part for part in (held, guarded) if len(part.total)]
    return _points(tables, parts) if parts else ()


def _no_worse(tables: Tables, known: Incumbent) -> Ceiling:
    """What leaves nothing that comes after a known design, by objective and error."""
    total = known.total_m * (1.0 + APART)
    if tables.problem.objective == "error":
        return Ceiling(np.array([-math.inf]), np.array([total]))
    amount = float(known.amount * tables.keys[0].denominator)
    dearer = amount + abs(amount) * 4.0 * MARGIN
    return Ceiling(np.array([amount, dearer]), np.array([total, -math.inf]))


def _reduced(tables: Tables) -> Tables:
    """Tables without the options that others make superfluous when nothing bounds E from below."""
    problem = tables.problem
    per_sensor = problem.sync_model == "per_sensor"
    roles = []
    for r, role in enumerate(tables.roles):
        rates = [p.rate_mps for p in problem.pairs if r in (p.role, p.reference)]
        rate = math.fsum(rates) if per_sensor else problem.sync_rate_mps * bool(rates)
        roles.append(useful_options(tables, role, rate, per_sensor))
    return replace(tables, roles=tuple(roles))


def _one_timeline(tables: Tables) -> Tables:
    """Tables without timelines where no clock is off: then none of them matters."""
    clocks = [clock for vehicle in tables.problem.vehicles for clock in vehicle.clocks]
    if any(clock.offset_bound_s != 0.0 for clock in clocks):
        return tables
    roles = tuple(replace(r, host=np.zeros(len(r), dtype=bool)) for r in tables.roles)
    return replace(tables, roles=roles)


def demand_structure(problem: Problem) -> None:
    """Refuse couplings that merging does not remove: the MILP takes those."""
    for pair in problem.pairs:
        own = problem.roles[pair.role]
        if pair.reference is None:
            if own.role == "ranging":
                raise TooLarge("a chain that ends in a stage without a ranging sensor")
            continue
        other = problem.roles[pair.reference]
        same = own.stage == other.stage and own.role != "ranging"
        chain = own.stage == other.stage - 1 and own.role == "ranging"
        if other.role != "ranging" or not (same or chain):
            raise TooLarge("pairs of timestamps that do not form a chain of stages")
    stages = [role.stage for role in problem.roles]
    if any(set(stages).isdisjoint(vehicle.stages) for vehicle in problem.vehicles):
        raise TooLarge("a vehicle without sensors")
    if stages != sorted(stages):
        raise TooLarge("roles that are not in the order of the stages")


def _merge_all(
    tables: Tables, accuracy: bool, deadline: Deadline, *, guarded: bool, ceiling: Ceiling | None
) -> _Finished:
    """Complete designs with every clock that may matter, the front of them."""
    useful = tuple(useful_clocks(tables.problem))
    merge = partial(Merge, tables, useful, accuracy=accuracy, guarded=guarded)
    plan = StageTimings(tables, useful)
    if guarded or plan.is_coupled:
        for most in ROUGH[: 2 if plan.is_long and not guarded else 1]:
            run = merge(ceiling=ceiling, most=most).run(deadline)
            rough = _complete(tables, useful, run, guarded)
            if len(rough.total):
                ceiling = lowered(ceiling, rough.labels, rough.total)
    finished = _complete(tables, useful, merge(ceiling=ceiling).run(deadline), guarded)
    if not len(finished.total):
        return finished
    labels, total = finished.labels, finished.total
    ties = tie_order(tables, labels.resources, labels.ties)
    finished = finished.take(undominated(Columns((labels.resources[0], total), tie=ties)))
    return finished.take(np.argsort(-finished.total, kind="stable"))


def _complete(
    tables: Tables, useful: tuple[tuple[int, ...], ...], labels: Labels | None, guarded: bool
) -> _Finished:
    """Complete designs with their totals; guarded: those that keep the system's sync limit."""
    if labels is None:
        return _Finished(_no_labels(len(tables.keys)), np.zeros(0), useful)
    finished = _Finished(labels, total_m(tables.problem, labels), useful)
    return finished.take(np.flatnonzero(_hold_sync(tables, finished))) if guarded else finished


def _no_labels(keys: int) -> Labels:
    none, no_choice = np.zeros(0), np.zeros((0, 1), dtype=np.intp)
    whole = tuple(np.zeros(0, dtype=np.int64) for _ in range(keys))
    return Labels(whole, (), none, none, none, none, none, (), no_choice, no_choice, none, none > 0)


def _hold_sync(tables: Tables, finished: _Finished) -> Bools:
    """Which complete designs keep tau_sys below their limit; close calls are decided exactly."""
    problem, labels = tables.problem, finished.labels
    limit = problem.limits.sync
    if math.isinf(limit) or len(labels) == 0:
        return np.ones(len(labels), dtype=bool)
    caused, allowed = problem.sync_rate_mps * labels.bound, limit * labels.noise
    holds = np.asarray(caused < allowed * (1.0 - MARGIN))
    may = np.asarray(caused <= allowed * (1.0 + MARGIN))
    for near in problem.near_ends():
        there, allowed = _at_near_ends(tables, labels, near)
        holds &= there < limit * allowed * (1.0 - MARGIN)
        may &= there <= limit * allowed * (1.0 + MARGIN)
    close = np.flatnonzero(may if _bends(problem) else ~holds & may)
    for row, design in zip(close, _designs(tables, finished, close), strict=True):
        holds[row] = evaluate(problem, design).sync_ratio < limit
    return holds


def _bends(problem: Problem) -> bool:
    """Whether some sensor's noise bends between the ends of the distances, where no sum looks."""
    return bool(problem.nearer) and any(
        option.bends
        for table in problem.roles
        if table.role == "ranging"
        for option in table.options.first_of_each(table.options.sensor)
    )


def _at_near_ends(
    tables: Tables, labels: Labels, near: tuple[Nearer, ...]
) -> tuple[Floats, Floats]:
    """Sync error and sensor error [m] of complete designs with some stages at their near end."""
    stages = {one.stage for one in near}
    less = np.zeros(len(labels))
    for r, table in enumerate(tables.problem.roles):
        if table.stage in stages:
            less += table.options.nearer[tables.order[r]][labels.choice[:, r]]
    slower = float(sum((one.slower for one in near), Fraction(0)))
    return (tables.problem.sync_rate_mps - slower) * labels.bound, labels.noise - less


def _designs(tables: Tables, finished: _Finished, rows: Indices) -> list[Design]:
    """Designs of some of the labels."""
    if len(rows) == 0:
        return []
    places = finished.labels.choice[rows]
    options = np.column_stack(
        [np.array(order)[places[:, r]] for r, order in enumerate(tables.order)]
    )
    chosen = finished.labels.clocks[rows]
    clocks = np.column_stack([np.array(own)[chosen[:, v]] for v, own in enumerate(finished.clocks)])
    return [
        Design(tuple(o), tuple(c)) for o, c in zip(options.tolist(), clocks.tolist(), strict=True)
    ]


def useful_clocks(problem: Problem) -> Iterator[tuple[int, ...]]:
    """Clock places per vehicle, without clocks that another one of the vehicle replaces."""
    known = says_all(problem)
    for vehicle in problem.vehicles:
        order = sorted(range(len(vehicle.clocks)), key=lambda i: vehicle.clocks[i].id or "")
        kept: list[int] = []
        for i in order:
            clock = vehicle.clocks[i]
            if not any(
                _replaces(vehicle.clocks[j], clock, j in order[: order.index(i)], known)
                for j in order
                if j != i
            ):
                kept.append(i)
        yield tuple(kept)


def _replaces(one: ClockOption, other: ClockOption, earlier: bool, known: bool) -> bool:
    """Whether a clock is nowhere worse, and better in resources or earlier by name.

    known: whether every sum is known; one that is not tells no two designs apart.
    """
    ours = [known_or_more(getattr(one.resources, n)) for n in ("cost", "mass", "power")]
    theirs = [known_or_more(getattr(other.resources, n)) for n in ("cost", "mass", "power")]
    worse = any(a > b for a, b in zip(ours, theirs, strict=True))
    if worse or one.offset_bound_s > other.offset_bound_s:
        return False
    if set(one.requires) - set(other.requires):
        return False
    return (known and ours != theirs) or earlier


@dataclass(frozen=True, slots=True, eq=False)
class Points(Sequence[FrontPoint]):
    """A front by columns; a point, its error exact and rounded once, where it is asked for.

    part: what the columns' places refer to.
    """

    part: Narrowed
    amount: Column
    denominator: int
    options: Column
    clocks: Column

    def __len__(self) -> int:
        return len(self.amount)

    @overload
    def __getitem__(self, place: int) -> FrontPoint: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[FrontPoint, ...]: ...
    def __getitem__(self, place: int | slice) -> FrontPoint | tuple[FrontPoint, ...]:
        if isinstance(place, slice):
            return tuple(self[i] for i in range(*place.indices(len(self))))
        if not -len(self) <= place < len(self):
            raise IndexError(place)
        amount = self.amount[place]
        design = Design(tuple(self.options[place].tolist()), tuple(self.clocks[place].tolist()))
        error = total_error_m(self.part.problem, design)
        exact = math.inf if amount == math.inf else Fraction(int(amount), self.denominator)
        return FrontPoint(exact, error, self.part.whole(design))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))


def _points(tables: Tables, parts: Sequence[_Finished]) -> Sequence[FrontPoint]:
    """Complete designs as one front, by rising amount and falling error.

    Where two of them come so close that floats do not tell which is the better, all are compared
    exactly.
    """
    labels = [part.labels for part in parts]
    amount = np.concatenate([one.resources[0] for one in labels])
    total = np.concatenate([part.total for part in parts])
    places = np.concatenate([one.choice for one in labels])
    options = np.column_stack([order[places[:, r]] for r, order in enumerate(tables.order)])
    chosen = np.concatenate([one.clocks for one in labels])
    clocks = np.column_stack([np.array(own)[chosen[:, v]] for v, own in enumerate(parts[0].clocks)])
    if len(parts) > 1:  # both may have found the same
        _, rows = np.unique(np.column_stack([options, clocks]), axis=0, return_index=True)
    else:
        rows = np.arange(len(total))
    rows = rows[np.lexsort((total[rows], amount[rows]))]
    lowest = np.append(np.inf, np.minimum.accumulate(total[rows])[:-1])
    lower, higher = (total[rows] < lowest * (1.0 - APART), total[rows] > lowest * (1.0 + APART))
    clear = bool(np.all(lower | higher))
    rows = rows[lower] if clear else rows
    whole = whole_of(tables.problem)
    points = Points(whole, amount[rows], tables.keys[0].denominator, options[rows], clocks[rows])
    return points if clear else _joined(list(points), tables.problem)


def _joined(points: list[FrontPoint], problem: Problem) -> tuple[FrontPoint, ...]:
    """Points as one front; errors equal to 12 figures count as equal, the order settles those."""
    keyed = [((point.amount, error_key(point.error_m)), point) for point in points]
    keyed.sort(key=lambda entry: entry[0])
    out: list[FrontPoint] = []
    least = math.inf
    for (_, error), tied in itertools.groupby(keyed, key=lambda entry: entry[0]):
        if error < least:
            out.append(_first([point for _, point in tied], problem))
            least = error
    return tuple(out)


def _first(tied: list[FrontPoint], problem: Problem) -> FrontPoint:
    """The first in the documented order of points that agree in amount and error."""
    if len(tied) == 1:
        return tied[0]

    def place(point: FrontPoint) -> Rank:
        return rank(problem, point.design, evaluate(problem, point.design))

    return min(tied, key=lambda point: place(point)[2:])
