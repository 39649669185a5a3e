"""The verdict under datasheet tolerances, and which figure to measure next.

A sensor's error lies between its values at both ends of its figures' tolerances.  Accuracy is
worst at the upper ends; sync is worst at the lower ones, because a better sensor has a smaller
tau_crit.  So a design passes always, sometimes or never:
always: sum of upper errors + sync error <= limit, and every lower error keeps its tau_crit;
never: no errors between the ends satisfy both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Literal

import numpy as np

from syncline_design.choice.core import Beside, best_from, best_with
from syncline_design.choice.decide import choose
from syncline_design.choice.evaluate import Incumbent, broken, chosen_options, evaluate, rank
from syncline_design.choice.judged import judgement
from syncline_design.choice.measured_next import (
    Ends,
    Measurement,
    OtherChoice,
    changes,
    ends_tried,
    weight,
)
from syncline_design.choice.options import RESOURCES
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem, selection_of, with_everything
from syncline_design.choice.slack import payload
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import (
    Build,
    SheetFigure,
    quantity,
    sigma_figures,
    with_figure,
)
from syncline_design.choice.what_if import (
    Numbers,
    numbers_of,
    same_design,
    same_places,
    sensors_that_matter,
    with_sheet_figure,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.spec.case import Case
from syncline_design.spec.selection import RoleSelection

HowOften = Literal["always", "sometimes", "never"]


@dataclass(frozen=True, slots=True)
class ToleranceVerdict(Record):
    """Whether a design passes for every, some or no value within the datasheet tolerances.

    deciding: the figures that decide; alone: the first of them settles it once it is known to be
    nominal, otherwise they decide together, the widest first.
    """

    passes: HowOften
    figures: tuple[str, ...]
    deciding: tuple[str, ...]
    alone: bool

    @property
    def text(self) -> str:
        """One sentence."""
        if not self.figures:
            return "No datasheet figure of this design carries a tolerance."
        out = f"Within the datasheet tolerances the design {self.passes} passes"
        if not self.deciding:
            return out + "."
        names = ", ".join(self.deciding)
        return out + (f"; {names} decides it." if self.alone else f"; {names} decide it together.")


def tolerance_verdict(
    case: Case, problem: Problem, design: Design, build: Build = build_problem
) -> ToleranceVerdict:
    """The verdict on one design under the tolerances of its own sensors' figures."""
    return tolerance_over([MissionDesign(case, problem, design, build)])


@dataclass(frozen=True, slots=True)
class MissionDesign:
    """A design of one mission; build: how a changed case of it becomes a problem."""

    case: Case
    problem: Problem
    design: Design
    build: Build

    @property
    def selected(self) -> tuple[RoleSelection, ...]:
        """What it takes, in names."""
        return selection_of(self.problem, self.design).roles

    def built(self, what_if: Case) -> Problem:
        """The problem of a changed case."""
        return self.problem if what_if is self.case else self.build(what_if)


def tolerance_over(missions: Sequence[MissionDesign]) -> ToleranceVerdict:
    """The verdict on one payload over all its missions; it meets them at figures as given.

    A figure is the same one in every mission.
    """
    found: dict[str, SheetFigure] = {}
    for mission in missions:
        sensors = {one.sensor for one in mission.selected}
        for figure in sigma_figures(mission.case):
            if figure.sensor in sensors and figure.quantity.has_tolerance:
                found.setdefault(figure.name, figure)
    figures, names = list(found.values()), tuple(found)

    def word_of(some: Sequence[SheetFigure]) -> HowOften:
        words = {_word(one.case, one.selected, one.design, some, one.built) for one in missions}
        return next(word for word in ("never", "sometimes", "always") if word in words)

    word = word_of(figures)
    if word != "sometimes":
        return ToleranceVerdict(word, names, (), False)
    settles = []
    for figure in figures:
        rest = [other for other in figures if other != figure]
        if word_of(rest) != "sometimes":
            settles.append(figure.name)
    if settles:
        return ToleranceVerdict(word, names, tuple(settles[:1]), True)

    def span(figure: SheetFigure) -> float:
        return max(_span(one.case, one.selected, figure, one.built) for one in missions)

    widest = sorted(figures, key=lambda f: (-span(f), f.name))
    return ToleranceVerdict(word, names, tuple(f.name for f in widest), False)


def _errors(
    case: Case, selected: Sequence[RoleSelection], build: Build
) -> tuple[Problem, Design, list[Fraction]]:
    """Exact errors of a selection under a changed spec, sync limit or not."""
    everything = with_everything(build(case))
    places = []
    for table, one in zip(everything.roles, selected, strict=True):
        place = table.options.place_of((one.sensor, one.primitive, one.method))
        assert place is not None
        places.append(place)
    design = Design(tuple(places), (0,) * len(everything.vehicles))
    return everything, design, [o.error() for o in chosen_options(everything, design)]


def _at(case: Case, figures: Iterable[SheetFigure], end: Literal["low", "high"]) -> Case:
    for figure in figures:
        value = getattr(figure.quantity, end)
        case = with_figure(case, figure, quantity(value, figure.dimension))
    return case


def _word(
    case: Case,
    selected: Sequence[RoleSelection],
    design: Design,
    figures: Sequence[SheetFigure],
    build: Build,
) -> HowOften:
    """Always, sometimes or never, by the ends of every sensor's error.

    Always asks simulation too, at the upper ends: what it leaves open is not said to pass always.
    """
    better, best_case, low = _errors(_at(case, figures, "low"), selected, build)
    problem, plain, high = _errors(_at(case, figures, "high"), selected, build)
    found = evaluate(problem, Design(plain.options, design.clocks))
    strict, limits = build(case).limits, problem.limits
    others = found.total_m - found.sensor_error_m
    room = math.inf if limits.accuracy_m is None else Fraction(limits.accuracy_m) - others
    least = [Fraction(0)] * len(low)
    demand = Fraction(0)
    if math.isfinite(strict.sync):
        demand = found.sync_rate_mps * found.tau_sys_s / Fraction(strict.sync)
        least = [_least_error(problem, plain, r, strict.sync) for r in range(len(low))]
    if any(amount in _budgets_broken(problem, design, plain) for amount in RESOURCES):
        return "never"
    keeps = all(e > bound for e, bound in zip(low, least, strict=True))
    if keeps and _fits(sum(high, Fraction(0)), room) and sum(low, Fraction(0)) > demand:
        noisiest = Design(plain.options, design.clocks)
        return "always" if judgement(problem, noisiest).passed else "sometimes"
    reachable = all(e > bound for e, bound in zip(high, least, strict=True))
    lowest = sum(map(max, low, least), Fraction(0))
    best_found = evaluate(better, Design(best_case.options, design.clocks))
    most = room + others - (best_found.total_m - best_found.sensor_error_m)
    feasible = reachable and _fits(lowest, most) and sum(high, Fraction(0)) > demand
    return "sometimes" if feasible and demand < most else "never"


def _fits(error: Fraction, room: Fraction | float) -> bool:
    return float(error) <= float(room)


def _least_error(problem: Problem, design: Design, r: int, limit: float) -> Fraction:
    """Sensor error that a role's own tau demands: tau_i < limit * tau_crit_i."""
    option = chosen_options(problem, design)[r]
    if not math.isfinite(option.tau_crit_s) or option.tau_crit_s == 0.0:
        return Fraction(-1)
    rate = option.error() / Fraction(option.tau_crit_s)
    return option.tau() * rate / Fraction(limit)


def _budgets_broken(problem: Problem, design: Design, plain: Design) -> tuple[str, ...]:
    return broken(problem, evaluate(problem, Design(plain.options, design.clocks)), accuracy=False)


def _span(
    case: Case, selected: Sequence[RoleSelection], figure: SheetFigure, build: Build
) -> float:
    """How much a figure's tolerance moves the sensor error [m]."""
    ends = [sum(_errors(_at(case, [figure], end), selected, build)[2]) for end in ("low", "high")]
    return float(ends[1] - ends[0])


def measure_next(
    case: Case, problem: Problem, design: Design, build: Build = build_problem
) -> tuple[Measurement, ...]:
    """Figures that alone flip the choice, the dearest flip first.

    Tried are the ends of every tolerance; where no figure has one, 20 % to either side of each; and
    on the way to an end that changes it, where it does first.
    """
    figures = list(sigma_figures(case))
    given = [figure for figure in figures if figure.quantity.has_tolerance]
    asked = _Asked.of(case, problem, design, build)
    found: list[Measurement] = []
    for figure in asked.worth_trying(
        [(f, ends_tried(f, assumed=not given)) for f in given or figures]
    ):
        choice = partial(_other, asked, figure)
        found += changes(figure, assumed=not given, choice=choice)
    return tuple(sorted(found, key=lambda m: (-weight(m), m.figure, m.at)))


@dataclass(frozen=True, slots=True)
class _Asked:
    """A design whose figures may be other than written.

    beside: None where a figure changes more than its sensor's columns (known effects, simulation);
    then every problem is built anew.  best: the design where it is known to be the best of all.
    """

    case: Case
    problem: Problem
    design: Design
    build: Build
    numbers: Numbers
    beside: Beside | None
    best: Incumbent | None = None

    @classmethod
    def of(cls, case: Case, problem: Problem, design: Design, build: Build) -> _Asked:
        plain = not case.effects and problem.judge is None
        beside = Beside(problem) if plain else None
        best = None
        if beside is not None and best_from(problem, design, beside) == design:
            best = Incumbent.of(problem, design)
        return cls(case, problem, design, build, numbers_of(case, problem), beside, best)

    def worth_trying(self, figures: Sequence[tuple[SheetFigure, Ends]]) -> list[SheetFigure]:
        """The figures without those that cannot change the choice."""
        known = Incumbent.of(self.problem, self.design)
        if self.beside is None or known is None:
            return [figure for figure, _ in figures]
        shares: dict[str, float] = {}
        for figure, (low, _) in figures:
            share = low / float(figure.quantity) if figure.quantity > 0.0 else 0.0
            shares[figure.sensor] = min(share, shares.get(figure.sensor, 1.0))
        left = sensors_that_matter(self.case, self.problem, known, self.beside, shares)
        return [figure for figure, _ in figures if figure.sensor in left]

    def chosen(self, figure: SheetFigure, end: float) -> tuple[Problem, Design | None]:
        """The problem with a figure changed, and the choice made anew."""
        value = quantity(end, figure.dimension)
        if self.beside is not None:
            other = with_sheet_figure(self.case, self.problem, self.numbers, figure, value)
            at_hand = same_design(self.problem, self.design, other)
            return other, self._best(figure, other, at_hand)
        other = self.build(with_figure(self.case, figure, value))
        found = choose(other, "front")
        return other, found.design if isinstance(found, Choice) else None

    def _best(self, figure: SheetFigure, other: Problem, at_hand: Design | None) -> Design | None:
        """The best design where a sensor is another one.

        Where that sensor is in one role alone, and not in the best design, that is still the best
        of those without it: then only designs with it are looked at.
        """
        assert self.beside is not None
        pairs = enumerate(zip(self.problem.roles, other.roles, strict=True))
        moved = [r for r, (before, after) in pairs if after is not before]
        if self.best is not None and at_hand is not None and len(moved) == 1:
            number, options = self.numbers[moved[0]][figure.sensor], other.roles[moved[0]].options
            rows = np.asarray(options.sensor == number)
            if not rows[at_hand.options[moved[0]]]:
                known = replace(self.best, design=at_hand)
                with_it = best_with(other, known, moved[0], rows, self.beside)
                both = [at_hand] if with_it is None else [at_hand, with_it]
                return min(both, key=lambda one: rank(other, one, evaluate(other, one)))
        near = (tuple(same_places(self.problem, self.design, other)), self.design)
        return best_from(other, at_hand, self.beside, near)


def _other(asked: _Asked, figure: SheetFigure, value: float) -> OtherChoice | None:
    """What the choice becomes with a figure at a value; None where it stays."""
    now = payload(asked.problem, asked.design)
    other, design = asked.chosen(figure, value)
    if design is None:
        return OtherChoice("infeasible", None)
    then = payload(other, design)
    if then == now:
        return None
    told = [
        f"{table.role} of {table.stage_name}: {sensor} stamped by {method}"
        for table, (sensor, method), before in zip(other.roles, then, now, strict=True)
        if (sensor, method) != before
    ]
    change = _objective(other, design) - _objective(asked.problem, asked.design)
    return OtherChoice("; ".join(told), change)


def _objective(problem: Problem, design: Design) -> float:
    found = evaluate(problem, design)
    if problem.objective == "error":
        return found.error_m
    return float(found.amount(problem.objective) or 0)
