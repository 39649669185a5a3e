"""What a study says as a whole: cheapest cost over two factors, who wins where, where it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from typing import Any, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.studies.definition import Factor
from syncline_design.studies.finished import CaseResult, Finished
from syncline_design.studies.record import CasePoint, CaseWord, RolePick
from syncline_design.verdict.tree import RequirementResult

MOST_FRONTS = 500
MOST_CELLS = 40  # values per axis of a heat map
MOST_FINE = 200  # the same where all are of a grid, and what has a map of MOST_CELLS has not two

CellWord = Literal["meets", "waived", "none", "undecided", "refused"]
Shown = Callable[[Factor, str], str]  # a value of a factor as it is to be written


@dataclass(frozen=True, slots=True)
class Brief:
    """One case in a line; labels in the order of the study's factors."""

    number: int
    base: int
    labels: tuple[str, ...]
    verdict: CaseWord
    cost: float | None
    currency: str
    error_m: float | None
    picks: tuple[RolePick, ...]
    failing: tuple[str, ...] = ()  # ids of requirements, waived ones too
    waived: tuple[str, ...] = ()  # of a case that meets all the same
    excused: tuple[str, ...] = ()  # of any case: what a waiver in force covers
    unsettled: bool = False  # the time limit left open which of its requirements fail

    @property
    def meets(self) -> bool:
        """Whether the case's design meets its requirements."""
        return self.verdict == "meets"


@dataclass(frozen=True, slots=True)
class StudyFront(Record):
    """One exact front of cost against error; cases: the numbers of those that share it."""

    cases: tuple[int, ...]
    currency: str
    points: tuple[CasePoint, ...]


@dataclass(frozen=True, slots=True)
class StudySummary:
    """Every case in a line, and the fronts that differ.

    accuracy: the first case's, in the unit of whose limit a page tells errors.  missed: by id, what
    some case misses, as the first that does, and as the first with each other waiver.
    """

    result: Finished
    briefs: tuple[Brief, ...]
    fronts: tuple[StudyFront, ...]
    accuracy: RequirementResult | None = None
    missed: Mapping[str, Sequence[RequirementResult]] = field(default_factory=dict)

    @property
    def currencies(self) -> tuple[str, ...]:
        """Of all prices; amounts in different ones cannot be compared."""
        priced = [brief.currency for brief in self.briefs if brief.cost is not None]
        return tuple(dict.fromkeys(priced or [self.result.study.bases[0].currency]))


@dataclass(frozen=True, slots=True)
class HeatMap(Record):
    """Least cost of a meeting case over two factors [y][x]; None where no case meets.

    payload: of that case.  cells: what is known of each [y][x].  undecided: cells in which a case
    got no verdict, also such as have a cost.
    """

    x: str
    y: str
    currency: str
    x_values: tuple[str, ...]
    y_values: tuple[str, ...]
    least_cost: tuple[tuple[float | None, ...], ...]
    payload: tuple[tuple[str, ...], ...]
    undecided: int | None = optional()
    cells: tuple[tuple[CellWord, ...], ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Winner(RolePick):
    """One option of a role: in how many of how many meeting cases it was chosen.

    where: per factor that varies, the values between which it wins.
    """

    cases: int
    of: int
    where: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Miss:
    """One requirement that cases miss, or cannot meet together with others: in how many, and where.

    waived: cases of these in which a waiver in force covers it.
    """

    requirement: str
    cases: int
    waived: int
    where: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Boundary(Record):
    """Along one factor, everything else fixed: neighbours of which one meets and one does not.

    why: the verdict at the value that misses.
    """

    factor: str
    met: str
    missed: str
    fixed: Mapping[str, str]
    why: CaseWord


def summarise(result: Finished) -> StudySummary:
    """One pass over all cases."""
    briefs: list[Brief] = []
    fronts: dict[tuple[tuple[CasePoint, ...], str], list[int]] = {}
    accuracy = None
    missed: dict[str, list[RequirementResult]] = {}
    for case in result.cases():
        briefs.append(_brief(case))
        for row in case.record.requirements:
            if row.id in briefs[-1].failing:
                alike = missed.setdefault(row.id, [])
                if all(row.waiver != one.waiver for one in alike):
                    alike.append(row)
        asked = (row for row in case.record.requirements if row.kind == "accuracy")
        accuracy = accuracy or next(asked, None)
        points = case.record.front
        key = (points, case.currency)
        if points and (key in fronts or len(fronts) < MOST_FRONTS):
            fronts.setdefault(key, []).append(case.number)
    found = (
        StudyFront(tuple(cases), currency, points) for (points, currency), cases in fronts.items()
    )
    return StudySummary(result, tuple(briefs), tuple(found), accuracy, missed)


def _brief(case: CaseResult) -> Brief:
    record = case.record
    return Brief(
        case.number, case.base, tuple(case.labels.values()), record.verdict, record.cost,
        case.currency, record.error_m, tuple(record.picks), record.failing, record.waived,
        record.excused, record.unsettled,
    )  # fmt: skip


def varied(summary: StudySummary) -> list[tuple[int, Factor]]:
    """Factors with more than one value, and their place among all factors."""
    factors = summary.result.study.factors
    return [(i, f) for i, f in enumerate(factors) if len(set(f.axis)) > 1]


def heat_map(summary: StudySummary) -> HeatMap | None:
    """The study's heat map: the factors it names, else its first two, those of the grid first.

    None where a cell of it was never computed, as between the points of a sample: an empty cell
    would read as one that nothing meets (`scatter` shows such a study).  None too where prices are
    in different currencies: the least of them is not known.
    """
    study = summary.result.study
    if len(summary.currencies) > 1:
        return None
    if study.heat_map is not None:
        named = {f.key: f for f in study.factors}
        chosen = [named[study.heat_map.x], named[study.heat_map.y]]
    else:
        several = sorted((f for _, f in varied(summary)), key=lambda f: f.origin != "grid")
        chosen = [f for f in several if len(f.axis) <= MOST_CELLS][:2]
        if len(chosen) < 2:  # of more values, which are drawn without signs
            chosen = [f for f in several if len(f.axis) <= _most_values(f)][:2]
    if len(chosen) < 2 or any(len(f.axis) > _most_values(f) for f in chosen):
        return None
    x, y = chosen
    return _filled(summary, x, y) if _covered(summary, x, y) else None


def _most_values(factor: Factor) -> int:
    """Along an axis of a map; many drawn values are told better by points where they lie."""
    return MOST_FINE if factor.origin == "grid" else MOST_CELLS


def _covered(summary: StudySummary, x: Factor, y: Factor) -> bool:
    """Whether every combination of the two factors' values was computed."""
    factors = summary.result.study.factors
    across, up = factors.index(x), factors.index(y)
    computed = {(brief.labels[across], brief.labels[up]) for brief in summary.briefs}
    return len(computed) == len(x.axis) * len(y.axis)


def _filled(summary: StudySummary, x: Factor, y: Factor) -> HeatMap:
    factors = summary.result.study.factors
    across, up = factors.index(x), factors.index(y)
    best: dict[tuple[str, str], Brief] = {}
    for brief in summary.briefs:
        if brief.meets and brief.cost is not None:
            cell = (brief.labels[across], brief.labels[up])
            held = best.get(cell)
            if held is None or brief.cost < (held.cost or 0.0):
                best[cell] = brief
    words: dict[tuple[str, str], set[CaseWord]] = {}
    for brief in summary.briefs:
        words.setdefault((brief.labels[across], brief.labels[up]), set()).add(brief.verdict)
    columns, rows = x.axis, y.axis
    found = [[best.get((column, row)) for column in columns] for row in rows]
    return HeatMap(
        x.key, y.key, summary.currencies[0], columns, rows,
        tuple(tuple(None if b is None else b.cost for b in row) for row in found),
        tuple(tuple("" if b is None else payload(b) for b in row) for row in found),
        sum("indeterminate" in one for one in words.values()) or None,
        tuple(tuple(_cell_word(best.get((column, row)), words[column, row]) for column in columns)
              for row in rows),
    )  # fmt: skip


def _cell_word(best: Brief | None, words: set[CaseWord]) -> CellWord:
    """What is known of a cell: words of its cases; best: the cheapest that meets."""
    if best is not None:
        return "waived" if best.waived else "meets"
    if "indeterminate" in words:
        return "undecided"
    return "refused" if words == {"refused"} else "none"


def payload(brief: Brief) -> str:
    """The sensors of a case in a line."""
    return ", ".join(pick.name for pick in brief.picks)


def winners(summary: StudySummary, show: Shown = lambda _, label: label) -> list[Winner]:
    """Options that a meeting case chose, most frequent first within each role.

    show: how a value of a factor is written; as it is listed where nothing is given.
    """
    meeting = [brief for brief in summary.briefs if brief.meets]
    held: dict[RolePick, list[Brief]] = {}
    for brief in meeting:
        for pick in brief.picks:
            held.setdefault(pick, []).append(brief)
    several = varied(summary)
    roles = list(dict.fromkeys(pick.role for pick in held))
    order = sorted(held, key=lambda p: (roles.index(p.role), -len(held[p]), p.sensor))
    return [_winner(pick, held[pick], meeting, several, show) for pick in order]


def _winner(
    pick: RolePick, choosing: list[Brief], meeting: list[Brief], several: list[tuple[int, Factor]],
    show: Shown,
) -> Winner:  # fmt: skip
    """choosing: the meeting cases that chose it."""
    having = sum(any(p.role == pick.role for p in brief.picks) for brief in meeting)
    where = tuple(_extent(one, {b.labels[i] for b in choosing}, show) for i, one in several)
    return Winner(
        pick.role, pick.sensor, pick.name, pick.timestamping, len(choosing), having, where
    )


def misses(summary: StudySummary, show: Shown = lambda _, label: label) -> list[Miss]:
    """Requirements that cases miss, most frequent first."""
    several = varied(summary)
    found = []
    for name in summary.missed:
        failing = [brief for brief in summary.briefs if name in brief.failing]
        where = tuple(_extent(one, {b.labels[i] for b in failing}, show) for i, one in several)
        waived = sum(name in brief.excused for brief in failing)
        found.append(Miss(name, len(failing), waived, where))
    return sorted(found, key=lambda one: -one.cases)


def _extent(factor: Factor, present: set[str], show: Shown) -> str:
    """`40 m to 80 m`, `everywhere`, or the values one by one."""
    ordered = [text for text in factor.axis if text in present]
    if len(ordered) == len(factor.axis):
        return "everywhere"
    if factor.is_of_figures and len(ordered) > 2:
        return f"{show(factor, ordered[0])} to {show(factor, ordered[-1])}"
    shown = ", ".join(show(factor, text) for text in ordered[:6])
    return shown + (", ..." if len(ordered) > 6 else "")


def boundaries(summary: StudySummary) -> list[Boundary]:
    """Where feasibility ends: along every grid factor of figures, with all the others fixed."""
    study = summary.result.study
    found: list[Boundary] = []
    for place, factor in varied(summary):
        if factor.origin != "grid" or not factor.is_of_figures:
            continue
        lines: dict[Any, dict[str, Brief]] = {}
        for brief in summary.briefs:
            others = brief.labels[:place] + brief.labels[place + 1 :]
            drawn = brief.number % study.samples if study.samples > 1 else 0
            lines.setdefault((brief.base, others, drawn), {})[brief.labels[place]] = brief
        order = factor.axis
        for (base, others, _), line in lines.items():
            found += _flips(summary, factor, [line[v] for v in order if v in line], base, others)
    return found


def _flips(
    summary: StudySummary, factor: Factor, line: Sequence[Brief], base: int, others: tuple[str, ...]
) -> Iterator[Boundary]:
    result = summary.result
    keys = [f.key for f in result.study.factors if f.key != factor.key]
    several = {f.key for _, f in varied(summary)}
    fixed = [(key, value) for key, value in zip(keys, others, strict=True) if key in several]
    if len(result.study.bases) > 1:
        fixed.insert(0, ("base", result.study.bases[base].name))
    place = result.study.factors.index(factor)
    for one, other in pairwise(line):
        if one.meets != other.meets and "indeterminate" not in (one.verdict, other.verdict):
            met, missed = (one, other) if one.meets else (other, one)
            yield Boundary(
                factor.key, met.labels[place], missed.labels[place], dict(fixed), missed.verdict
            )
