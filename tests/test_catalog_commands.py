"""`catalog list`, `show`, `check`, `add`: planted faults are found, the shipped catalogs pass."""

from __future__ import annotations

import csv
import json
import shutil
import time
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.machine.records import read_as
from syncline_design.report.catalog_stub import STUB_TYPES, put_in, stub
from syncline_design.report.catalogs import CatalogList, WholeEntry
from syncline_design.report.json_out import json_text
from syncline_design.report.result_schemas import ResultName, result_schema
from syncline_design.spec import catalog_check, files
from syncline_design.spec.catalog_check import CatalogCheck, check_catalogs
from syncline_design.spec.load import builtin_collection
from syncline_design.spec.yaml_text import parse, read

CATALOGS = Path(__file__).parent.parent / "catalogs"
GOOD = """\
sensors:
  acme_lidar_one:
    name: Acme One
    modality: ranging
    type: lidar
    sigma_range: 2 cm
    sigma_bearing: 0.1 deg
    primitives: [pps]
    cost: 3000 EUR
    mass: 900 g
    power: 12 W
    reach: {min: 0.5 m, max: 150 m}
    medium: air
    lifecycle: {status: active, read: 2026-11-22}
    source: data sheet 2231 revision 4
"""
SHEET = "source: Data sheet, read: 2026-11-22}"


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["catalog", *arguments])


def findings(folder: Path, text: str) -> list[catalog_check.CatalogFlaw]:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return list(check_catalogs([path]).findings)


def test_the_shipped_catalogs_pass() -> None:
    found = check_catalogs()
    assert found.findings == ()
    assert found.exit_code == 0
    assert found.entries == len(builtin_collection().origins)
    assert run("check").exit_code == 0


def test_a_good_catalog_passes(tmp_path: Path) -> None:
    assert findings(tmp_path, GOOD) == []


@pytest.mark.parametrize(
    ("code", "line", "old", "new", "words"),
    [
        ("format", 6, "sigma_range: 2 cm", "sigma_range: 2 kg", "wrong dimension"),
        ("format", 6, "sigma_range: 2 cm", "sigma_range: 2", "without a unit"),
        ("format", 12, "min: 0.5 m", "min: 500 m", "min above max"),
        ("format", 13, "medium: air", "medium: vacuum", "expected air or water"),
        ("format", 14, "status: active", "status: alive", "expected active"),
        ("siblings", 6, "sigma_range: 2 cm", "sigma_range: 2 m", "median"),
        ("siblings", 10, "mass: 900 g", "mass: 900 kg", "more than the median"),
        ("siblings", 12, "max: 150 m", "max: 1.5 m", "less than the median"),
        ("unsourced", 6, "    source: data sheet 2231 revision 4\n", "", "no source"),
        ("id", 2, "acme_lidar_one", "Acme-Lidar1", "will not last"),
        ("id", 2, "acme_lidar_one", "acme lidar", "will not last"),
        ("duplicate", 2, "acme_lidar_one", "livox_mid360", "this id is taken"),
        ("duplicate", 2, "acme_lidar_one", "livox_mid360s", "this id is taken"),
        ("duplicate", 3, "Acme One", "livox  mid-360", "the same name as livox_mid360"),
        ("successor", 14, "status: active", "status: discontinued", "without a successor"),
        ("successor", 14, "status: active", "status: discontinued, successor: acme_two",
         "no such successor"),
    ],
)  # fmt: skip
def test_a_planted_fault_is_found_where_it_stands(
    tmp_path: Path, code: str, line: int, old: str, new: str, words: str
) -> None:
    assert old in GOOD
    found = findings(tmp_path, GOOD.replace(old, new, 1))
    mine = [one for one in found if one.code == code and one.line == line]
    assert mine, found
    assert words in f"{mine[0].message}; {mine[0].hint}"
    assert mine[0].file == str(tmp_path / "mine.yaml")
    assert {one.code for one in found} == {code}
    result = run("check", str(tmp_path / "mine.yaml"))
    assert result.exit_code == 1
    assert f"mine.yaml:{line}:" in result.stdout


@pytest.mark.parametrize(
    ("figure", "written", "fits"),
    [
        ("{figure: 2 cm, kind: 1 sigma,", "2 cm", True),
        ("{figure: 4 cm, kind: 95 %,", "2.04 cm", True),
        ("{figure: 4 cm, kind: 95 %,", "2.1 cm", False),
        ("{figure: 2 cm, kind: cep50,", "2 cm", False),
        ("{figure: 1 %, over: 8 m, kind: max,", "4.62 cm", True),
        ("{figure: 1 %, kind: max,", "4.62 cm", False),
        ("{figure: about that, kind: max,", "2 cm", False),
        ("{figure: 2 cm, kind: listed,", "2 cm", False),
    ],
)
def test_a_sigma_is_held_against_its_printed_figure(
    tmp_path: Path, figure: str, written: str, fits: bool
) -> None:
    text = GOOD.replace("sigma_range: 2 cm", f"sigma_range: {written}")
    found = findings(tmp_path, f"{text}    figures: {{sigma_range: {figure} {SHEET}}}\n")
    assert [one.code for one in found] == ([] if fits else ["conversion"]), found


def test_parts_are_held_against_their_own_axes(tmp_path: Path) -> None:
    text = GOOD.replace("sigma_bearing: 0.1 deg", "sigma_bearing: [0.1 deg, 0.2 deg]")
    for part, kept in (("azimuth", "0.1 deg"), ("elevation", "0.2 deg")):
        for figure in ("0.1 deg", "0.2 deg"):
            printed = f"{{sigma_bearing.{part}: {{figure: {figure}, kind: rms, {SHEET}}}"
            found = findings(tmp_path, f"{text}    figures: {printed}\n")
            assert [one.code for one in found] == ([] if figure == kept else ["conversion"])


def test_one_file_with_a_fault_of_each_kind_names_them_all(tmp_path: Path) -> None:
    """What is wrong with one entry hides nothing of another, nor does a taken id."""
    entries = {
        "format": GOOD.replace("medium: air", "medium: vacuum"),
        "siblings": GOOD.replace("mass: 900 g", "mass: 900 kg"),
        "unsourced": GOOD.replace("    source: data sheet 2231 revision 4\n", ""),
        "id": GOOD.replace("acme_lidar_one", "Acme9"),
        "duplicate": GOOD.replace("acme_lidar_one", "livox_mid360"),
        "successor": GOOD.replace("status: active", "status: discontinued"),
        "conversion": GOOD + f"    figures: {{sigma_range: {{figure: 9 cm, kind: rms, {SHEET}}}\n",
    }
    text = "sensors:\n"
    for number, (code, entry) in enumerate(entries.items()):
        body = entry.removeprefix("sensors:\n").replace("Acme One", f"Acme {code}")
        text += body.replace("acme_lidar_one", f"acme_lidar_{number}")
    found = findings(tmp_path, text)
    assert sorted(one.code for one in found if one.code != "unsourced") == sorted(
        set(entries) - {"unsourced"}
    )
    assert {one.entry for one in found if one.code == "unsourced"} == {"acme_lidar_2"}
    taken = GOOD.replace("acme_lidar_one", "livox_mid360").replace("mass: 900 g", "mass: 9 t")
    assert {one.code for one in findings(tmp_path, taken)} == {"duplicate", "format"}
    taken = GOOD.replace("acme_lidar_one", "livox_mid360").replace("mass: 900 g", "mass: 900 kg")
    assert {one.code for one in findings(tmp_path, taken)} == {"duplicate", "siblings"}


def test_without_a_line_for_all_every_figure_wants_a_source_of_its_own(tmp_path: Path) -> None:
    bare = GOOD.replace("    source: data sheet 2231 revision 4\n", "")
    printed = f"{{sigma_range: {{figure: 2 cm, kind: rms, {SHEET}}}"
    found = findings(
        tmp_path,
        f"{bare}    figures: {printed}\n    basis: {{cost: assumption, mass: transcript}}\n",
    )
    assert [one.key for one in found] == ["sigma_bearing", "primitives", "power", "reach"]


def test_what_stands_apart_may_say_why(tmp_path: Path) -> None:
    far = GOOD.replace("max: 150 m", "max: 15 km")
    assert [one.code for one in findings(tmp_path, far)] == ["siblings"]
    assert findings(tmp_path, f"{far}    unusual: {{reach: looks at reflectors only}}\n") == []


def test_a_discontinued_entry_says_who_follows_or_that_none_is_known(tmp_path: Path) -> None:
    for more in ("successor: livox_mid360s", "note: the maker names none"):
        text = GOOD.replace("status: active", f"status: discontinued, {more}")
        assert findings(tmp_path, text) == []


def test_an_id_that_a_release_had_must_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = tmp_path / "ids.txt"
    text = files.published_ids().read_text("utf-8")
    listed.write_text(text + "sensors gone_for_good\n", "utf-8")
    monkeypatch.setattr(catalog_check, "published_ids", lambda: listed)
    (found,) = check_catalogs().findings
    assert (found.code, found.line) == ("published", len(text.splitlines()) + 1)
    assert "gone_for_good" in found.message


def test_every_shipped_id_is_noted_for_good() -> None:
    noted = set(files.published_ids().read_text("utf-8").splitlines())
    assert noted == {f"{section} {one}" for section, one in builtin_collection().origins}


def test_a_fault_that_loading_refuses_ends_check_of_a_spec_with_2(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(GOOD.replace("min: 0.5 m", "min: 500 m"), "utf-8")
    spec = (CATALOGS.parent / "specs" / "usv_mapping.yaml").read_text("utf-8")
    (tmp_path / "spec.yaml").write_text(spec + "catalogs: [mine.yaml]\n", "utf-8")
    result = CliRunner().invoke(app, ["check", str(tmp_path / "spec.yaml")])
    assert result.exit_code == 2
    assert "mine.yaml:12:18" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "ids"),
    [
        (("--modality", "ranging", "--type", "mbes", "--reach", "300 m"),
         {"reson_seabat_t20", "reson_seabat_7125_200khz", "r2sonic_2024"}),
        (("--type", "rangefinder"), {"benewake_tf03_100"}),
        (("sensors", "--type", "rangefinder", "--reach", "41 m"), set()),
        (("--type", "lidar_2d", "--max-cost", "300 EUR"),
         {"slamtec_s2", "slamtec_a2", "slamtec_a1"}),
        (("--medium", "water", "--type", "lidar"), set()),
        (("--medium", "water", "--modality", "position"), set()),
    ],
)  # fmt: skip
def test_a_list_is_narrowed(arguments: tuple[str, ...], ids: set[str]) -> None:
    result = run("list", *arguments, "--output", "json")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert {one["id"] for one in found["entries"]} == ids
    if "position" in arguments:  # what gives no medium is said, not left out in silence
        assert {"ublox_f9p_rtk"} <= {one["id"] for one in found["undecided"]}


def test_a_list_says_what_it_cannot_decide() -> None:
    text = run("list", "--type", "mbes", "--reach", "300 m").stdout
    assert "more give no reach, look it up: " in text
    assert "kongsberg_em2040" in text
    assert "reson_seabat_7125_400khz" not in text


@pytest.mark.parametrize(
    "arguments",
    [
        ("list", "--modality", "sound"),
        ("list", "--medium", "both"),
        ("list", "--reach", "120"),
        ("list", "--reach", "120 kg"),
        ("list", "--max-cost", "lots"),
        ("list", "clocks", "--reach", "120 m"),
        ("check", "nowhere.yaml"),
        ("add", "--from-template", "sextant"),
        ("show", "nothing_of_that_name"),
    ],
)
def test_bad_usage_ends_with_2_and_one_line(arguments: tuple[str, ...]) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1


def test_show_tells_figure_kind_conversion_and_source() -> None:
    text = run("show", "ublox_x20p_rtk").stdout
    for words in ("0.006 m + 1 ppm of 1 km", "cep50", "/ 1.1774", "UBXDOC-963802114-12690",
                  "read 2026-11-22", "one sigma 5.945 mm"):  # fmt: skip
        assert words in text
    assert "one sigma 0.2865 deg" in run("show", "exail_gaps_m5").stdout  # 0.5 % is 0.005 rad


@pytest.mark.parametrize(
    ("name", "record", "arguments"),
    [
        ("catalog-list", CatalogList, ("list",)),
        ("catalog-list", CatalogList, ("list", "sensors", "--reach", "50 m")),
        ("catalog-entry", WholeEntry, ("show", "exail_gaps_m5")),
        ("catalog-entry", WholeEntry, ("show", "ocxo")),
        ("catalog-check", CatalogCheck, ("check",)),
    ],
)
def test_results_as_json_keep_to_their_schema(
    name: ResultName, record: type[Any], arguments: tuple[str, ...]
) -> None:
    text = run(*arguments, "-o", "json").stdout
    schema = result_schema(name)
    jsonschema.Draft202012Validator(schema).validate(json.loads(text))
    assert json_text(read_as(record, text).to_json()) == text


def test_findings_as_json_keep_to_their_schema(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD.replace("mass: 900 g", "mass: 900 kg"), "utf-8")
    result = run("check", str(path), "-o", "json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    jsonschema.Draft202012Validator(result_schema("catalog-check")).validate(found)
    (one,) = found["findings"]
    assert (one["code"], one["entry"], one["key"], one["line"]) == (
        "siblings", "acme_lidar_one", "mass", 10,
    )  # fmt: skip


@pytest.mark.parametrize("kind", STUB_TYPES)
def test_a_stub_reads_as_yaml_and_is_refused_until_it_is_filled_in(
    tmp_path: Path, kind: str
) -> None:
    section, text = stub(kind, "2026-11-22", lambda _, __: False)
    document = parse(f"{section}:\n{text}")
    assert not document.problems
    assert [*document.data[section]] == [f"new_{kind}"]
    result = run("add", "--from-template", kind, "--to", str(tmp_path / "mine.yaml"))
    assert result.exit_code == 0
    assert run("check", str(tmp_path / "mine.yaml")).exit_code == 1


def test_a_stub_filled_in_is_a_good_entry(tmp_path: Path) -> None:
    _, text = stub("lidar", "2026-11-22", lambda _, __: False)
    for old, new in (
        ("_ cm", "2 cm"),
        ("_ deg .. _ deg", "-20 deg .. 20 deg"),
        ("_ deg", "0.1 deg"),
        ("min: _ m, max: _ m", "min: 1 m, max: 150 m"),
        ("_ Hz", "10 Hz"),
        ("_ EUR", "3000 EUR"),
        ("_ kg", "1 kg"),
        ("_ W", "12 W"),
        ('"_"', "A sheet"),
    ):
        text = text.replace(old, new)
    found = findings(tmp_path, f"sensors:\n{text}    source: A sheet\n")
    assert found == []


def test_an_entry_is_put_into_its_section() -> None:
    """Whatever the file looks like, the entry is in its section and all else stays."""
    entry = "  two:\n    name: second\n"
    for before in (
        "",
        "# mine\n",
        "sensors:\n  one:\n    name: first\n",
        "sensors:\n  one:\n    name: first",
        "sensors:\n  one:\n    name: first\n\n\nclocks:\n  c:\n    name: clock\n",
        "clocks:\n  c:\n    name: clock\nsensors:\n  one:\n    name: first\n# the end\n",
        "catalogs: [other.yaml]\nsensors:\n  one:\n    name: first\n",
        "clocks:\n  c:\n    name: clock\n",
    ):
        after = parse(put_in(before, "sensors", entry))
        assert not after.problems, before
        data = parse(before).data or {}
        wanted = {**data, "sensors": {**data.get("sensors", {}), "two": {"name": "second"}}}
        assert after.data == wanted, before


@pytest.mark.parametrize("text", ["", "\n", "# mine\n", "  # mine, without an end"])
def test_a_file_without_entries_takes_one(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text, "utf-8")
    assert run("add", "--from-template", "clock", "--to", str(path)).exit_code == 0
    assert list(read(path).data["clocks"]) == ["new_clock"]
    assert path.read_text("utf-8").startswith(text)


def test_a_second_stub_gets_an_id_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    said = [run("add", "--from-template", "usbl", "--to", str(path)) for _ in range(3)]
    assert [one.exit_code for one in said] == [0, 0, 0]
    assert said[2].stderr.startswith(f"new_usbl_3 written to {path}: fill in every _")
    document = read(path)
    assert not document.problems
    assert list(document.data["sensors"]) == ["new_usbl", "new_usbl_2", "new_usbl_3"]


@pytest.mark.parametrize("text", ["- one\n", "sensors: [a]\n", "sensors: 3\n", "just words\n"])
def test_what_is_no_catalog_is_not_added_to(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text, "utf-8")
    result = run("add", "--from-template", "lidar", "--to", str(path))
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert path.read_text("utf-8") == text


def test_thousands_of_entries_are_checked_in_seconds(tmp_path: Path) -> None:
    """Siblings are compared by sorted sizes; pair by pair this took a minute."""
    body = GOOD.removeprefix("sensors:\n")
    entries = (
        body.replace("acme_lidar_one", f"acme_lidar_{n}").replace("Acme One", f"Acme {n}")
        for n in range(2000)
    )
    path = tmp_path / "mine.yaml"
    path.write_text("sensors:\n" + "".join(entries), "utf-8")
    start = time.process_time()
    assert check_catalogs([path]).findings == ()
    assert time.process_time() - start < 10.0


def test_a_broken_file_is_not_added_to(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("sensors: {a: 1, a: 2}\n", "utf-8")
    result = run("add", "--from-template", "lidar", "--to", str(path))
    assert result.exit_code == 2
    assert path.read_text("utf-8") == "sensors: {a: 1, a: 2}\n"


def test_families_hold_what_their_lines_say() -> None:
    """The quick look into the families' lines agrees with reading them whole."""
    core = _core_ids()
    for path in sorted(CATALOGS.glob("*/*.yaml")):
        data = read(path).data
        shown = f"builtin:{path.parent.name}/{path.name}"
        quick = {
            key: (one.modality, one.type)
            for key, one in files._families().items()
            if one.file == shown
        }
        whole = {
            (section, identity): (entry.get("modality", ""), entry.get("type", ""))
            for section, entries in data.items()
            for identity, entry in entries.items()
        }
        assert quick == whole
        for section, entries in data.items():  # a family brings the hardware that it requires
            for entry in entries.values():
                needed = {("infrastructure", one) for one in entry.get("requires", {})}
                assert needed <= {*whole, *core}, (section, path)


def _core_ids() -> set[tuple[str, str]]:
    return {
        (section, identity)
        for path in CATALOGS.glob("*.yaml")
        for section, entries in read(path).data.items()
        for identity in entries
    }


def test_every_figure_of_a_family_names_title_address_and_day() -> None:
    count = {"sensors": 0, "timing": 0}
    for path in sorted(CATALOGS.glob("*/*.yaml")):
        for entries in read(path).data.values():
            for identity, entry in entries.items():
                count[path.parent.name] += 1
                assert entry["figures"], identity
                for key, one in entry["figures"].items():
                    assert one["source"], (identity, key)
                    assert one["address"], (identity, key)
                    assert one["read"] == "2026-11-22", (identity, key)
    assert count["sensors"] >= 100
    assert count["timing"] >= 25


def test_a_package_without_its_families_would_be_seen(tmp_path: Path) -> None:
    """What is packed: every catalog file lies where the packaging looks for it."""
    text = (CATALOGS.parent / "pyproject.toml").read_text("utf-8")
    (line,) = [one for one in text.splitlines() if '"syncline_design.catalogs" = [' in one]
    patterns = json.loads(line.partition("= ")[2])
    shutil.copytree(CATALOGS, tmp_path / "catalogs", ignore=shutil.ignore_patterns("__pycache__"))
    packed = {path for one in patterns for path in (tmp_path / "catalogs").glob(one)}
    data = {p for p in (tmp_path / "catalogs").rglob("*") if p.is_file() and p.suffix != ".py"}
    assert packed == data


def test_a_study_may_vary_what_its_base_does_not_name(tmp_path: Path) -> None:
    """Family entries as values, and a figure of one of them: read when a case asks for them."""
    spec = (CATALOGS.parent / "specs" / "usv_wire_missing.yaml").read_text("utf-8")
    (tmp_path / "base.yaml").write_text(spec, "utf-8")
    (tmp_path / "study.yaml").write_text(
        "study: 1\nname: lidars\nbase: [base.yaml]\ngrid:\n"
        "  stages[usv].ranging.sensor: [velodyne_hdl32e, hesai_xt32]\n"
        "  catalog.sensors[hesai_xt32].cost: [3000 EUR, 9000 EUR]\n",
        "utf-8",
    )
    result = CliRunner().invoke(app, ["study", str(tmp_path / "study.yaml"), "-o", "csv"])
    assert result.exit_code in (0, 1), result.stderr
    rows = list(csv.DictReader(result.stdout.splitlines()))
    (cost,) = [key for key in rows[0] if key.startswith("cost")]
    by_sensor: dict[str, set[float]] = {}
    for row in rows:
        sensor = row[next(key for key in row if key.endswith("ranging.sensor"))]
        by_sensor.setdefault(sensor, set()).add(float(row[cost]))
    assert len(by_sensor["velodyne_hdl32e"]) == 1
    low, high = sorted(by_sensor["hesai_xt32"])
    assert high - low == pytest.approx(6000.0)


def test_an_unknown_id_is_told_of_the_families_too(tmp_path: Path) -> None:
    spec = (CATALOGS.parent / "specs" / "usv_mapping.yaml").read_text("utf-8")
    path = tmp_path / "spec.yaml"
    path.write_text(spec.replace("sensor: velodyne_hdl32e", "sensor: hesai_xt33"), "utf-8")
    result = CliRunner().invoke(app, ["check", str(path)])
    assert result.exit_code == 2
    assert "did you mean hesai_xt32?" in result.stderr
