"""Figures of the pages: parts sum to the price, datasheet figures read as they were written."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from html_page import Page
from syncline_design.loading import load_text
from syncline_design.optimisation import (
    OptimizeSettings,
    optimisation_json,
    optimisation_text,
    optimize,
)
from syncline_design.report.optimisations import render_optimize
from syncline_design.report.pages import render_verdict
from syncline_design.verify import CheckSettings, check_file

ROOT = Path(__file__).parent.parent
PLAIN = CheckSettings(monte_carlo=False)
MULTIROTOR = ROOT / "specs" / "multirotor_inspection.yaml"
# What a unit is worth in SI, from the SI brochure, and not by the product's own table.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "deg": math.pi / 180.0, "mdeg": math.pi / 180e3}


@pytest.mark.parametrize("name", ["car_mapping", "rov_relay", "subsea_survey_small_sv"])
def test_the_costs_on_the_page_sum_to_the_price(name: str) -> None:
    """Every role, every shared piece and every clock: to the cent."""
    verdict = check_file(ROOT / "specs" / f"{name}.yaml", PLAIN)
    assert any(clock["cost"] for clock in verdict["design"]["clocks"])
    cells: list[str] = []
    text = render_verdict(verdict)
    for caption in ("Payload and timestamping", "Shared hardware and clocks"):
        tables = re.findall(r"<table.*?</table>", text, re.DOTALL)
        [found] = [one for one in tables if caption in one.partition("</caption>")[0]]
        body = found.partition("<tbody>")[2]
        amounts = re.findall(r"<bdi>([\d\u00a0.]+)\u00a0EUR</bdi>", body)
        assert body.count("<tr>") == len(amounts), "a row without a cost"
        cells += amounts
    total = sum(float(cell.replace("\u00a0", "")) for cell in cells)
    assert total == pytest.approx(verdict["design"]["cost"], abs=0.005)


@pytest.mark.parametrize("method", ["front", "milp", "enumerate"])
def test_the_page_says_in_words_how_the_choice_was_proven(method: Any) -> None:
    words = {"front": "Pareto front", "milp": "integer program", "enumerate": "enumeration of all"}
    verdict = check_file(MULTIROTOR, CheckSettings(method=method, monte_carlo=False))
    assert verdict["choice"]["proof"]["method"] == method
    sentence = re.search(r"Found by [^<]*", Page(render_verdict(verdict)).text)
    assert sentence is not None
    assert words[method] in sentence[0]
    assert "enumerate" not in sentence[0]
    assert "milp" not in sentence[0]


def test_a_datasheet_figure_reads_as_it_was_written() -> None:
    loaded = load_text(MULTIROTOR.read_text("utf-8"), MULTIROTOR)
    found = optimize(loaded, OptimizeSettings())
    entries = optimisation_json(found)["measure_next"]
    assert {entry["value_text"] for entry in entries} >= {"2 cm", "0.2 deg"}
    console, page = optimisation_text(found), Page(render_optimize("html", found)).text
    for entry in entries:
        for key in ("value", "at"):
            number, unit = entry[f"{key}_text"].split(" ")
            assert float(number) * UNITS[unit] == pytest.approx(entry[key], rel=5e-4)
            assert unit == entry["value_text"].split(" ")[1]
            assert entry[f"{key}_text"] in page
            assert entry[f"{key}_text"] in console
    assert "Figure (SI)" not in page


@pytest.mark.parametrize(
    ("written", "value_si", "shown"),
    [
        ("0.05 deg", 0.05 * math.pi / 180.0, "0.05 deg"),
        ("50 mdeg +/- 20 %", 0.04 * math.pi / 180.0, "40 mdeg"),
        ("0.8 cm .. 1.2 cm", 0.008, "0.8 cm"),
        ("1 cm +/- 2 mm", 0.012, "1.2 cm"),
        ("0.0008727 rad", 0.00069816, "0.0006982 rad"),
        ("3", 2.4, "2.4"),
    ],
)
def test_a_figure_in_the_unit_of_another(written: str, value_si: float, shown: str) -> None:
    from syncline_design.units import format_like

    assert format_like(written, value_si) == shown
