"""Money in any currency, and entries that do not say what they cost, weigh or draw."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from syncline_design.choice.front import front
from syncline_design.choice.problem import build_problem
from syncline_design.cli.app import app
from syncline_design.spec.load import BadInput, load
from syncline_design.verdict.choice_data import left_out
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

QUICK = CheckSettings(monte_carlo=False)
AMOUNTS = {"cost": "{} EUR", "mass": "{} g", "power": "{} W"}


def catalog(lacks: dict[str, str] | None = None, currency: str = "EUR") -> str:
    """Two sensors a role, two methods with hardware of their own, a part that nobody needs.

    lacks: entry to the amount that it does not give.
    """
    amounts = dict(AMOUNTS, cost="{} " + currency)

    def spent(entry: str, number: int) -> str:
        missing = (lacks or {}).get(entry)
        return ", ".join(
            f"{k}: {text.format(number)}" for k, text in amounts.items() if k != missing
        )

    def sensor(name: str, role: str, figures: str, number: int) -> str:
        head = f"modality: {role}, {figures}, primitives: [pps]"
        return f"  {name}: {{{head}, {spent(name, number)}}}"

    def method(name: str, board: str, error: str, number: int) -> str:
        bounds = f"error: {{distribution: uniform, low: -{error}, high: {error}}}"
        head = f"primitives: [pps], timeline: host, {bounds}, requires: {{{board}: 1}}"
        return f"  {name}: {{{head}, {spent(name, number)}}}"

    lines = [
        "sensors:",
        sensor("gnss_a", "position", "sigma_position: 1 cm", 900),
        sensor("gnss_b", "position", "sigma_position: 20 cm", 100),
        sensor("ins_a", "attitude", "sigma_attitude: 0.02 deg", 800),
        sensor("ins_b", "attitude", "sigma_attitude: 0.4 deg", 200),
        sensor("lidar_a", "ranging", "sigma_range: 1 cm, sigma_bearing: 0.01 deg", 700),
        "timestamping:",
        method("fine", "board_a", "1 us", 30),
        method("rough", "board_b", "900 us", 10),
        "clocks:",
        *(
            f"  {name}: {{offset: {{distribution: uniform, low: -{size}, high: {size}}}, "
            f"{spent(name, number)}}}"
            for name, size, number in (("free", "90 us", 1), ("locked", "1 us", 60))
        ),
        "infrastructure:",
        *(
            f"  {name}: {{channels: 4, {spent(name, number)}}}"
            for name, number in (("board_a", 50), ("board_b", 5), ("shelf", 7))
        ),
    ]
    return "\n".join(lines) + "\n"


def spec_text(currency: str = "EUR", limit: str = "9 m", more: str = "") -> str:
    return f"""\
syncline: 1
name: A hull
catalogs: [own.yaml]
currency: {currency}
{more}
requirements:
  - {{id: ACC, kind: accuracy, limit: {limit}}}
objective: error
stages:
  - name: hull
    platform: {{name: hull, v_max: 5 m/s, omega_max: 17 deg/s, distance: 30 m, baseline: 5 m}}
    position: {{candidates: [gnss_a, gnss_b]}}
    attitude: {{candidates: [ins_a, ins_b]}}
    ranging: {{sensor: lidar_a}}
timestamping: {{candidates: [fine, rough]}}
"""


def written(folder: Path, text: str, own: str) -> Path:
    (folder / "own.yaml").write_text(own, "utf-8")
    path = folder / "spec.yaml"
    path.write_text(text, "utf-8")
    return path


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.output


@pytest.mark.parametrize("code", ["USD", "NOK", "JPY"])
@pytest.mark.parametrize("objective", ["cost", "error"])
def test_currency_is_only_a_name(tmp_path: Path, code: str, objective: str) -> None:
    """All prices in another currency: the very same verdict, with no rate to EUR anywhere."""
    found = []
    for name in ("EUR", code):
        text = spec_text(name).replace("objective: error", f"objective: {objective}")
        found.append(check_file(written(tmp_path, text, catalog(currency=name)), QUICK).to_json())
    for key in ("requirements", "syncline", "monte_carlo"):
        assert found[0][key] == found[1][key]
    fronts = [[(p["cost"], p["error_m"]) for p in v["choice"]["front"]] for v in found]
    assert fronts[0] == fronts[1]
    assert fronts[0]
    assert found[1]["design"]["currency"] == code


def test_shipped_entry_without_a_rate_is_refused_where_it_can_be_chosen(tmp_path: Path) -> None:
    text = spec_text("USD").replace("[fine, rough]", "[fine, hardware]")
    path = written(tmp_path, text, catalog(currency="USD"))
    with pytest.raises(BadInput) as caught:
        load(path)
    message = str(caught.value)
    assert "EUR" in message
    assert "add exchange_rates: {EUR: RATE USD}" in message
    assert f"{path}:" in message
    path.write_text(text.replace("requirements:", "exchange_rates: {EUR: 1.1 USD}\nrequirements:"))
    assert check_file(path, QUICK).to_json()["verdict"] == "meets"


def test_remedies_of_an_infeasible_spec_need_no_rate(tmp_path: Path) -> None:
    """No method fits: shipped methods in EUR are looked at as remedies, none is an error."""
    text = spec_text("USD", more="").replace("[fine, rough]", "[rough]")
    text = text.replace("objective: error", "objective: cost")
    own = catalog(currency="USD").replace("900 us", "900 ms")
    code, output = run("check", str(written(tmp_path, text, own)))
    assert code == 1, output
    assert "INFEASIBLE" in output.upper()
    assert "internal" not in output


@pytest.mark.parametrize("pinned", [False, True])
def test_limit_value_and_margin_share_one_currency(tmp_path: Path, pinned: bool) -> None:
    """A limit of 100 USD at 2 EUR each is 200 EUR, in every format, met or not."""
    text = spec_text(more="exchange_rates: {USD: 2 EUR}")
    text = text.replace("objective: error", "  - {id: COST, kind: cost, limit: 100 USD}")
    if pinned:
        text = text.replace("{candidates: [gnss_a, gnss_b]}", "{sensor: gnss_a}")
        text = text.replace("{candidates: [ins_a, ins_b]}", "{sensor: ins_a}")
        text = text.replace("[fine, rough]", "[fine]")
    path = written(tmp_path, text, catalog())
    outputs = [f"{name}:{tmp_path / name}" for name in ("json", "junit", "markdown", "html")]
    code, shown = run("check", str(path), *(f"-o{o}" for o in outputs))
    assert code == 1, shown
    row = next(
        r for r in json.loads((tmp_path / "json").read_text())["requirements"] if r["id"] == "COST"
    )
    assert (row["limit"], row["unit"]) == (200.0, "EUR")
    if pinned:  # 900 + 800 + 700 for sensors, 3 x 30 for stamps, 50 for the board
        assert (row["value"], row["margin"]) == (2540.0, 200.0 - 2540.0)
    pages = [shown, *((tmp_path / name).read_text() for name in ("junit", "markdown", "html"))]
    for page in pages:
        assert "100 EUR" not in page.replace("\u202f", " ").replace("\xa0", " ")


Points = list[tuple[float, float]]


def front_of(path: Path, resource: Any) -> tuple[Points, tuple[str, ...]]:
    """Points of the front, and what is not on it."""
    loaded = load(path)
    problem = build_problem(loaded)
    points = [(float(p.amount), p.error_m) for p in front(problem, resource)]
    return points, left_out(loaded, problem, resource)


@pytest.mark.parametrize("resource", ["cost", "mass", "power"])
@pytest.mark.parametrize(
    ("entry", "label", "drop"),
    [
        ("gnss_b", "sensor gnss_b", ("[gnss_a, gnss_b]", "[gnss_a]")),
        ("rough", "timestamping method rough", ("[fine, rough]", "[fine]")),
        ("board_b", "shared hardware board_b", ("[fine, rough]", "[fine]")),
        ("free", "clock free", ("[free, locked]", "[locked]")),
    ],
)
def test_what_does_not_say_is_not_on_that_front(
    tmp_path: Path, entry: str, label: str, drop: tuple[str, str], resource: str
) -> None:
    """The front is that of the spec without the entry; the choice itself keeps it."""
    text = spec_text()
    if entry == "free":
        text = text.replace(
            "    position:", "    clock: {candidates: [free, locked]}\n    position:"
        )
    found, missing = front_of(written(tmp_path, text, catalog({entry: resource})), resource)
    verdict = check_file(tmp_path / "spec.yaml", QUICK).to_json()
    expected, nothing = front_of(written(tmp_path, text.replace(*drop), catalog()), resource)
    assert found == expected
    assert expected
    assert missing == (label,)
    assert nothing == ()
    said = [w["message"] for w in verdict["warnings"] if w["code"] == "unpriced"]
    wanted = f"not on the front of cost: {label} gives no cost"
    assert said == ([wanted] if resource == "cost" else [])
    assert verdict["choice"]["front"]


@pytest.mark.parametrize("option", ["--resource", "--against"])
def test_optimize_says_what_is_not_on_the_front(tmp_path: Path, option: str) -> None:
    own = catalog({"gnss_b": "mass", "rough": "mass"})
    path, target = written(tmp_path, spec_text(), own), tmp_path / "out.json"
    code, text = run("optimize", str(path), "--pareto", option, "mass", "-o", f"json:{target}")
    assert code == 0, text
    labels = ["sensor gnss_b", "timestamping method rough"]
    assert json.loads(target.read_text("utf-8"))["front_left_out"] == labels
    assert f"not on the front of mass: {', '.join(labels)} give no mass" in text


def test_unused_hardware_without_a_price_has_no_influence(tmp_path: Path) -> None:
    shelves: tuple[dict[str, str], ...] = ({}, {"shelf": "cost"})
    verdicts = [
        check_file(written(tmp_path, spec_text(), catalog(s)), QUICK).to_json() for s in shelves
    ]
    for verdict in verdicts:
        verdict.pop("provenance")
    assert verdicts[0] == verdicts[1]
    assert verdicts[0]["choice"]["front"]


def test_unknown_amounts_come_last_among_ties(tmp_path: Path) -> None:
    """Twins but for the price: the one that says what it costs is chosen, by whichever road."""
    for silent, priced in (("gnss_a", "gnss_z"), ("gnss_z", "gnss_a")):
        lines = [
            f"  {name}: {{modality: position, sigma_position: 1 cm, primitives: [pps], "
            f"{price}mass: 1 kg, power: 1 W}}"
            for name, price in ((silent, ""), (priced, "cost: 5000 EUR, "))
        ]
        own = catalog().replace("  gnss_a:", "  gnss_old:")
        own = own.replace("sensors:", "\n".join(["sensors:", *lines]))
        text = spec_text().replace("[gnss_a, gnss_b]", "[gnss_a, gnss_z]")
        path = written(tmp_path, text, own)
        for road in ("auto", "front", "milp", "enumerate"):
            found = check_file(path, CheckSettings(monte_carlo=False, road=road)).to_json()  # type: ignore[arg-type]
            assert found["design"]["stages"][0]["roles"]["position"]["sensor"] == priced, road
