"""Studies: key paths, factors, cases, and results against specs written out by hand."""

from __future__ import annotations

import csv
import io
import itertools
import math
from pathlib import Path
from typing import Any

import pytest

from study_specs import SPEC, STUDY, write
from syncline_design.machine.records import json_of
from syncline_design.report.studies import study_csv, study_parquet
from syncline_design.spec.keys import KeyPathError, label, put, resolve, split_key
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import parse
from syncline_design.studies import StudyResult, StudySettings, load_study, run_study
from syncline_design.studies.definition import figure_of, grid_values, sample_values
from syncline_design.studies.finished import study_verdict
from syncline_design.studies.summary import boundaries, heat_map, summarise, winners
from syncline_design.studies.table import columns
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

DATA = parse(SPEC).data


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    folder = tmp_path_factory.mktemp("study")
    return run_study(write(folder), StudySettings(workers=1))


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("stages[uav].distance", ("stages", 0, "platform", "distance")),
        ("stages[0].platform.v_max", ("stages", 0, "platform", "v_max")),
        ("requirements[ACC-1].limit", ("requirements", 0, "limit")),
        ("requirements[1].limit", ("requirements", 1, "limit")),
        ("stages[uav].attitude.candidates[1]", ("stages", 0, "attitude", "candidates", 1)),
        ("coverage_factor", ("coverage_factor",)),
        ("catalog.sensors[sbg_apogee].cost", ("catalog", "sensors", "sbg_apogee", "cost")),
    ],
)
def test_key_paths_lead_to_their_places(text: str, path: tuple[Any, ...]) -> None:
    assert resolve(text, DATA) == path


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("stages[uaw].distance", "no entry of stages has the name uaw", "did you mean uav?"),
        ("requirements[ACC-2].limit", "no entry of requirements", "ACC-1"),
        ("stages[4].distance", "no entry [4]", ""),
        ("stages.distance", "no entry of stages", ""),
        ("catalogs", "the same in every case", "several bases"),
        ("catalog.sensor[x].cost", "no such section", "did you mean sensors?"),
        ("catalog.sensors[x]", "not a key of a catalog entry", ""),
        ("", "empty key path", ""),
        ("a..b", "not a key path", ""),
        ("a.", "not a key path", ""),
        ("stages[uav", "not a key path", ""),
    ],
)
def test_wrong_key_paths_say_what_is_wrong(text: str, message: str, hint: str) -> None:
    with pytest.raises(KeyPathError) as caught:
        resolve(text, DATA)
    assert message in caught.value.message
    assert hint in caught.value.hint + caught.value.message + caught.value.expected


def test_key_paths_split_into_names_and_selectors() -> None:
    assert split_key("a[b c].d[1][2]") == ("a", "b c", "d", "1", "2")


def test_put_copies_what_lies_on_the_way_and_nothing_else() -> None:
    before = repr(DATA)
    changed = put(DATA, ("stages", 0, "platform", "distance"), "40 m")
    assert changed["stages"][0]["platform"] == {"use": "uav_fixed_wing", "distance": "40 m"}
    assert repr(DATA) == before
    assert changed["requirements"] is DATA["requirements"]


def test_a_sensor_takes_the_place_of_candidates() -> None:
    role = put(DATA, ("stages", 0, "attitude", "sensor"), "sbg_apogee")["stages"][0]["attitude"]
    assert role == {"sensor": "sbg_apogee"}


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ({"low": "40 m", "high": "100 m", "count": 4}, ("40 m", "60 m", "80 m", "100 m")),
        ({"low": "1 mm", "high": "10 cm", "count": 3, "scale": "log"}, ("1 mm", "10 mm", "100 mm")),
        ({"low": 1, "high": 3, "count": 3}, (1.0, 2.0, 3.0)),
        (("hardware", "gpio"), ("hardware", "gpio")),
    ],
)
def test_grid_values(value: Any, expected: tuple[Any, ...]) -> None:
    assert grid_values(value)[0] == expected


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_latin_hypercube_uses_every_part_of_every_range_once(count: int) -> None:
    """Oracle: the definition. Values are rounded to six figures, so near an edge they may touch."""
    over = {"a": "0 m .. 1 m", "b": {"low": "1 us", "high": "1 ms", "scale": "log"}}
    for key, values in zip(over, sample_values(over, count, seed=7), strict=True):
        figures = [figure_of(value) for value in values]
        assert all(figure is not None for figure in figures)
        shares = [f[0] if key == "a" else math.log10(f[0] / 1e-6) / 3 for f in figures if f]
        for place, share in enumerate(sorted(shares)):
            assert place / count - 1e-5 <= share <= (place + 1) / count + 1e-5


def test_a_sample_depends_on_its_seed_and_on_no_other_key() -> None:
    alone = sample_values({"a": "0 m .. 1 m"}, 20, seed=1)[0]
    assert sample_values({"b": "0 m .. 1 m", "a": "0 m .. 1 m"}, 20, seed=1)[1] == alone
    assert sample_values({"a": "0 m .. 1 m"}, 20, seed=2)[0] != alone
    picks = sample_values({"c": ("x", "y")}, 20, seed=1)[0]
    assert sorted(picks) == ["x"] * 10 + ["y"] * 10


def test_every_case_is_what_the_spec_written_out_gives(result: StudyResult, tmp_path: Path) -> None:
    """Oracle: the same specs as text, changed by hand and checked as files."""
    wanted = list(itertools.product(["40 m", "60 m", "100 m"], ["0.15 m", "0.3 m"]))
    assert len(result) == len(wanted)
    for case, (distance, limit) in zip(result.cases(), wanted, strict=True):
        text = SPEC.replace("limit: 0.30 m", f"limit: {limit}").replace(
            "platform: uav_fixed_wing", f"platform: {{use: uav_fixed_wing, distance: {distance}}}"
        )
        path = tmp_path / "written.yaml"
        path.write_text(text, encoding="utf-8")
        expected = check_file(path, CheckSettings(monte_carlo=False)).to_json()
        assert case.labels == {
            "stages[uav].distance": distance,
            "requirements[ACC-1].limit": limit,
        }
        assert case.verdict == expected["verdict"]
        assert json_of(case.record.design) == expected["design"]
        assert case.record.error_m == (expected["syncline"] or {}).get("total_m")
        assert json_of(case.record.requirements) == expected["requirements"]
        assert json_of(case.record.infeasibility) == expected.get("infeasibility")
        points = (expected.get("choice") or {}).get("front") or ()
        front = [(point["cost"], point["error_m"]) for point in points]
        assert [(point.cost, point.error_m) for point in case.record.front] == front


def test_heat_map_winners_and_boundaries_follow_from_the_rows(result: StudyResult) -> None:
    """Oracle: plain loops over the CSV."""
    rows = list(csv.DictReader(io.StringIO(study_csv(result))))
    assert [list(row) for row in rows[:1]] == [columns(result)]
    met = [row for row in rows if row["verdict"] == "meets"]
    assert met
    assert len(met) < len(rows)
    summary = summarise(result)
    heat = heat_map(summary)
    assert heat is not None
    for y, limit in enumerate(heat.y_values):
        for x, distance in enumerate(heat.x_values):
            costs = [
                float(row["cost"])
                for row in met
                if row["stages[uav].distance"] == distance
                and row["requirements[ACC-1].limit"] == limit
            ]
            assert heat.least_cost[y][x] == (min(costs) if costs else None)
    for winner in winners(summary):
        chosen = [row for row in met if row[winner.role] == winner.sensor]
        stamped = [r for r in chosen if r[f"{winner.role} timestamping"] == winner.timestamping]
        assert (winner.cases, winner.of) == (len(stamped), len(met))
    verdicts = {
        (r["stages[uav].distance"], r["requirements[ACC-1].limit"]): r["verdict"] for r in rows
    }
    expected = set()
    for limit in ("0.15 m", "0.3 m"):
        for one, other in itertools.pairwise(["40 m", "60 m", "100 m"]):
            pair = [(one, verdicts[one, limit]), (other, verdicts[other, limit])]
            if (pair[0][1] == "meets") != (pair[1][1] == "meets"):
                ok, bad = sorted(pair, key=lambda p: p[1] != "meets")
                expected.add(("stages[uav].distance", ok[0], bad[0], limit))
    found = {
        (b.factor, b.met, b.missed, next(iter(b.fixed.values())))
        for b in boundaries(summary)
        if b.factor == "stages[uav].distance"
    }
    assert found == expected
    assert expected


def test_parquet_holds_what_the_csv_holds(result: StudyResult) -> None:
    import polars as pl

    frame = pl.read_parquet(io.BytesIO(study_parquet(result)))
    rows = list(csv.DictReader(io.StringIO(study_csv(result))))
    assert frame.columns == columns(result)
    for row, wanted in zip(frame.iter_rows(named=True), rows, strict=True):
        for name, value in row.items():
            if isinstance(value, float | int):
                assert float(wanted[name]) == value
            else:
                assert (value or "") == wanted[name]
    assert frame["stages[uav].distance [m]"].to_list() == [40.0, 40.0, 60.0, 60.0, 100.0, 100.0]


def test_a_catalog_figure_can_vary(tmp_path: Path) -> None:
    study = STUDY.replace(
        '"stages[uav].distance": [40 m, 60 m, 100 m]',
        '"catalog.sensors[sbg_apogee].cost": [20000 EUR, 25000.50 EUR]',
    ).replace("[0.15 m, 0.3 m]", "[0.3 m]")
    cheap, dear = run_study(write(tmp_path, study)).cases()
    first, second = cheap.record.cost, dear.record.cost
    assert first is not None
    assert second is not None
    picked = cheap.record.design.stages[0].roles["attitude"].sensor
    assert picked == "sbg_apogee"
    assert second - first == pytest.approx(5000.50, abs=1e-6)


def test_two_figures_of_one_catalog_entry_vary_together(tmp_path: Path) -> None:
    study = STUDY.replace(
        '"stages[uav].distance": [40 m, 60 m, 100 m]',
        '"catalog.sensors[sbg_apogee].cost": [123 EUR]\n'
        '  "catalog.sensors[sbg_apogee].mass": [4 kg]',
    ).replace("[0.15 m, 0.3 m]", "[0.3 m]")
    loaded = load_study(write(tmp_path, study))
    entry = loaded.bases[0].load(loaded.case(0)[1]).catalog.sensors["sbg_apogee"]
    assert (float(entry.cost or 0), float(entry.mass or 0)) == (123.0, 4.0)
    shipped = load_study(write(tmp_path)).bases[0].catalogs.entries["sensors"]["sbg_apogee"]
    assert float(shipped.mass) != 4.0


@pytest.mark.parametrize("first", ["platform", "distance"])
def test_a_platform_and_its_distance_vary_in_any_order(tmp_path: Path, first: str) -> None:
    lines = {
        "platform": '  "stages[uav].platform": [uav_fixed_wing, uav_multi_rotor]',
        "distance": '  "stages[uav].distance": [20 m, 30 m]',
    }
    grid = "\n".join(lines[key] for key in sorted(lines, key=lambda key: key != first))
    path = write(tmp_path, f"study: 1\nname: P\nbase: spec.yaml\ngrid:\n{grid}\n")
    study = load_study(path)
    seen = set()
    for index in range(4):
        _, settings = study.case(index)
        platform = study.bases[0].load(settings).spec.stages[0].platform
        seen.add((platform.use, float(platform.distance or 0)))
    assert seen == {(p, d) for p in ("uav_fixed_wing", "uav_multi_rotor") for d in (20.0, 30.0)}


def test_lists_of_candidates_vary_as_a_whole(tmp_path: Path) -> None:
    grid = '"timestamping.candidates": [[hardware], [gpio]]'
    done = run_study(write(tmp_path, f"study: 1\nname: L\nbase: spec.yaml\ngrid: {{{grid}}}\n"))
    methods = [
        {role.timestamping for role in case.record.design.stages[0].roles.values()}
        for case in done.cases()
    ]
    assert methods == [{"hardware"}, {"gpio"}]
    assert [case.labels["timestamping.candidates"] for case in done.cases()] == [
        '["hardware"]', '["gpio"]',
    ]  # fmt: skip


def test_a_key_below_a_catalog_id_says_how_to_vary_the_catalog(tmp_path: Path) -> None:
    grid = '"stages[uav].platform.use.cost": [1 EUR]'
    with pytest.raises(BadInput, match=r"nothing can be set below.*vary a catalog entry"):
        load_study(
            write(
                tmp_path,
                f"study: 1\nname: L\nbase: spec.yaml\ngrid: {{{grid}}}\n",
                SPEC.replace("platform: uav_fixed_wing", "platform: {use: uav_fixed_wing}"),
            )
        )


def test_monte_carlo_runs_where_a_requirement_asks_for_it(tmp_path: Path) -> None:
    spec = SPEC.replace(
        "stages:",
        "  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 5 m}\n"
        "monte_carlo: {samples: 2000}\nstages:",
        1,
    )
    study = STUDY.replace("[40 m, 60 m, 100 m]", "[60 m]").replace("[0.15 m, 0.3 m]", "[0.3 m]")
    done = run_study(write(tmp_path, study, spec))
    [case] = done.cases()
    rows = {row.id: row for row in case.record.requirements}
    assert rows["MC-1"].status == "pass"
    assert done.not_simulated == ()
    left_out = run_study(write(tmp_path, study + "check: {monte_carlo: false}\n", spec))
    [case] = left_out.cases()
    assert "MC-1" not in {row.id for row in case.record.requirements}
    assert left_out.not_simulated == ("MC-1",)
    assert case.verdict == "meets"


def test_requirements_keep_their_lines_when_simulated_ones_are_left_out(tmp_path: Path) -> None:
    spec = SPEC.replace(
        "  - {id: ACC-1",
        "  - {id: MC-1, kind: monte_carlo, quantile: 0.5, limit: 1 m}\n  - {id: ACC-1",
    )
    study = STUDY + "check: {monte_carlo: false}\n"
    done = run_study(write(tmp_path, study, spec))
    for case in done.cases():
        lines = {row.id: row.line for row in case.record.requirements if row.line}
        assert lines == {"ACC-1": 5, "COST-1": 6}


def test_combinations_that_cannot_be_are_cases_of_their_own(tmp_path: Path) -> None:
    study = """\
study: 1
name: Sensors and methods
base: spec.yaml
grid:
  "stages[uav].position.sensor": [ublox_f9p_rtk]
  "stages[uav].position.timestamping": [gpio, ptp]
"""
    fits, misfit = run_study(write(tmp_path, study)).cases()
    assert fits.verdict == "meets"
    assert misfit.verdict == "refused"
    assert "ptp cannot stamp ublox_f9p_rtk" in misfit.record.problems[0].message


BAD = [
    ("study: 2", "study: 1", "not one of the choices"),
    ("base: [none.yaml]", "base: [spec.yaml]", "no such file or directory"),
    ("base: [/etc/passwd]", "base: [spec.yaml]", "an absolute path"),
    ("base: []", "base: [spec.yaml]", "an empty list"),
    ("base: [spec.yaml, ./spec.yaml]", "base: [spec.yaml]", "listed twice"),
    ('"stages[uaw].distance"', '"stages[uav].distance"', "did you mean uav?"),
    ('"stages[uav].distanze"', '"stages[uav].distance"', "unknown key"),
    ("[40 furlong, 60 m]", "[40 m, 60 m, 100 m]", "unknown unit"),
    ("[40, 60 m]", "[40 m, 60 m, 100 m]", "a number without a unit"),
    ("[40 m, 40 m]", "[40 m, 60 m, 100 m]", "listed twice"),
    ("[40 m, 3 s]", "[40 m, 60 m, 100 m]", "expected"),
    ("[-40 m, 60 m]", "[40 m, 60 m, 100 m]", "out of range"),
    ("[]", "[40 m, 60 m, 100 m]", "an empty list"),
    ("40 m", "[40 m, 60 m, 100 m]", "not a list of values"),
    ("{low: 1 m, high: 2 m}", "[40 m, 60 m, 100 m]", "without its number of values"),
    ("{low: 2 m, high: 1 m, count: 3}", "[40 m, 60 m, 100 m]", "an empty range"),
    ("{low: 0 m, high: 1 m, count: 3, scale: log}", "[40 m, 60 m, 100 m]", "from 0 or below"),
    ("{low: 1 m, high: 2 s, count: 3}", "[40 m, 60 m, 100 m]", "one kind of figure to another"),
    ("{low: 1 m, high: 2 m, count: 3, step: 1}", "[40 m, 60 m, 100 m]", "unknown key in a range"),
    ("{low: 1 m, high: 2 m, count: 99999999}", "[40 m, 60 m, 100 m]", "number of values"),
    ("grids:", "grid:", "unknown key"),
]


@pytest.mark.parametrize(("written", "instead_of", "message"), BAD)
def test_a_bad_study_is_refused_at_its_place(
    tmp_path: Path, written: str, instead_of: str, message: str
) -> None:
    assert instead_of in STUDY
    text = STUDY.replace(instead_of, written, 1)
    path = write(tmp_path, text)
    with pytest.raises(BadInput) as caught:
        run_study(path)
    lines = text.split("\n")
    at = next(i for i, line in enumerate(lines, 1) if written in line)
    [*problems] = caught.value.problems
    assert any(message in str(p) for p in problems), str(caught.value)
    assert all(p.file == str(path) and p.line == at for p in problems), str(caught.value)
    assert not (tmp_path / ".syncline-cases").exists()


def test_all_errors_of_a_study_are_named_together(tmp_path: Path) -> None:
    text = STUDY.replace("60 m, 100 m", "60, 100 s").replace("[ACC-1]", "[ACC-9]")
    with pytest.raises(BadInput) as caught:
        load_study(write(tmp_path, text))
    assert "ACC-9" in str(caught.value)
    text = STUDY.replace("60 m, 100 m", "60, 100 s").replace("0.3 m", "0.3 kg")
    with pytest.raises(BadInput) as caught:
        load_study(write(tmp_path, text))
    assert len(caught.value.problems) == 3


def test_a_bad_base_is_reported_in_its_own_file(tmp_path: Path) -> None:
    path = write(tmp_path, spec=SPEC.replace("uav_fixed_wing", "uav_fixed_wink"))
    with pytest.raises(BadInput) as caught:
        load_study(path)
    [problem] = caught.value.problems
    assert problem.file == str(tmp_path / "spec.yaml")
    assert problem.line == 8
    assert "did you mean uav_fixed_wing?" in str(problem)


@pytest.mark.parametrize(
    ("counts", "rule", "verdict"),
    [
        ((3, 0, 0, 0, 0), "all", "meets"),
        ((2, 1, 0, 0, 0), "all", "fails"),
        ((2, 0, 1, 0, 0), "all", "fails"),
        ((2, 0, 0, 1, 0), "all", "fails"),
        ((2, 0, 0, 0, 1), "all", "indeterminate"),
        ((0, 1, 0, 0, 1), "all", "fails"),
        ((1, 5, 1, 0, 2), "any", "meets"),
        ((0, 5, 1, 0, 0), "any", "fails"),
        ((0, 5, 1, 0, 1), "any", "indeterminate"),
        ((0, 5, 1, 2, 0), "decided", "meets"),
        ((3, 0, 0, 0, 1), "decided", "indeterminate"),
    ],
)
def test_verdict_of_a_study(counts: tuple[int, ...], rule: str, verdict: str) -> None:
    words = ("meets", "fails", "infeasible", "refused", "indeterminate")
    assert study_verdict(dict(zip(words, counts, strict=True)), rule) == verdict


def test_labels_show_values_as_written() -> None:
    assert label(parse("a: 1.50").data["a"]) == "1.50"
    assert label(("a", "b")) == '["a", "b"]'
    assert label("40 m") == "40 m"
    assert label(True) == "true"
