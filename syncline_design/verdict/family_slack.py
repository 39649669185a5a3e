"""How far each term of a family may grow before a mission fails, or the payload changes.

A sensor's error and the bound of its timestamps are shared by all missions that use it: the error
grows by the same share in each, the bound by the same time.  Platform figures are each mission's.
Where a requirement breaks has the closed form of a single mission, at the mission that breaks
first; where the payload changes the family is chosen anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.edges import first_failing, tried
from syncline_design.choice.evaluate import broken, chosen_options, evaluate
from syncline_design.choice.family_core import core_names, of_names, unguarded
from syncline_design.choice.family_roads import choose_by_road
from syncline_design.choice.narrowed import kept
from syncline_design.choice.option import Option, ResourceName
from syncline_design.choice.options import RESOURCES, Bools, Options
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.slack import (
    GROWTHS,
    Slack,
    error_limit,
    gone,
    payload,
    tau_limits,
    with_change,
)
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    PLATFORM_UNITS,
    Build,
    PlatformFigure,
    platform_figure,
)
from syncline_design.choice.what_if import (
    platform_what_if,
    same_design,
    with_method_tau,
    with_sensor_error,
)
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.verdict.family import Chosen, Work, with_problems

# Values at which a payload is chosen anew, over the term's own.
FEW_GROWTHS = (1.0 + 1e-9, 1.01, 1.1, 1.5, 2.0, 4.0, 10.0, 30.0, 100.0, 1e3, 1e4, 1e6)

Payload = tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True, slots=True)
class Ledger:
    """A family's payload with what it takes to change its figures.

    core: the problems with what a payload no dearer can be made of; builds: of each mission a
    fresh way to tables.
    """

    work: Work
    chosen: Chosen
    core: tuple[Problem, ...]
    build: Callable[[], Build]

    @property
    def missions(self) -> range:
        """The places of the missions."""
        return range(len(self.work.missions))

    def name(self, mission: int) -> str:
        """A mission's name."""
        return self.work.missions[mission].name

    def whole(self) -> tuple[Problem, ...]:
        """Every mission's problem."""
        return self.chosen.problems


def family_slack(work: Work, chosen: Chosen, build: Callable[[], Build]) -> Iterator[Slack]:
    """Slack of every sensor error, timestamp bound and platform figure of a family's payload."""
    ledger = Ledger(work, chosen, _core(work, chosen), build)
    for index, stage in enumerate(work.missions[0].case.spec.stages):
        for r, table in enumerate(chosen.problems[0].roles):
            if table.stage == index:
                yield from _error_rows(ledger, r)
                yield from _tau_rows(ledger, r)
        for mission in ledger.missions:
            for figure in PLATFORM_FIGURES:
                row = _platform_row(ledger, mission, index, figure)
                if row is not None:
                    yield replace(row, stage=stage.name)


def _core(work: Work, chosen: Chosen) -> tuple[Problem, ...]:
    """Tables of what no dearer payload needs, left out where the sums can tell."""
    assert chosen.found is not None
    try:
        free = with_problems(work, [unguarded(problem) for problem in chosen.problems])
        names = core_names(free.family, chosen.found.sums.amount(_resource(work)))
    except TooLarge:
        return chosen.problems
    for own, problem, design in zip(names, chosen.problems, chosen.designs, strict=True):
        for some, option in zip(own, chosen_options(problem, design), strict=True):
            some.add(option.names)
    return tuple(of_names(p, own) for p, own in zip(chosen.problems, names, strict=True))


def _resource(work: Work) -> ResourceName:
    return "cost" if work.family.objective == "error" else work.family.objective


def _groups(ledger: Ledger, r: int, what: str) -> Iterator[tuple[str, list[int]]]:
    """The sensors, or methods, that missions take in a role, and the missions that do."""
    found: dict[str, list[int]] = {}
    for mission in ledger.missions:
        option = _option(ledger, mission, r)
        found.setdefault(getattr(option, what), []).append(mission)
    yield from found.items()


def _option(ledger: Ledger, mission: int, r: int) -> Option:
    return chosen_options(ledger.chosen.problems[mission], ledger.chosen.designs[mission])[r]


def _error_rows(ledger: Ledger, r: int) -> Iterator[Slack]:
    """A sensor's error grows by one share in every mission that uses the sensor."""
    chosen = ledger.chosen
    for sensor, missions in _groups(ledger, r, "sensor"):
        own = [m for m in missions if _option(ledger, m, r).error() > 0]
        if not own:
            continue
        ends = [(_share(ledger, m, r), m) for m in own]
        known = [(share, m) for share, m in ends if share is not None]
        share, mission = min(known) if known else (None, own[0])
        value = _option(ledger, mission, r).error()
        fails = None if share is None else float(share * value)
        table = chosen.problems[mission].roles[r]

        def changed(at: float, problems: Sequence[Problem], sensor: str = sensor,
                    value: Fraction = value) -> Sequence[Problem]:  # fmt: skip
            return [_grown(p, r, sensor, Fraction(at) / value) for p in problems]

        row = Slack(
            f"{table.role} sensor error", table.stage_name, float(value), "m", fails,
            None if fails is None else "accuracy", None, mission=ledger.name(mission),
        )  # fmt: skip
        yield _with_payload(ledger, row, changed, fails_never=fails is None)


def _share(ledger: Ledger, mission: int, r: int) -> Fraction | None:
    """By what share a sensor's error may grow in one mission."""
    problem, design = ledger.chosen.problems[mission], ledger.chosen.designs[mission]
    limit = error_limit(problem, design, r)
    return None if limit is None else Fraction(limit) / chosen_options(problem, design)[r].error()


def _grown(problem: Problem, r: int, sensor: str, share: Fraction) -> Problem:
    """The problem with the error of one sensor of a role so many times what it was."""
    pool = problem.roles[r].pool()
    rows = _rows(pool, pool.sensor, "sensor", sensor)
    if not rows.any():
        return problem
    error = pool[int(np.argmax(rows))].error()
    return with_sensor_error(problem, r, rows, error * share) if error else problem


def _rows(pool: Options, numbers: np.ndarray, what: str, identity: str) -> Bools:
    """Rows of a sensor or method, whose number is found at one row of each."""
    _, first = np.unique(numbers, return_index=True)
    named = [place for place in first.tolist() if getattr(pool[place], what) == identity]
    return np.asarray(np.isin(numbers, numbers[named]))


def _tau_rows(ledger: Ledger, r: int) -> Iterator[Slack]:
    """A timestamp bound is the same time in every mission that uses the method."""
    chosen = ledger.chosen
    for method, missions in _groups(ledger, r, "method"):
        found = [
            (*limit, m)
            for m in missions
            for limit in tau_limits(chosen.problems[m], chosen.designs[m], r)
        ]
        fails, kind, mission = min(found) if found else (None, None, missions[0])
        table, own = chosen.problems[mission].roles[r], _option(ledger, mission, r)

        def changed(
            at: float, problems: Sequence[Problem], method: str = method
        ) -> Sequence[Problem]:
            return [_stamped(p, r, method, Fraction(at)) for p in problems]

        row = Slack(
            f"{table.role} timestamp error", table.stage_name, own.tau_s, "s",
            None if fails is None else float(fails), kind, None, mission=ledger.name(mission),
        )  # fmt: skip
        yield _with_payload(ledger, row, changed, fails_never=fails is None)


def _stamped(problem: Problem, r: int, method: str, tau_s: Fraction) -> Problem:
    pool = problem.roles[r].pool()
    rows = _rows(pool, pool.method, "method", method)
    return with_method_tau(problem, r, rows, tau_s) if rows.any() else problem


def _platform_row(ledger: Ledger, mission: int, stage: int, figure: PlatformFigure) -> Slack | None:
    """Growth of a platform figure of one mission, the others as they are."""
    case = ledger.work.missions[mission].case
    value = float(platform_figure(case, stage, figure))
    if value <= 0.0:
        return None
    problem, design = ledger.chosen.problems[mission], ledger.chosen.designs[mission]
    what_if = platform_what_if(case, problem, ledger.build(), stage)
    alone = of_names(problem, [{o.names} for o in chosen_options(problem, design)])
    only = same_design(problem, design, alone)
    assert only is not None

    def kinds_broken(at: float) -> tuple[str, ...]:
        other = what_if(alone, figure, at)
        same = same_design(alone, only, other)
        return (gone(other),) if same is None else _broken(other, same)

    fails = first_failing(lambda at: not kinds_broken(at), tried(value, GROWTHS))
    kind = None if fails is None else next(iter(kinds_broken(fails)), None)
    row = Slack(
        PLATFORM_FIGURES[figure][0], "", value, PLATFORM_UNITS[figure], fails, kind, None,
        mission=ledger.name(mission),
    )  # fmt: skip

    def changed(at: float, problems: Sequence[Problem]) -> Sequence[Problem]:
        other = what_if(problems[mission], figure, at)
        return [*problems[:mission], other, *problems[mission + 1 :]]

    return _with_payload(ledger, row, changed, fails_never=False)


def _broken(problem: Problem, design: Design) -> tuple[str, ...]:
    """Kinds of a mission's requirements that are broken; what is bought stays as it is."""
    found = broken(problem, evaluate(problem, design))
    return tuple(kind for kind in found if kind not in RESOURCES)


def _with_payload(
    ledger: Ledger,
    row: Slack,
    changed: Callable[[float, Sequence[Problem]], Sequence[Problem]],
    *,
    fails_never: bool,
) -> Slack:
    """The row with the least value at which the choice, made anew, names another payload."""
    now = _payload(ledger.chosen.problems, ledger.chosen.designs)
    never = ("verdict",) if fails_never else ()

    def same(at: float) -> bool:
        stands = _stands(ledger, changed(at, ledger.core))
        if not stands and not _other_ways(ledger, lambda problems: changed(at, problems)):
            return False
        problems = ledger.core if stands else ledger.whole()
        return _named(ledger, changed(at, problems)) == now

    return with_change(row, same, FEW_GROWTHS, never)


def _payload(problems: Sequence[Problem], designs: Sequence[Design]) -> Payload:
    return tuple(payload(p, d) for p, d in zip(problems, designs, strict=True))


def _stands(ledger: Ledger, problems: Sequence[Problem]) -> bool:
    """Whether the chosen payload, as it is, meets every mission still."""
    for own, design, other in zip(
        ledger.chosen.problems, ledger.chosen.designs, problems, strict=True
    ):
        same = same_design(own, design, other)
        if same is None or _broken(other, same):
            return False
    return True


def _other_ways(ledger: Ledger, changed: Callable[[Sequence[Problem]], Sequence[Problem]]) -> bool:
    """Whether the same sensors and methods, wired or clocked otherwise, meet every mission."""
    part = [
        _alike(problem, payload(problem, design))
        for problem, design in zip(ledger.chosen.problems, ledger.chosen.designs, strict=True)
    ]
    return _named(ledger, changed(part)) is not None


def _alike(problem: Problem, wanted: Sequence[tuple[str, str]]) -> Problem:
    """The problem with these sensors and methods alone."""

    def is_of(r: int, options: Options) -> Bools:
        sensor = _rows(options, options.sensor, "sensor", wanted[r][0])
        return np.asarray(sensor & _rows(options, options.method, "method", wanted[r][1]))

    return kept(problem, is_of, lambda _, clock: True).problem


def _named(ledger: Ledger, problems: Sequence[Problem]) -> Payload | None:
    """The payload that is chosen in these tables."""
    in_force().check()
    work = with_problems(ledger.work, problems)
    if work.family.is_empty:
        return None
    found = choose_by_road(work.family, "front").found
    return None if found is None else _payload(problems, work.family.designs(found.design))
