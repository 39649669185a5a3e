"""The options that a design at least as good as a known one can be made of.

Whatever is chosen in the other roles, a design costs and errs no less than an option and the front
of cheapest amounts against least errors of the roles beside it, shared hardware and what timing
adds between them left out.  An option that cannot come below the known design even so is dropped
(reduced-cost fixing, as in integer programming); the known design itself always stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from syncline_design.choice.evaluate import Incumbent, known_or_more, resource_of
from syncline_design.choice.narrowed import Narrowed, narrowed, whole_of
from syncline_design.choice.options import MARGIN, Bools, Floats, Indices, Options
from syncline_design.choice.partition import best_of
from syncline_design.choice.stairs import NO_ROLES, Stairs, stairs
from syncline_design.choice.table import Design, Problem, is_empty
from syncline_design.machine.deadline import in_force

EXACT = 2**52  # sums of whole amounts below it are exact as floats
MOST_TRIED = 12  # options of a role near a design that does not stand
TIED = 1e-11  # errors of one order: 12 figures

Places = Sequence[int | None]  # of a design's options in another problem; None: gone


class Beside:
    """What a problem's roles take at least, kept for its what-ifs.

    Options are known by their identity: what a what-if leaves alone keeps its staircase.  Amounts
    are whole multiples of 1/unit, so that their sums are exact as floats where they fit.
    """

    def __init__(self, problem: Problem) -> None:
        name = resource_of(problem)
        self.problem = problem
        self.own = {id(table.options) for table in problem.roles}
        spent = [table.anywhere().spent(name) for table in problem.roles]
        clocks = [[c.resources.of(name) for c in v.clocks] for v in problem.vehicles]
        known = [a for amounts in clocks for a in amounts if a is not None]
        self.unit = math.lcm(*(s.denominator for s in spent), *(a.denominator for a in known))
        largest = sum(s.largest * (self.unit // s.denominator) for s in spent)
        largest += sum(abs(int(a * self.unit)) for a in known)
        self.exact = largest < EXACT
        self.clocks = math.fsum(
            float(min(known_or_more(a) for a in amounts) * self.unit) for amounts in clocks
        )
        self.kept: dict[tuple[int, ...], Stairs] = {}

    def amounts(self, options: Options) -> Floats:
        """Amounts of options in that unit."""
        spent = options.spent(resource_of(self.problem))
        return spent.whole.astype(np.float64) * (self.unit // spent.denominator)

    def of(self, problem: Problem, roles: Sequence[int], rows: Mapping[int, Indices]) -> Stairs:
        """The staircase of some roles; rows: what is left of those already looked at."""
        own = tuple(r for r in roles if self.has(problem, r))
        made = self._kept(problem, own)
        for r in roles:
            if r not in own:
                made = made.beside(self._of_role(problem, r, rows.get(r)))
        return made

    def has(self, problem: Problem, r: int) -> bool:
        """Whether a what-if leaves a role alone."""
        return id(problem.roles[r].options) in self.own

    def _kept(self, problem: Problem, roles: tuple[int, ...]) -> Stairs:
        if not roles:
            return NO_ROLES
        if roles not in self.kept:
            last = self._of_role(problem, roles[-1], None)
            self.kept[roles] = self._kept(problem, roles[:-1]).beside(last)
        return self.kept[roles]

    def _of_role(self, problem: Problem, r: int, rows: Indices | None) -> Stairs:
        options = problem.roles[r].options
        amount, error = self.amounts(options), added_least(problem, r, options)
        return stairs(amount, error) if rows is None else stairs(amount[rows], error[rows])


def added_least(problem: Problem, r: int, options: Options) -> Floats:
    """What options of a role add to the total at least, whatever stands beside it [m].

    Its error, and with the per_sensor model rate * tau of its pairs, whose bounds are sums.
    """
    if problem.sync_model == "syncline":
        return options.added
    rates = [pair.rate_mps for pair in problem.pairs if r in (pair.role, pair.reference)]
    return np.asarray(options.added + math.fsum(rates) * options.tau)


def total_least(problem: Problem, r: int, options: Options) -> Floats:
    """The same with what every design has and, with one roof over all pairs, rate * tau [m]."""
    error = added_least(problem, r, options) + problem.fixed_error_m
    pairs = any(r in (pair.role, pair.reference) for pair in problem.pairs)
    if problem.sync_model == "syncline" and pairs:
        error = error + problem.sync_rate_mps * options.tau
    return np.asarray(error)


def may_improve(
    problem: Problem,
    known: Incumbent,
    amount: Floats,
    total: Floats,
    others: Stairs,
    beside: Beside,
) -> Bools:
    """Whether options of these least figures can be part of a design no worse than a known one."""
    limit = problem.limits.accuracy_m
    room = np.abs(total) * MARGIN
    most = math.inf if limit is None else limit * (1.0 + MARGIN)
    tied = known.total_m * (1.0 + TIED)
    if problem.objective == "error":
        return np.asarray(others.least_within(tied - total + room) < math.inf)
    have = float(known.amount * beside.unit)
    as_much = have if beside.exact else have * (1.0 + MARGIN)
    least = beside.clocks + amount
    within, no_worse = (others.least_within(error - total + room) for error in (most, tied))
    cheaper = least + within < have if beside.exact else least + within <= as_much
    return np.asarray(cheaper | (least + no_worse <= as_much))


def core(problem: Problem, known: Incumbent, beside: Beside, *, held: bool = True) -> Narrowed:
    """The problem without the options that no design as good as a known one can have.

    held: whether the known design is one of the problem's own, and stays.
    """
    every = range(len(problem.roles))
    rows: dict[int, Indices] = {}
    for r in sorted(every, key=lambda r: beside.has(problem, r)):  # what is new first
        others = beside.of(problem, [q for q in every if q != r], rows)
        options = problem.roles[r].options
        amount, total = beside.amounts(options), total_least(problem, r, options)
        keeps = may_improve(problem, known, amount, total, others, beside)
        if held:
            keeps[known.design.options[r]] = True
        rows[r] = np.flatnonzero(keeps)
        if not len(rows[r]):
            rows |= {q: np.zeros(0, dtype=np.intp) for q in every}
            break
    return narrowed(problem, [rows[r] for r in every], _every_clock(problem))


def best_with(
    problem: Problem, known: Incumbent, r: int, rows: Bools, beside: Beside
) -> Design | None:
    """The best design with one of these options in a role; None where none is as good as a known
    one without them."""
    every = [np.arange(len(table.options)) for table in problem.roles]
    every[r] = np.flatnonzero(rows)
    if not len(every[r]):
        return None
    part = narrowed(problem, every, _every_clock(problem))
    fewer = core(part.problem, known, beside, held=False)
    if fewer.is_empty:
        return None
    return best_of(fewer.within(part), in_force(), known)


def best_from(
    problem: Problem,
    design: Design | None,
    beside: Beside,
    near: tuple[Places, Design] | None = None,
) -> Design | None:
    """The best design in the documented order, starting from one that is at hand.

    near: places of a design's options, where it does not stand itself, and the design.
    """
    in_force().check()
    known = None if design is None else Incumbent.of(problem, design)
    if known is None and near is not None:
        known = standing_near(problem, *near)
    if known is None:
        return best_of(whole_of(problem), in_force())
    left = core(problem, known, beside)
    if left.problem.combinations == 1:
        return known.design
    return best_of(left, in_force(), known)


def standing_near(problem: Problem, places: Places, design: Design) -> Incumbent | None:
    """A design that meets every requirement, with another option in one role; cheapest such."""
    gone = [r for r, place in enumerate(places) if place is None]
    if len(gone) > 1 or problem.objective == "error" or is_empty(problem):
        return None
    found = [_other_in(problem, places, design, r) for r in gone or range(len(places))]
    known = [one for one in found if one is not None and one.amount < math.inf]
    return min(known, key=lambda one: one.amount, default=None)


def _other_in(problem: Problem, places: Places, design: Design, r: int) -> Incumbent | None:
    """The cheapest of the first few options of a role with which a design stands."""
    options, rest = problem.roles[r].options, 0.0
    for q, (table, place) in enumerate(zip(problem.roles, places, strict=True)):
        if q != r and place is not None:
            rest += float(table.options.added[place])
    least, limit = total_least(problem, r, options), problem.limits.accuracy_m
    fits = np.flatnonzero(least + rest <= (math.inf if limit is None else limit))
    amount = options.spent(resource_of(problem)).whole[fits].astype(np.float64)
    for row in fits[np.lexsort((least[fits], amount))][:MOST_TRIED].tolist():
        taken = tuple(row if q == r else int(place or 0) for q, place in enumerate(places))
        known = Incumbent.of(problem, Design(taken, design.clocks))
        if known is not None:
            return known
    return None


def _every_clock(problem: Problem) -> list[range]:
    return [range(len(vehicle.clocks)) for vehicle in problem.vehicles]
