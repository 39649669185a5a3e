"""Figures for people are rounded in one place, alike for every room."""

from __future__ import annotations

import ast
import math
import re
from decimal import ROUND_HALF_EVEN, Context, Decimal
from pathlib import Path

import pytest

from html_page import Page
from syncline_design.model.figure_text import (
    format_nats,
    percent,
    rounded,
    signed,
    to_digits,
    to_places,
)
from syncline_design.model.unit_table import UNITS
from syncline_design.report import numbers
from syncline_design.report.console_table import folded
from syncline_design.report.document import Document, Outcome, Text, section
from syncline_design.report.render_html import html
from syncline_design.report.text import unbroken

PACKAGE = Path(__file__).parent.parent / "syncline_design"
# What formats a float by itself, and why.
OWN = {
    "model/figure_text.py": "the one place",
    "report/numbers.py": "typesets it",
    "machine/arguments.py": "says bounds of arguments; on the floor of the model, beside it",
    "machine/deadline.py": "says a time limit as it was given; beside the model",
    "machine/result_files.py": "the same",
    "clocks/entry.py": "writes a catalog entry that is read again, rounded upwards",
    "spec/edit.py": "writes YAML that is read again",
    "studies/definition.py": "writes values into specs that are read again",
    "report/plans.py": "writes KML",
    "report/on_plan.py": "a heading as three digits, 007",
}
MAYBE = re.compile(r"[eEfFgG%]\}|format\(|%[-+ #0-9.]*[eEfFgG]")  # where a look is worth it
OF_A_FLOAT = re.compile(r"[eEfFgG%]$")


def _formats(tree: ast.AST) -> list[int]:
    """Lines that give a float a format: in an f-string, by `format`, by `%`."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr):
            parts = node.format_spec.values
            last = parts[-1] if parts else None
            if isinstance(last, ast.Constant) and OF_A_FLOAT.search(str(last.value)):
                found.append(node.lineno)
        elif isinstance(node, ast.Call) and _is_format(node):
            found.append(node.lineno)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
            text = node.left.value if isinstance(node.left, ast.Constant) else None
            if isinstance(text, str) and re.search(r"%[-+ #0-9.]*[eEfFgG]", text):
                found.append(node.lineno)
    return found


def _is_format(node: ast.Call) -> bool:
    if isinstance(node.func, ast.Name):
        return node.func.id == "format" and len(node.args) == 2
    is_text = isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Constant)
    return is_text and node.func.attr == "format"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "line", ['f"{x:.3g}"', 'f"{x:,.2f}"', 'f"{x:.{n}e}"', '"%.2f" % x', 'format(x, "g")',
             '"{:.2f}".format(x)', 'f"{x:+g}"', 'f"{x:.1%}"']
)  # fmt: skip
def test_a_format_of_a_float_is_seen(line: str) -> None:
    assert _formats(ast.parse(line)) == [1]


@pytest.mark.parametrize("line", ['f"{n:02d}"', 'f"{text:>9}"', 'f"{x!r}"', "a % b", 'f"{x}"'])
def test_what_is_none_is_not(line: str) -> None:
    assert _formats(ast.parse(line)) == []


def test_no_room_rounds_for_people_by_itself() -> None:
    found = {
        path.relative_to(PACKAGE).as_posix(): lines
        for path in sorted(PACKAGE.rglob("*.py"))
        if MAYBE.search(text := path.read_text("utf-8")) and (lines := _formats(ast.parse(text)))
    }
    assert {name: lines for name, lines in found.items() if name not in OWN} == {}
    assert set(OWN) == set(found)  # an exception that is none any more goes


@pytest.mark.parametrize("value", [0.0, 1.0, -2.5, 1234.5678, 0.00012349, 99995.0, 5e-7, -3.21e12])
@pytest.mark.parametrize("digits", [1, 3, 4, 6])
def test_digits_are_those_of_decimal_arithmetic(value: float, digits: int) -> None:
    exact = Context(prec=digits, rounding=ROUND_HALF_EVEN).create_decimal(Decimal(value))
    text = to_digits(value, digits)
    assert Decimal(text) == exact
    assert rounded(value, digits) == float(exact)
    assert ("e" in text) == (value != 0.0 and not 1e-4 <= abs(float(exact)) < 1e9)
    mantissa = text.partition("e")[0]
    assert not ("." in mantissa and mantissa.endswith(("0", ".")))
    assert signed(value, digits) == ("+" if exact > 0 else "") + text


def test_places_keep_their_zeros_and_shares_their_sign() -> None:
    assert [to_places(2.5, 3), to_places(-0.125, 2)] == ["2.500", "-0.12"]
    assert to_places(2.5, 1, sign=True) == "+2.5"
    assert [percent(0.12345), percent(1.0), percent(-0.5)] == ["12.3 %", "100 %", "-50 %"]
    small = [percent(share) for share in (8.09e-7, 1e-6, 0.0, -8.09e-7)]
    assert small == ["< 0.0001 %", "0.0001 %", "0 %", "> -0.0001 %"]


@pytest.mark.parametrize("text", [to_digits, signed, lambda v: to_places(v, 2)])
def test_what_is_no_number_is_said(text) -> None:  # type: ignore[no-untyped-def]
    said = [text(value) for value in (math.inf, -math.inf, math.nan)]
    assert said == ["unlimited", "-unlimited", "not a number"]


@pytest.mark.parametrize(
    ("amount", "text"),
    [(32000.0, "32 000 EUR"), (412.5, "412.50 EUR"), (0.0, "0 EUR"), (1e6, "1 000 000 EUR")],
)  # fmt: skip
def test_money_has_one_format(amount: float, text: str) -> None:
    assert numbers.money(amount, "EUR") == text.replace(" ", "\N{NO-BREAK SPACE}")


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(13436.04, None, "13 436.0 nat"), (15.46, None, "15.5 nat"), (160_100.0, 3, "160 000 nat"),
     (0.0, 3, "0 nat"), (19.27, 3, "19.3 nat"), (math.inf, 3, "unlimited nat"),
     (1.5e12, 3, "1.5e+12 nat")],
)  # fmt: skip
def test_nats_have_their_thousands_apart(value: float, digits: int | None, text: str) -> None:
    assert format_nats(value, digits) == text


@pytest.mark.parametrize("unit", [*UNITS, "nat", "m/s\u00b2", "\u03c3"])
def test_no_line_ends_between_a_figure_and_its_unit(unit: str) -> None:
    """In every unit that a spec or a page can write, in a page and on the console."""
    told = section("x", "Found", [Text(f"It is up to 12.5 {unit}, 3 rows, `5 {unit}`.")])
    shown = Document("x", Outcome("good", "+", "x"), "x", (), (), tuple(told))
    printed = f"\u00b5{unit[1:]}" if unit.startswith("u") else unit
    assert f"12.5\u00a0{printed}, 3 rows, " in Page(html(shown)).text
    assert f"5 {unit}" in Page(html(shown)).texts  # code is what a program knows
    lines = folded(f"It is up to 12.5 {unit}", 16)
    assert lines == ["It is up to", f"12.5 {unit}"]  # 16 columns: the figure would fit alone


def test_no_line_ends_before_an_uncertainty() -> None:
    assert unbroken("by 1.24 \u00b1 0.12 ms, \u00b1 or so") == (
        "by 1.24\u00a0\u00b1\u00a00.12\u00a0ms, \u00b1 or so"
    )


def test_no_line_ends_inside_a_figure_of_nats() -> None:
    told = unbroken("saves 13 436.0 nat; 3 000 rows, 2026 100 was 12 of 1000")
    assert told.replace("\u00a0", "_") == "saves 13_436.0_nat; 3_000 rows, 2026_100 was 12 of 1000"


def test_two_moments_are_told_apart_however_late_they_are() -> None:
    """To a hundredth of what lies between them, in figures that are read back."""
    from_to = numbers.from_to
    for begun, lasts in ((0.0, 43.5), (51203.37, 21.42), (345600.5, 0.83), (12.0, 0.004)):
        ends = from_to(begun, begun + lasts).replace("\u00a0", "").split(" to ")
        read = [float(end.removesuffix("s")) for end in ends]
        assert read[1] - read[0] == pytest.approx(lasts, rel=0.02)
    assert from_to(120.0, 130.0).replace("\u00a0", " ") == "120 s to 130 s"
