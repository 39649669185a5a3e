"""The bill of materials: every piece once, and sums that are the design's totals to the cent.

The oracle reads the shipped catalogs with PyYAML and adds in decimals; of the verdict it takes only
which entries were chosen.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from decimal import ROUND_FLOOR, Decimal
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import read_catalog
from syncline_design.report.checks import render_checks
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.spec.load import load_text
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPECS = sorted((Path(__file__).parent.parent / "specs").glob("*.yaml"))
QUIET = CheckSettings(monte_carlo=False)
SCALE = {"g": Decimal("0.001"), "kg": Decimal(1), "mW": Decimal("0.001"), "W": Decimal(1)}


def checked(text: str) -> Verdict:
    return check_loaded(load_text(text, "specs/spec.yaml"), QUIET)


def cents(amount: Decimal) -> Decimal:
    """Halves go up."""
    return ((amount * 100 + Decimal("0.5")).to_integral_value(ROUND_FLOOR)) / 100


def pieces(verdict: Verdict, spec: dict[str, Any]) -> Counter[tuple[str, str, str]]:
    """(stage or vehicle, section, entry) of all that is bought, with how often."""
    catalog, found = read_catalog(families=True), Counter[tuple[str, str, str]]()
    channels: Counter[tuple[str, str]] = Counter()
    design = verdict.design
    assert design is not None
    vehicle_of = {stage["name"]: stage.get("vehicle", stage["name"]) for stage in spec["stages"]}
    for stage in design.stages:
        for role in stage.roles.values():
            found[stage.name, "sensors", role.sensor] += 1
            found[stage.name, "timestamping", role.timestamping] += 1
            for item, count in (
                catalog["timestamping"][role.timestamping].get("requires", {}).items()
            ):
                channels[vehicle_of[stage.name], item] += count
    for clock in design.clocks:
        found[clock.vehicle, "clocks", clock.id] += 1
        for item, count in catalog["clocks"][clock.id].get("requires", {}).items():
            channels[clock.vehicle, item] += count
    for (vehicle, item), count in channels.items():
        found[vehicle, "infrastructure", item] += -(
            -count // catalog["infrastructure"][item]["channels"]
        )
    return found


def amount(entry: dict[str, Any], key: str, rates: dict[str, str]) -> Decimal:
    figure = entry[key]["value"] if isinstance(entry[key], dict) else entry[key]
    number, unit = str(figure).split(" ")
    if key != "cost":
        return Decimal(number) * SCALE[unit]
    return Decimal(number) * Decimal(rates.get(unit, "1"))


@pytest.mark.parametrize("path", SPECS, ids=lambda p: p.stem)
@pytest.mark.parametrize("dollar", [None, "0.9173"])
def test_lines_are_the_catalogs_entries_and_add_up(path: Path, dollar: str | None) -> None:
    """In the spec's currency, and where every price is converted from another one."""
    text, rates = path.read_text("utf-8"), {}
    spec = yaml.safe_load(text)
    if "catalogs" in spec or spec.get("currency", "EUR") != "EUR":
        pytest.skip("names catalogs of its own")
    if dollar:
        limits = re.compile(r"(kind: cost, limit: )([\d.]+) EUR")
        text = limits.sub(lambda m: f"{m[1]}{2 * float(m[2]):g} USD", text)
        text = re.sub(r"^currency:.*\n", "", text, flags=re.MULTILINE)
        text += f"\ncurrency: USD\nexchange_rates: {{EUR: {dollar} USD}}\n"
        rates = {"EUR": dollar}
    verdict = checked(text)
    if verdict.design is None:
        assert verdict.bill_of_materials is None
        return
    lines = verdict.bill_of_materials
    assert lines is not None
    catalog, bought = read_catalog(families=True), pieces(verdict, spec)
    assert sum(bought.values()) == sum(line.quantity for line in lines)
    expected: Counter[tuple[str, str, Decimal]] = Counter()
    for (stage, section, entry), count in bought.items():
        unit = amount(catalog[section][entry], "cost", rates)
        if section == "infrastructure":
            expected[stage, entry, cents(unit * count)] += 1
        else:
            expected[stage, entry, cents(unit)] += count
    assert expected == Counter((li.stage, li.entry, Decimal(repr(li.cost))) for li in lines)
    for key in ("cost", "mass", "power"):
        told, total = [getattr(line, key) for line in lines], getattr(verdict.design, key)
        if any(key not in catalog[section][entry] for _, section, entry in bought):
            assert (None in told, total) == (True, None)
            continue
        assert float(sum((Decimal(repr(one)) for one in told), Decimal(0))) == total
        if key != "cost":
            plain = sum(amount(catalog[s][e], key, rates) * n for (_, s, e), n in bought.items())
            assert float(plain) == pytest.approx(total, rel=1e-12)


def test_every_format_prints_the_lines_and_the_total() -> None:
    verdict = checked((SPECS[0].parent / "usv_mapping.yaml").read_text("utf-8"))
    lines, design = verdict.bill_of_materials, verdict.design
    assert lines is not None
    assert design is not None
    assert design.cost is not None
    shown = f"{design.cost:,.2f}".replace(",", "\u00a0")
    plain = console(on_verdict(verdict)).replace("\u00a0", " ")
    assert f"{shown} {design.currency}".replace("\u00a0", " ") in plain
    for name in ("html", "markdown"):
        text = render_checks(name, [verdict]).replace("&nbsp;", "\u00a0")
        assert "Bill of materials" in text
        assert shown in text
        for line in lines:
            cost = f"{line.cost:,.2f}".replace(",", "\u00a0")
            assert f"{cost}\u00a0{design.currency}" in text
    rows = list(csv.DictReader(io.StringIO(render_checks("bill", [verdict]), newline="")))
    assert [row["entry"] for row in rows] == [line.entry for line in lines]
    assert sum(Decimal(row["cost"]) for row in rows) == Decimal(repr(design.cost))
    data = json.loads(render_checks("json", [verdict]))
    assert [set(row) for row in data["bill_of_materials"]] == len(lines) * [
        {"stage", "use", "item", "entry", "quantity", "cost", "mass", "power", "basis"}
    ]


def test_what_an_entry_does_not_say_is_missing_and_not_nothing() -> None:
    text = (SPECS[0].parent / "position_track.yaml").read_text("utf-8")
    spec = yaml.safe_load(text)
    spec["requirements"] = [r for r in spec["requirements"] if r["kind"] == "accuracy"]
    stage = spec["stages"][0]
    stage["position"] = {
        "sensor": {"modality": "position", "sigma_position": "1 cm", "primitives": ["pps"],
                   "cost": "100.005 EUR", "basis": "assumption"},
        "primitive": "pps", "timestamping": "hardware",
    }  # fmt: skip
    spec.pop("catalogs", None)
    verdict = checked(yaml.safe_dump(spec))
    assert verdict.bill_of_materials is not None
    (own,) = [line for line in verdict.bill_of_materials if line.use == "position sensor"]
    assert (own.cost, own.mass, own.power, own.basis) == (100.01, None, None, "assumption")
    assert verdict.design is not None
    assert verdict.design.mass is None
    assert verdict.design.cost is not None
