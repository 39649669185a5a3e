"""How probable it is that a design keeps every requirement, with figures within their intervals.

The figures are taken as independent and uniform in their intervals, and every requirement of every
mission counts together.  All designs meet the same random numbers, figure by figure: what tells two
of them apart is never chance.  Errors are those of the tables, sampled:
  position |sigma_p|; attitude |sigma_Theta| d; ranging sigma_r + |sigma_u| d  (sensor_error_ub)
accuracy holds where their sum and what does not vary stays within the limit, sync where every
tau_i < limit tau_crit_i and tau_sys < limit E / rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Literal

import numpy as np

from syncline_design.choice.evaluate import chosen_options, evaluate
from syncline_design.choice.option import Option
from syncline_design.choice.options import Bools, Floats
from syncline_design.choice.stage_motion import motion_of
from syncline_design.choice.table import Design, Problem, RoleTable
from syncline_design.choice.variations import sigma_figures
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator
from syncline_design.machine.records import Record
from syncline_design.simulation.intervals import proportion_interval
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import SensorEntry

FigureName = tuple[str, str, int | None]  # sensor, figure, axis
Spans = dict[FigureName, tuple[float, float]]

FIRST = 20_000  # samples, doubled until the interval leaves the probability asked for
MOST = 1_280_000
CONFIDENCE = 0.999


@dataclass(frozen=True, slots=True)
class Probability(Record):
    """A probability with its interval, and whether it reaches what is asked for."""

    value: float
    low: float
    high: float
    samples: int
    status: Literal["pass", "fail", "indeterminate"]


@dataclass
class Likelihood:
    """The probability of designs of one spec; cases: of each mission, spans: its intervals."""

    cases: tuple[Case, ...]
    spans: tuple[Spans, ...]
    asked: float
    seed: int
    known: dict[tuple[object, ...], Probability] = field(default_factory=dict)

    def of(self, problems: Sequence[Problem], designs: Sequence[Design]) -> Probability:
        """The probability of one design of every mission, which holds at given figures."""
        chosen = [chosen_options(p, d) for p, d in zip(problems, designs, strict=True)]
        clocks = tuple(design.clocks for design in designs)
        key = (clocks, *(tuple(option.names for option in own) for own in chosen))
        if key not in self.known:
            self.known[key] = self._estimated(problems, designs, chosen)
        return self.known[key]

    def _estimated(
        self, problems: Sequence[Problem], designs: Sequence[Design], chosen: list[list[Option]]
    ) -> Probability:
        """More samples until the interval leaves the probability that is asked for."""
        varying = {sensor for spans in self.spans for sensor, *_ in spans}
        if not any(option.sensor in varying for own in chosen for option in own):
            return Probability(1.0, 1.0, 1.0, 0, "pass")  # as at given figures, which it keeps
        kept = count = 0
        while True:
            in_force().check()
            size = count or FIRST
            drawn = self._drawn(count // FIRST, size // FIRST)
            holds = np.ones(size, dtype=bool)
            rows = zip(self.cases, self.spans, problems, designs, chosen, strict=True)
            for case, spans, problem, design, options in rows:
                values = {
                    one: low + (high - low) * drawn[one] for one, (low, high) in spans.items()
                }
                holds &= _holds(case, problem, design, options, values, size)
            kept, count = kept + int(holds.sum()), count + size
            low, high = proportion_interval(kept, count, CONFIDENCE)
            status: Literal["pass", "fail", "indeterminate"] = "indeterminate"
            if low >= self.asked or high < self.asked:
                status = "pass" if low >= self.asked else "fail"
            if status != "indeterminate" or count >= MOST:
                return Probability(kept / count, low, high, count, status)

    def _drawn(self, first: int, blocks: int) -> dict[FigureName, Floats]:
        """Places in the intervals: of each block and each figure a stream of its own.

        A figure is the same one in every mission, whatever its interval there.
        """
        figures = sorted({one for spans in self.spans for one in spans}, key=str)
        return {
            figure: np.concatenate(
                [
                    generator([self.seed, index, block], bits=np.random.PCG64).random(FIRST)
                    for block in range(first, first + blocks)
                ]
            )
            for index, figure in enumerate(figures)
        }


def likelihood_of(cases: Sequence[Case], asked: float, seed: int) -> Likelihood:
    """Of a spec's missions, with the intervals of all that they may use."""
    spans: list[Spans] = []
    for case in cases:
        figures = (one for one in sigma_figures(case) if one.quantity.has_tolerance)
        spans.append(
            {(f.sensor, f.figure, f.axis): (f.quantity.low, f.quantity.high) for f in figures}
        )
    return Likelihood(tuple(cases), tuple(spans), asked, seed)


def _holds(
    case: Case,
    problem: Problem,
    design: Design,
    options: list[Option],
    drawn: dict[FigureName, Floats],
    size: int,
) -> Bools:
    """Where one mission keeps its requirements."""
    sums, limits = evaluate(problem, design), problem.limits
    holds = np.ones(size, dtype=bool)
    error, more = np.zeros(size), np.zeros(size)
    for table, option in zip(problem.roles, options, strict=True):
        own = _sampled(case, table, option, drawn)
        if own is None:
            error += float(option.error())
            continue  # it keeps its own tau_crit as given, or it would be no option
        error += own
        nominal = float(option.error())
        if option.noise_systematic_m and nominal:
            more += float(option.noise_systematic_m) * (own / nominal - 1.0)
        if option.own_rate_mps is not None:
            holds &= float(option.tau() * option.own_rate_mps) < limits.sync * own
    if limits.accuracy_m is not None:
        rest = float(sums.total_m - sums.sensor_error_m)
        holds &= error + rest + more <= limits.accuracy_m * (1.0 + 1e-14)
    caused = float(sums.sync_rate_mps * sums.tau_sys_s)
    return holds & ((caused == 0.0) | (caused < limits.sync * error))


def _sampled(
    case: Case, table: RoleTable, option: Option, drawn: dict[FigureName, Floats]
) -> Floats | None:
    """A sensor's error [m] for each sample; None where none of its figures has an interval."""
    stage = case.stages[table.stage]
    role, motion = stage.role(table.role), motion_of(stage)
    entry = None if role is None else role.sensor(option.sensor)
    if entry is None or not motion.lets_in(table.role):
        return None
    if not any(sensor == option.sensor for sensor, *_ in drawn):
        return None
    if table.role == "position":
        return np.asarray(_norm(entry, option.sensor, "sigma_position", 3, drawn) + 0.0)
    distance = float(motion.distance)
    if table.role == "attitude":
        return np.asarray(_norm(entry, option.sensor, "sigma_attitude", 3, drawn) * distance)
    across = _norm(entry, option.sensor, "sigma_bearing", 2, drawn)
    along = _norm(entry, option.sensor, "sigma_range", 1, drawn)
    return np.asarray(along + across * distance)


def _norm(
    entry: SensorEntry, sensor: str, figure: str, axes: int, drawn: dict[FigureName, Floats]
) -> Floats | float:
    """Euclidean norm of a figure over its axes; one figure holds for each of them."""
    value = getattr(entry, figure)
    if not isinstance(value, tuple):
        one = drawn.get((sensor, figure, None), float(value or 0.0))
        return math.sqrt(axes) * one
    parts = [drawn.get((sensor, figure, axis), float(part)) for axis, part in enumerate(value)]
    return np.sqrt(sum((np.square(part) for part in parts), np.float64(0.0)))
