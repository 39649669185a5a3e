"""The ways of a family that a payload no dearer than a known one can be made of.

As the core of one mission (`core`), by sums over all missions at once: whatever is chosen in the
other roles, a payload costs no less than a way and the least of the others, and errs no less in any
mission.  Sync limits and reach are left out, so that what stays is enough where figures grow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.exclusions import Exclusions
from syncline_design.choice.family import Family
from syncline_design.choice.family_best import primary_of
from syncline_design.choice.family_bounds import Rest, may_matter
from syncline_design.choice.family_tables import tabulate_family
from syncline_design.choice.option import Names
from syncline_design.choice.options import Options
from syncline_design.choice.table import NOTHING, Problem, RoleTable


def unguarded(problem: Problem) -> Problem:
    """The problem without limits on sync and spacing, with every option that some distance has."""
    roles = []
    for table in problem.roles:
        every = table.anywhere()
        every = every.take(every.by_name())
        roles.append(replace(table, options=every, excluded=NOTHING))
    limits = replace(problem.limits, sync=math.inf, spacing_m=None)
    return replace(problem, roles=tuple(roles), limits=limits)


def core_names(family: Family, amount: Fraction | None) -> list[list[set[Names]]]:
    """Of each mission and role the options of payloads that take no more than an amount.

    family: of unguarded problems; amount: of the objective, which nothing bounds where it is None.
    """
    tables = tabulate_family(family, primary_of(family))
    most = math.inf
    if amount is not None and family.objective != "error":
        most = float(tables.whole(0, amount))
    rest = Rest(tables, tables.roles)
    least = (tables.rates * rest.waits + tables.fixed)[:, None]
    if tables.per_sensor:
        least = tables.fixed[:, None]
    kept: list[list[set[Names]]] = [[] for _ in family.problems]
    for r, ways in enumerate(tables.roles):
        own = ways.amounts[0].astype(np.float64)
        # The amount is held as one more error, whose limit is what may be spent.
        steps = replace(rest.beside[r], error=np.vstack([rest.beside[r].error,
                                                         rest.beside[r].amount]))  # fmt: skip
        total = np.vstack([ways.added + least, own])
        limits = np.append(tables.accuracy, most)
        rows = np.flatnonzero(may_matter(steps, own, total, limits, None))
        for m, problem in enumerate(family.problems):
            options = problem.roles[r].options
            places = np.unique(family.roles[r].places[m, ways.place[rows]])
            kept[m].append(set(options.take(places).all_names()))
    return kept


def of_names(problem: Problem, names: Sequence[set[Names]]) -> Problem:
    """The problem with options of these names alone, those that a limit keeps out included."""
    roles = tuple(_with(table, own) for table, own in zip(problem.roles, names, strict=True))
    return replace(problem, roles=roles)


def _with(table: RoleTable, names: set[Names]) -> RoleTable:
    gone = table.excluded
    excluded = Exclusions.in_turn(gone.rest, _named(gone.poor, names), _named(gone.beyond, names))
    return replace(table, options=_named(table.options, names), excluded=excluded)


def _named(options: Options, names: set[Names]) -> Options:
    rows = [row for row, name in enumerate(options.all_names()) if name in names]
    return options.take(np.array(rows, dtype=np.intp))
