"""A sheet of calculation: lines of arithmetic whose values are what the arithmetic gives.

What is printed and what is computed cannot differ: the value of a line is found by working out its
own text, whose names are earlier lines.
"""

from __future__ import annotations

import ast
import itertools
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import rounded
from syncline_design.model.system import ShareCurve, System
from syncline_design.verdict.named import ExplainedStep

PI = repr(math.pi)
_BRACKETED = re.compile(r"^\((-[0-9.e+-]+)\)$")  # a number alone needs none
_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "abs": abs, "max": max, "min": min,
}  # fmt: skip
_OPERATORS: Mapping[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow,
    ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip


def number(value: float) -> str:
    """A number as it is calculated with, in full; in brackets where it is negative."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def root_of_squares(values: Iterable[float]) -> str:
    """`sqrt(0.01**2 + 0.02**2)`."""
    return f"sqrt({' + '.join(f'{number(value)}**2' for value in values)})"


def chord(angle: str) -> str:
    """2 sin(a / 2), a at most half a turn."""
    return f"2 * sin(min({angle}, {PI}) / 2)"


def total(terms: Iterable[str]) -> str:
    """A sum in writing, `a + b - c`, 0.0 of nothing."""
    text = " + ".join(terms).replace("+ -", "- ")
    return text or "0.0"


def between_rows(shape: ShareCurve, sigma: float, place: float, name: str) -> str:
    """A table's deviation at a place, from the rows it lies between; outside, from the outermost.

    name: what stands for the place in the line.  The rows are shares of sigma; those on the line
    of both their neighbours (where a distance ends) are none of the table's.
    """
    rows = [(at, rounded(sigma * share, 12)) for at, share in _corners(shape)]
    if not rows:
        return ""
    if not rows[0][0] < place < rows[-1][0]:
        return number(rows[0][1] if place <= rows[0][0] else rows[-1][1])
    (start, low), (end, high) = next(
        pair for pair in itertools.pairwise(rows) if pair[0][0] <= place <= pair[1][0]
    )
    rise, width = f"({number(high)} - {number(low)})", f"({number(end)} - {number(start)})"
    return f"({number(low)} + {rise} * ({name} - {number(start)}) / {width})"


def _corners(shape: ShareCurve) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for row, after in itertools.zip_longest(shape, shape[1:]):
        if found and after is not None:
            (x0, y0), (x1, y1), (x2, y2) = found[-1], row, after
            if math.isclose((y1 - y0) * (x2 - x0), (y2 - y0) * (x1 - x0), rel_tol=1e-9):
                continue
        found.append(row)
    return found


def suffixes(system: System) -> tuple[str, ...]:
    """What lines of each stage end in: its name in letters, digits and underscores."""
    plain = [re.sub(r"[^0-9A-Za-z_]", "_", stage.name) for stage in system.stages]
    if len(set(plain)) == len(plain):
        return tuple(plain)
    return tuple(f"{name}_{place}" for place, name in enumerate(plain, 1))


def worked_out(numbers: str, known: Mapping[str, float]) -> float:
    """The value of a line: numbers, names, + - * / **, and sqrt, sin, cos, abs, max, min."""

    def value(node: Any) -> float:
        match node:
            case ast.Constant(value=float() | int() as given):
                return given
            case ast.Name(id=name):
                return known[name]
            case ast.UnaryOp(op=sign, operand=operand):
                return _OPERATORS[type(sign)](value(operand))
            case ast.BinOp(left=left, op=between, right=right):
                return _OPERATORS[type(between)](value(left), value(right))
            case ast.Call(func=ast.Name(id=name), args=given):
                return _FUNCTIONS[name](*map(value, given))
        raise ValueError(f"no arithmetic: {ast.unparse(node)}")

    return float(value(ast.parse(numbers, mode="eval").body))


@dataclass
class Calculation:
    """Lines in their order, by name; a name that is there already is not written twice."""

    steps: dict[str, ExplainedStep] = field(default_factory=dict)
    known: dict[str, float] = field(default_factory=dict)

    def line(self, name: str, formula: str, numbers: str, unit: str = "m", source: str = "") -> str:
        """One more line, worked out; its name."""
        if name not in self.steps:
            numbers = _BRACKETED.sub(r"\1", numbers)
            value = worked_out(numbers, self.known)
            self.known[name] = value
            self.steps[name] = ExplainedStep(name, formula, numbers, value, unit, source)
        return name

    def given(
        self, name: str, formula: str, value: float, unit: str = "m", source: str = ""
    ) -> str:
        """A line that is a number from elsewhere."""
        return self.line(name, formula, repr(float(value)), unit, source)

    def leading_to(self, last: str, first: Iterable[str] = ()) -> tuple[ExplainedStep, ...]:
        """The lines that the last one is made of, the last one last; first: kept besides."""
        needed, left = {last, *first}, [last, *first]
        while left:
            for name in re.findall(r"[A-Za-z_]\w*", self.steps[left.pop()].numbers):
                if name in self.steps and name not in needed:
                    needed.add(name)
                    left.append(name)
        kept = [step for name, step in self.steps.items() if name in needed and name != last]
        return (*kept, self.steps[last])
