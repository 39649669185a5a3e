"""Designs one after the other by splitting what is left: memory grows with the designs alone.

E. L. Lawler, "A procedure for computing the K best solutions to discrete optimization problems",
Management Science 18 (1972): the best design of a set is found by merging; the rest of the set
falls into parts that agree with it up to some role and differ there, and the best of each part
waits for its turn.  Two designs differ when a role (or, where asked, a clock) carries another
label.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator
from typing import Literal

import numpy as np

from syncline_design.choice.evaluate import Incumbent, Rank, broken, evaluate, rank, resource_of
from syncline_design.choice.merged_front import merged_front
from syncline_design.choice.narrowed import Narrowed, narrowed
from syncline_design.choice.options import Indices
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import Deadline, in_force
from syncline_design.machine.quick_dataclass import dataclass

Label = Literal["sensor", "names"]
Open = tuple[Indices, ...]  # places still open, per role


@dataclass(frozen=True, slots=True)
class _Part:
    """A set of designs: what is open in it."""

    options: Open
    clocks: tuple[tuple[int, ...], ...]


def iter_differing(
    problem: Problem, label: Label, *, clocks: bool = False, deadline: Deadline | None = None
) -> Iterator[Design]:
    """Designs that meet every sum, best first, one for each combination of labels.

    clocks: whether designs that differ in a clock alone are two.  Raises NoVerdict after the
    deadline and where merging gives up.
    """
    end = deadline or in_force()
    whole = _Part(
        tuple(np.arange(len(role.options)) for role in problem.roles),
        tuple(tuple(range(len(vehicle.clocks))) for vehicle in problem.vehicles),
    )
    counter = itertools.count()
    waiting: list[tuple[Rank, int, Design, _Part]] = []

    def put(part: _Part) -> None:
        design = best_of(narrowed(problem, part.options, part.clocks), end)
        if design is not None:
            place = rank(problem, design, evaluate(problem, design))
            heapq.heappush(waiting, (place, next(counter), design, part))

    put(whole)
    while waiting:
        _, _, design, part = heapq.heappop(waiting)
        yield design
        for rest in _split(problem, part, design, label, clocks):
            put(rest)


def best_of(part: Narrowed, deadline: Deadline, known: Incumbent | None = None) -> Design | None:
    """The first design of a part in the documented order, by merging, decided exactly.

    known: a design of the whole that is in the part: none worse is looked at.
    """
    deadline.check()
    if part.is_empty:
        return None
    problem = part.problem
    resource = resource_of(problem)
    points = merged_front(problem, resource, accuracy=True, deadline=deadline, known=known)
    for point in reversed(points) if problem.objective == "error" else points:
        if not broken(problem, evaluate(problem, point.design)):
            return part.whole(point.design)
    return None


def _split(
    problem: Problem, part: _Part, design: Design, label: Label, clocks: bool
) -> Iterator[_Part]:
    """The rest of a part without the designs that carry the labels of one."""
    options = list(part.options)
    for r, table in enumerate(problem.roles):
        number = table.options.sensor if label == "sensor" else table.options.rank
        same = number[options[r]] == number[design.options[r]]
        alike, others = options[r][same], options[r][~same]
        if len(others):
            yield _Part((*options[:r], others, *options[r + 1 :]), part.clocks)
        options[r] = alike
    if not clocks:
        return
    left = list(part.clocks)
    for v, own_clock in enumerate(design.clocks):
        others = tuple(i for i in left[v] if i != own_clock)
        if others:
            yield _Part(tuple(options), (*left[:v], others, *left[v + 1 :]))
        left[v] = (own_clock,)
