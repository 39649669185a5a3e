"""Symbols of cells in narrow tables."""

from __future__ import annotations

from syncline_design.report.console_table import fitted
from syncline_design.report.table import Cell, table


def test_a_symbol_stays_with_its_first_word() -> None:
    rows = [[Cell("10", 10, mark="+"), "a file of a name that needs all the room there is"]]
    lines = [line.rstrip() for line in fitted(table("", ("Run", "File"), rows), 30)]
    assert any(line.startswith("+ 10") for line in lines), lines
