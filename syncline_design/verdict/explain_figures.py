"""A figure of the error worked out by hand, in the situation in which it is largest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from syncline_design.model.figure_text import to_digits
from syncline_design.model.system import System
from syncline_design.simulation.composition import Composition, composition
from syncline_design.simulation.statistical import AXES, Wanted, Worst
from syncline_design.spec.requirement import DistanceLimit, Requirement
from syncline_design.verdict.explain_certificate import certificate
from syncline_design.verdict.explain_shared import Worked
from syncline_design.verdict.explain_sheet import Calculation, number, total
from syncline_design.verdict.explain_situation import AxisLines, moved_by
from syncline_design.verdict.named import ExplainedStep
from syncline_design.verdict.stated import Certified, moved, stated, wanted_of
from syncline_design.verdict.tree import RequirementResult

_NAMES = ("north", "east", "down")


def figure_steps(worked: Worked, row: RequirementResult) -> Iterator[ExplainedStep]:
    """Worst case, THU, TVU, root mean square or quantile; a limit by distance first."""
    requirement = worked.asked[row.id]
    wanted, limit = wanted_of(requirement), float(requirement.limit)
    found = stated(worked.system, wanted, limit, worked.seed)
    yield from limit_steps(requirement, found.distance_m)
    if isinstance(wanted, Certified):
        far = wanted.rule is None
        system = worked.system if far else moved(worked.system, found.distance_m)
        yield from certificate(worked, system, _plain(row.id))
    elif found.worst is not None:
        yield from statistical(worked, worked.system, found.worst, _plain(row.id))


def _plain(name: str) -> str:
    """A requirement's id as the name of a line: `TVU-1` would be a difference."""
    return "".join(one if one.isascii() and one.isalnum() else "_" for one in f"value_{name}")


def limit_steps(requirement: Requirement, distance_m: float) -> Iterator[ExplainedStep]:
    """sqrt(a^2 + (b d)^2), where the limit is one by distance."""
    if not isinstance(requirement.limit, DistanceLimit):
        return
    a, b, of = requirement.limit.rule
    d = distance_m if of is None else float(of)
    formula = "limit, sqrt(a^2 + (b d)^2)" + (
        ", d where the figure is the largest share of it" if of is None else ", d = of"
    )
    numbers = f"sqrt({number(a)}**2 + ({number(b)} * {number(d)})**2)"
    value = math.hypot(float(a), float(b) * d)
    yield ExplainedStep(_plain(f"limit_{requirement.id}"), formula, numbers, value, "m")


def statistical(
    worked: Worked, system: System, worst: Worst, last: str
) -> tuple[ExplainedStep, ...]:
    """A root mean square or a quantile at its worst situation, by the law of propagation.

    Mean m and covariance C of the error to first order, C = sum of c c' over independent sources
    (JCGM 100:2008, 5.1.2); the quantile by three moments (Imhof, Biometrika 48, 1961, after
    Pearson), c_r = tr C^r + r m' C^(r-1) m, h = c2^3 / c3^2,
    Q^2 = c1 + (chi2 - h) sqrt(c2 / h), chi2 the quantile of h degrees of freedom.
    """
    sheet, found = Calculation(), composition(system, worst.point)
    axes = range(3)[AXES[worst.wanted.axis]]
    mean, columns = moved_by(sheet, worked, system, found)
    if worst.wanted.p is None:
        _root_mean_square(sheet, (mean, columns), axes, worst, last)
    else:
        moments = _three_moments(sheet, (mean, columns), axes)
        _quantile(sheet, moments, found, worst, last)
    return sheet.leading_to(last)


def _root_mean_square(
    sheet: Calculation,
    moved: tuple[AxisLines, Sequence[AxisLines]],
    axes: range,
    worst: Worst,
    last: str,
) -> None:
    mean, columns = moved
    for axis in axes:
        _mean_line(sheet, mean, axis)
        _variance(sheet, columns, axis, axis)
    first = sheet.line(
        "first_order", "root of mean^2 + variance over the axes",
        f"sqrt({total([*(f'{_mean(k)}**2' for k in axes), *(_cov(k, k) for k in axes)])})",
    )  # fmt: skip
    times = worst.value_m / sheet.known[first] if sheet.known[first] else 1.0
    beyond = sheet.given(
        "beyond", "exact over first order: what shifts do that turn a vehicle while they last",
        times, "1",
    )  # fmt: skip
    sheet.line(last, "first order x beyond", f"{first} * {beyond}")


def _mean(axis: int) -> str:
    return f"mean_{_NAMES[axis][0]}"


def _cov(one: int, other: int) -> str:
    first, second = sorted((one, other))
    return f"C_{_NAMES[first][0]}{_NAMES[second][0]}"


def _mean_line(sheet: Calculation, mean: AxisLines, axis: int) -> None:
    sheet.line(_mean(axis), f"mean error {_NAMES[axis]}: what is late on average, and effects",
               mean[axis])  # fmt: skip


def _variance(sheet: Calculation, columns: Sequence[AxisLines], one: int, other: int) -> str:
    """An entry of C: the sum over sources of what each does along both axes."""
    if one == other:
        terms = [f"{column[one]}**2" for column in columns if column[one]]
        formula = f"variance {_NAMES[one]}: sum of squares"
    else:
        terms = [f"{column[one]} * {column[other]}" for column in columns
                 if column[one] and column[other]]  # fmt: skip
        formula = f"covariance {_NAMES[one]}, {_NAMES[other]}: sum of products"
    return sheet.line(_cov(one, other), formula, total(terms), "m^2")


def _three_moments(
    sheet: Calculation, moved: tuple[AxisLines, Sequence[AxisLines]], axes: range
) -> tuple[str, str, str]:
    """c1, c2, c3 of |P e|^2."""
    mean, columns = moved
    for axis in axes:
        _mean_line(sheet, mean, axis)
    pairs = [(i, j) for i in axes for j in axes if i <= j]
    for i, j in pairs:
        _variance(sheet, columns, i, j)
    for i in axes:
        terms = [f"{_cov(i, j)} * {_mean(j)}" for j in axes]
        sheet.line(f"Cm_{_NAMES[i][0]}", f"C m, {_NAMES[i]}", total(terms), "m^3")
    along = total([f"{_mean(i)} * Cm_{_NAMES[i][0]}" for i in axes])
    square = total([f"Cm_{_NAMES[i][0]}**2" for i in axes])
    first = [*(_cov(i, i) for i in axes), *(f"{_mean(i)}**2" for i in axes)]
    second = [f"{'' if i == j else '2 * '}{_cov(i, j)}**2" for i, j in pairs]
    return (
        sheet.line("c1", "tr C + m'm", total(first), "m^2"),
        sheet.line("c2", "tr C^2 + 2 m'C m", f"{total(second)} + 2 * ({along})", "m^4"),
        sheet.line("c3", "tr C^3 + 3 |C m|^2", f"{_cubes(axes)} + 3 * ({square})", "m^6"),
    )


def _cubes(axes: range) -> str:
    """tr C^3 of a symmetric matrix."""
    terms = [f"{_cov(i, i)}**3" for i in axes]
    terms += [
        f"3 * {_cov(i, j)}**2 * ({_cov(i, i)} + {_cov(j, j)})" for i in axes for j in axes if i < j
    ]
    if len(axes) == 3:
        terms.append("6 * C_ne * C_nd * C_ed")
    return total(terms)


def _quantile(
    sheet: Calculation, moments: tuple[str, str, str], found: Composition, worst: Worst, last: str
) -> None:
    c1, c2, c3 = moments
    p, known = worst.wanted.p or 0.0, sheet.known
    if not known[c2] > 0.0 or not known[c3] > 0.0:  # no scatter to first order
        first = sheet.line("first_order", "length of the mean error", f"sqrt({c1})")
    else:
        h = sheet.line("h", "c2^3 / c3^2, degrees of freedom", f"{c2}**3 / {c3}**2", "1")
        about = f"{to_digits(p)} quantile of chi-square of h degrees of freedom (table)"
        chi2 = sheet.given("chi2", about, _chi_square(known[h], p), "1")
        first = sheet.line("first_order", "sqrt(c1 + (chi2 - h) sqrt(c2 / h))",
                           f"sqrt(max({c1} + ({chi2} - {h}) * sqrt({c2} / {h}), 0.0))")  # fmt: skip
    exactly = _by_table(found, worst.wanted)
    if not known[first] > 0.0 or not exactly > 0.0:
        sheet.given(last, "the exact law of the error: no such error", worst.value_m)
        return
    beyond = sheet.given(
        "beyond", "the same of the exact mean and covariance, over first order: what shifts do "
        "that turn a vehicle while they last", exactly / known[first], "1",
    )  # fmt: skip
    shape = sheet.given(
        "shape", "exact quantile over three moments: uniform and one-sided timestamps have no "
        "normal tails", worst.value_m / exactly, "1",
    )  # fmt: skip
    sheet.line(last, "first order x beyond x shape", f"{first} * {beyond} * {shape}")


def _by_table(found: Composition, wanted: Wanted) -> float:
    """The three moments' quantile of the exact mean and covariance [m]."""
    m, c = found.mean_m[AXES[wanted.axis]], found.covariance_m2[AXES[wanted.axis]]
    c = c[:, AXES[wanted.axis]]
    c_m, square = c @ m, c @ c
    c1 = float(c.trace() + m @ m)
    c2 = float(square.trace() + 2.0 * (m @ c_m))
    c3 = float((square @ c).trace() + 3.0 * (c_m @ c_m))
    if not c2 > 0.0 or not c3 > 0.0:
        return math.sqrt(max(c1, 0.0))
    h = c2 * (c2 / c3) ** 2
    more = (_chi_square(h, wanted.p or 0.0) - h) * math.sqrt(c2 / h)
    return math.sqrt(max(c1 + more, 0.0))


def _chi_square(freedom: float, p: float) -> float:
    """The p-quantile of chi-square with any number of degrees of freedom."""
    from scipy.special import gammaincinv  # late: a tenth of a second

    return 2.0 * float(gammaincinv(0.5 * freedom, p))
