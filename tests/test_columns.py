"""Figures of a column: same place in one unit, same digits else, never another value."""

from __future__ import annotations

import random
import re
from decimal import ROUND_HALF_EVEN, Decimal
from types import SimpleNamespace

import pytest

from syncline_design.report import numbers
from syncline_design.report.columns import alike, errors, padded, worded
from syncline_design.report.table import Cell, table

METRES = SimpleNamespace(limit=0.3, unit="m", limit_written="0.30 m")
TO_METRES = {"m": 0, "mm": -3, "\N{MICRO SIGN}m": -6, "nm": -9, "km": 3}


def _spaced(texts: list[str]) -> list[str]:
    return [text.replace("\N{NO-BREAK SPACE}", " ") for text in texts]


@pytest.mark.parametrize(
    ("column", "shown"),
    [
        ([("1 cm", 0.01), ("1.414 cm", 0.0141421)], ["1.000 cm", "1.414 cm"]),
        ([("0.02 m", 0.02), ("0.01732 m", 0.0173205)], ["0.02000 m", "0.01732 m"]),
        ([("291 mm", 0.29096), ("290.9 mm", 0.29088)], ["291.0 mm", "290.9 mm"]),
        # a hundred times larger: the small one keeps its digits, the large one gets no more
        ([("2.5 m", 2.5), ("0.01732 m", 0.0173205)], ["2.500 m", "0.01732 m"]),
        # units differ: as many digits
        ([("10 ns", 1e-8), ("24.16 us", 2.416e-5)], ["10.00 ns", "24.16 us"]),
        ([("12 us", 1.2e-5), ("10 ns", 1e-8)], ["12 us", "10 ns"]),
        # what adds up has one unit
        ([("12 g", 0.012), ("2.21 kg", 2.21), ("0 kg", 0.0)], ["0.012 kg", "2.210 kg", "0 kg"]),
        # nothing has no digits to be compared by; an amount of money goes to the cent all the same
        ([("12 g", 0.012), ("0 kg", 0.0)], ["12 g", "0 g"]),
        ([("0 W", 0.0), ("1.6 W", 1.6), ("12 W", 12.0)], ["0 W", "1.6 W", "12.0 W"]),
        ([("0 EUR", 0.0), ("1.50 EUR", 1.5)], ["0.00 EUR", "1.50 EUR"]),
        ([("500 mW", 0.5), ("12.25 W", 12.25)], ["0.50 W", "12.25 W"]),
        # money to the cent or to the whole, whatever its size
        ([("900 EUR", 900.0), ("59 862.35 EUR", 59862.35)], ["900.00 EUR", "59 862.35 EUR"]),
        ([("9 000 EUR", 9000.0), ("400 EUR", 400.0)], ["9 000 EUR", "400 EUR"]),
        ([("91.6 %", 0.91556), ("8.35 %", 0.0835)], ["91.56 %", "8.35 %"]),
        # of two dimensions each by itself; what is no figure, or has no value, as it is
        ([("0.2945 m", 0.2945), ("2 kg", 2.0), ("0.9", 0.9)], ["0.2945 m", "2 kg", "0.9"]),
        ([("1 cm", None), ("1.414 cm", 0.0141421), ("?", None)], ["1 cm", "1.414 cm", "?"]),
        ([("0.3 m to 1 m", 0.3), ("1.414 m", 1.414)], ["0.3 m to 1 m", "1.414 m"]),
        ([("1 m", 7.0), ("1.414 m", 1.414)], ["1 m", "1.414 m"]),  # not that value
        ([("\u22121 mm", -0.001), ("0.5 mm", 5e-4)], ["\u22121.0 mm", "0.5 mm"]),
    ],
)  # fmt: skip
def test_a_column(column: list[tuple[str, float | None]], shown: list[str]) -> None:
    typeset = [(numbers.typeset(text), value) for text, value in column]
    assert _spaced(alike(typeset)) == [text.replace(" us", " \N{MICRO SIGN}s") for text in shown]


def test_a_column_of_any_lengths_keeps_every_value() -> None:
    """Against decimal arithmetic: what is shown is the value rounded to the place shown."""
    drawn = random.Random(19)
    for _ in range(400):
        values = [10.0 ** drawn.uniform(-5, 3) for _ in range(drawn.randint(1, 6))]
        before = [numbers.length(value) for value in values]
        after = _spaced(alike(list(zip(before, values, strict=True))))
        places: dict[str, set[int]] = {}
        for value, text, old in zip(values, after, _spaced(before), strict=True):
            number, unit = text.split()
            exact = Decimal(value).scaleb(-TO_METRES[unit])
            assert Decimal(number) == exact.quantize(Decimal(number), ROUND_HALF_EVEN)
            assert unit == old.split()[1]
            places.setdefault(unit, set()).add(len(number.partition(".")[2]))
            assert len(number.replace(".", "").lstrip("0")) <= 5
        if len(places) == 1:
            sizes = [Decimal(text.split()[0]) for text in after]
            if max(sizes) < 10 * min(sizes):
                assert all(len(found) == 1 for found in places.values())


def test_a_table_keeps_what_someone_wrote_and_aligns_the_rest() -> None:
    rows = [
        ("a", Cell("1\u00a0cm", 0.01), Cell("0.3\u00a0m", 0.3, written=True)),
        ("b", Cell("1.414\u00a0cm", 0.0141421), Cell("0.25\u00a0m", 0.25, written=True)),
    ]
    shown = table("T", ("Name", "Value #", "Limit #"), rows)
    assert [row[1].text for row in shown.rows] == ["1.000\u00a0cm", "1.414\u00a0cm"]
    assert [row[2].text for row in shown.rows] == ["0.3\u00a0m", "0.25\u00a0m"]


def test_texts_alone_get_back_the_zeros_that_they_lost() -> None:
    """Rounded to three digits: a tenth is 10.0 %, which is all that is known of it."""
    shown = [0.0369, 0.1, 0.45, 0.989]
    texts = padded([numbers.percent(share) for share in shown])
    assert _spaced(texts) == [f"{100.0 * share:#.3g} %" for share in shown]
    assert _spaced(padded(["900\u00a0EUR", "12\u00a0862.35\u00a0EUR"])) == [
        "900.00 EUR", "12 862.35 EUR",
    ]  # fmt: skip
    assert _spaced(padded(["10\u00a0%", "95\u00a0%", "a", ""])) == ["10 %", "95 %", "a", ""]


@pytest.mark.parametrize(
    ("column", "shown"),
    [
        (["7.9 % to spare", "1.82 % to spare", "10.5 % over", "-"],
         ["7.90 % to spare", "1.82 % to spare", "10.5 % over", "-"]),
        (["0.3266 m to 0.332 m", "12 mm to 13.25 mm"],
         ["0.3266 m to 0.3320 m", "12.00 mm to 13.25 mm"]),
        (["0.5 m to 1 m"], ["0.5 m to 1 m"]),
        # no figures alone: as they are
        (["exactly at the limit", "1.82 % to spare"], ["exactly at the limit", "1.82 % to spare"]),
        (["from 5 m to 7.25 m", "7.9 % to go", "1 m to 2 m to 3.25 m"],
         ["from 5 m to 7.25 m", "7.9 % to go", "1 m to 2 m to 3.25 m"]),
    ],
)  # fmt: skip
def test_figures_with_words_stand_with_as_many_digits(column: list[str], shown: list[str]) -> None:
    typeset = [re.sub(r"(?<=\d) ", "\N{NO-BREAK SPACE}", text) for text in column]
    assert _spaced(worded(typeset)) == shown


def test_a_table_aligns_its_margins() -> None:
    rows = [(Cell(numbers.typeset("7.9 %") + " to spare", 0.079),),
            (Cell(numbers.typeset("1.82 %") + " to spare", 0.0182),)]  # fmt: skip
    found = table("Requirements", ("Margin #",), rows)
    assert _spaced([row[0].text for row in found.rows]) == ["7.90 % to spare", "1.82 % to spare"]


def test_errors_beside_a_limit_are_in_its_unit_to_the_same_place() -> None:
    assert _spaced(errors([0.2, 0.0173205, 0.2173205], METRES)) == [
        "0.20000 m", "0.01732 m", "0.21732 m",
    ]  # fmt: skip
    assert _spaced(errors([0.2829, 0.0005074], METRES)) == ["0.2829 m", "0.0005074 m"]
