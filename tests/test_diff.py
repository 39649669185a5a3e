"""What changed between two designs, in words; figures against the two checks themselves."""

from __future__ import annotations

import json
import math
from pathlib import Path

import jsonschema
import pytest

from study_specs import SPEC
from syncline_design.comparison import diff as comparison_diff
from syncline_design.comparison.diff import diff
from syncline_design.comparison.diff_result import SCHEMA, Cause, Diff
from syncline_design.machine.records import read_as, schema_of
from syncline_design.report.json_out import json_text
from syncline_design.report.on_diff import (
    DIFF_FORMATS,
    cause_words,
    headline,
    on_diff,
    render_diff,
)
from syncline_design.report.render_console import console
from syncline_design.spec.files import Collection
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import ParsedFile
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

ROOT = Path(__file__).parent.parent
PLAIN = CheckSettings(monte_carlo=False)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    old, new = tmp_path / "old.yaml", tmp_path / "new.yaml"
    old.write_text(SPEC, encoding="utf-8")
    new.write_text(SPEC, encoding="utf-8")
    return old, new


def change(path: Path, *pairs: tuple[str, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for before, after in pairs:
        assert before in text
        text = text.replace(before, after)
    path.write_text(text, encoding="utf-8")


DISTANCE = (
    "platform: uav_fixed_wing",
    "platform: {use: uav_fixed_wing, distance: 40 m}",
)


def test_equal_specs_differ_in_nothing(files: tuple[Path, Path]) -> None:
    data = diff(*files, PLAIN)
    assert data.causes == ()
    assert data.payload == ()
    assert headline(data) == (
        "Nothing in the files differs: same payload, still meets its requirements."
    )


def test_one_change_names_cause_payload_and_price(files: tuple[Path, Path]) -> None:
    """Oracle: the price difference of the two verdicts, checked by themselves."""
    old, new = files
    change(new, DISTANCE)
    data = diff(old, new, PLAIN)
    before, after = check_file(old, PLAIN).to_json(), check_file(new, PLAIN).to_json()
    assert [(c.key, c.old, c.new) for c in data.causes] == [
        ("stages[uav].distance", "100 m", "40 m")
    ]
    assert [part.key for part in on_diff(data).sections][:2] == ["margins", "causes"]
    cost = next(s for s in data.sums if s.name == "cost")
    assert cost.change == after["design"]["cost"] - before["design"]["cost"] != 0
    roles = [entry.role for entry in data.payload]
    sensors = [
        f"uav.{role}"
        for role, entry in before["design"]["stages"][0]["roles"].items()
        if entry["sensor"] != after["design"]["stages"][0]["roles"][role]["sensor"]
    ]
    assert roles == sensors
    assert roles
    words = headline(data)
    assert words.startswith("stages[uav].distance 100 m to 40 m: payload changes, \u2212")
    assert words.endswith("still meets its requirements.")


TVU = "  - {id: TVU-1, kind: tvu, limit: {a: AAA, b: 0.002, of: 90 m}}\n"


def test_a_decimetre_less_changes_the_payload_and_the_difference_says_why(
    files: tuple[Path, Path],
) -> None:
    """Limits with their unit, sqrt(a^2 + (0.002 90 m)^2), and the value of the
    payload that the tighter limit rules out."""
    first = "  - {id: COST-1"
    for file, a in zip(files, ("0.5 m", "0.4 m"), strict=True):
        change(file, (first, TVU.replace("AAA", a) + first), ("0.30 m", "2 m"),
               (", ublox_f9p_pvt", ""), (", riegl_vux1uav", ""), ("hardware, ", ""))  # fmt: skip
    stored = [file.with_suffix(".json") for file in files]
    for file, to in zip(files, stored, strict=True):
        to.write_text(json_text(check_file(file, PLAIN).to_json()), encoding="utf-8")
    limits = [math.hypot(a, 0.18) for a in (0.5, 0.4)]
    data = diff(*stored, PLAIN)
    [cause] = data.causes
    assert cause.key == "requirements[TVU-1].limit"
    assert (cause.old, cause.new) == tuple(f"{1e3 * one:.1f} mm" for one in limits)
    assert data.payload
    [row] = [one for one in data.requirements if one.id == "TVU-1"]
    assert row.old is not None
    assert row.old.value is not None
    assert limits[1] < row.old.value < limits[0]
    assert data.outgrown == ("TVU-1",)
    why = f"What was chosen before has TVU-1 at {1e3 * row.old.value:.1f}\N{NO-BREAK SPACE}mm; the"
    assert why in " ".join(on_diff(data).sentences)
    back = diff(*stored[::-1], PLAIN)
    assert (back.outgrown, back.admitted) == (None, ("TVU-1",))


def test_several_changes_say_which_one_does_it(files: tuple[Path, Path]) -> None:
    old, new = files
    change(new, DISTANCE, ("limit: 0.30 m", "limit: 0.15 m"))
    data = diff(old, new, PLAIN)
    effects = {c.key: c.effect.verdict.new for c in data.causes if c.effect is not None}
    assert effects == {
        "requirements[ACC-1].limit": "infeasible",
        "stages[uav].distance": "meets",
    }
    assert data.exit_code == 0
    assert "alone: now has no design that meets its requirements" in console(on_diff(data))


def test_a_key_that_was_taken_out_is_tried_alone_too(files: tuple[Path, Path]) -> None:
    """A waiver that is gone turns the verdict, the other change does not."""
    old, new = files
    kept = "limit: 100 EUR, waiver: {reason: paper, expires: 2999-01-31}"
    change(old, ("limit: 100000 EUR", kept))
    change(new, ("limit: 100000 EUR", "limit: 100 EUR"), DISTANCE)
    data = diff(old, new, PLAIN)
    effects = {c.key: c.effect and c.effect.verdict for c in data.causes}
    gone, nearer = effects["requirements[COST-1].waiver"], effects["stages[uav].distance"]
    assert gone is not None
    assert nearer is not None
    assert (gone.old, gone.new) == ("meets", "infeasible")
    assert nearer.new == "meets"


def test_a_simulated_limit_alone_does_what_checking_it_alone_says(files: tuple[Path, Path]) -> None:
    """Its verdict alone is that of `check` on a spec with nothing but that change."""
    old, new = files
    text = (ROOT / "specs" / "usv_mapping.yaml").read_text("utf-8")
    old.write_text(text, "utf-8")
    new.write_text(text, "utf-8")
    tighter = ("quantile: 0.95, limit: 0.25 m", "quantile: 0.95, limit: 20 cm")
    change(new, tighter, ("limit: 36000 EUR", "limit: 35000 EUR"))
    found = diff(old, new)
    effects = {one.key: one.effect for one in found.causes}
    alone = effects["requirements[MC-1].limit"]
    assert alone is not None
    change(old, tighter)
    assert alone.verdict.new == check_file(old).verdict == "fails"
    assert "MC-1" in [one.id for one in alone.requirements]
    other = effects["requirements[COST-1].limit"]
    assert other is not None
    assert (other.verdict.old, other.verdict.new) == ("meets", "meets")


def test_the_exit_code_is_that_of_the_new_one(files: tuple[Path, Path]) -> None:
    old, new = files
    change(new, ("limit: 0.30 m", "limit: 1 mm"))
    assert diff(old, new, PLAIN).exit_code == 1
    assert diff(new, old, PLAIN).exit_code == 0
    assert "now has no design that meets its requirements" in headline(diff(old, new, PLAIN))


def test_verdict_files_compare_like_their_specs(files: tuple[Path, Path]) -> None:
    old, new = files
    change(new, DISTANCE)
    saved = []
    for path in files:
        target = path.with_suffix(".json")
        target.write_text(json_text(check_file(path, PLAIN).to_json()), encoding="utf-8")
        saved.append(target)
    of_specs, of_files = diff(old, new, PLAIN), diff(*saved)
    mixed = diff(old, saved[1], PLAIN)
    for key in ("verdict", "payload", "sums", "error", "exit_code"):
        assert getattr(of_specs, key) == getattr(of_files, key) == getattr(mixed, key)
    keys = {"stages[uav].distance_m"}
    assert {c.key for c in of_files.causes} == keys


def test_a_catalog_price_is_a_cause(files: tuple[Path, Path], tmp_path: Path) -> None:
    old, new = files
    entry = (
        "sensors:\n  own_ins: {{modality: attitude, type: ins, sigma_attitude: 0.02 deg, "
        "primitives: [pps], cost: {cost} EUR, mass: 1 kg, power: 1 W}}\n"
    )
    for path, cost in zip(files, (100, 150), strict=True):
        name = f"{path.stem}_sensors.yaml"
        (tmp_path / name).write_text(entry.format(cost=cost), encoding="utf-8")
        change(path, ("[sbg_apogee, sbg_ellipse]", "[own_ins]"))
        path.write_text(path.read_text() + f"catalogs: [{name}]\n", encoding="utf-8")
    data = diff(old, new, PLAIN)
    causes = {c.key: (c.old, c.new) for c in data.causes}
    assert causes["catalog.sensors[own_ins].cost"] == ("100 EUR", "150 EUR")
    cost = next(s for s in data.sums if s.name == "cost")
    assert cost.change == 50.0


def test_candidates_requirements_and_stages_that_come_and_go(files: tuple[Path, Path]) -> None:
    old, new = files
    change(
        new,
        ("[sbg_apogee, sbg_ellipse]", "[sbg_apogee]"),
        ("  - {id: COST-1, kind: cost, limit: 100000 EUR}\n", ""),
    )
    causes = {c.key: (c.old, c.new) for c in diff(old, new, PLAIN).causes}
    assert causes["stages[uav].attitude.candidates"] == (
        '["sbg_apogee", "sbg_ellipse"]', '["sbg_apogee"]',
    )  # fmt: skip
    assert causes["requirements[COST-1]"][1] is None


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("x.json", "{", "not JSON"),
        ("x.json", "[]", "not a verdict"),
        ("x.json", '{"verdict": "meets"}', "not a verdict"),
        ("x.json", "[" * 100_000, "nested too deeply|not JSON"),
        ("x.json", "\xff", "not a verdict|not JSON"),
        ("x.yaml", "", "an empty file"),
        ("gone.yaml", None, "cannot read the file"),
        ("gone.json", None, "cannot read the file"),
    ],
)
def test_files_that_are_no_designs_are_refused(
    files: tuple[Path, Path], tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(BadInput, match=message) as caught:
        diff(files[0], tmp_path / name, PLAIN)
    assert name in str(caught.value)


def test_every_format_is_written(files: tuple[Path, Path]) -> None:
    change(files[1], ("limit: 0.30 m", "limit: 1 mm"), ("name: Small UAV", 'name: "x\\n::error::"'))
    data = diff(*files, PLAIN)
    written = {name: render_diff(name, data) for name in DIFF_FORMATS}
    assert json.loads(written["json"])["schema"] == "syncline-design/diff/v1"
    assert written["markdown"].startswith("## ")
    [line] = written["github"].splitlines()
    assert line.startswith("::error file=")


def _priced(path: Path, currency: str, rate: float) -> None:
    """The spec with its sums in another currency; 1 EUR is `rate` of it."""
    head, _, tail = SPEC.partition("requirements:\n")
    money = f"currency: {currency}\nexchange_rates: {{EUR: {rate} {currency}}}\n"
    path.write_text(f"{head}{money}requirements:\n{tail}", encoding="utf-8")


@pytest.mark.parametrize("back", [False, True], ids=["to USD", "from USD"])
@pytest.mark.parametrize("stored", [False, True], ids=["specs", "verdict files"])
def test_each_side_keeps_its_currency(
    files: tuple[Path, Path], tmp_path: Path, stored: bool, back: bool
) -> None:
    """Oracle: what each spec costs by itself; the same payload is no dearer in another currency.

    Before, the old side's euros were printed as dollars and subtracted from them.
    """
    _priced(files[1], "USD", 1.17)
    sides = (files[1], files[0]) if back else files
    verdicts = [check_file(side, PLAIN).to_json() for side in sides]
    if stored:
        names = [tmp_path / "old.json", tmp_path / "new.json"]
        for name, verdict in zip(names, verdicts, strict=True):
            name.write_text(json_text(verdict), encoding="utf-8")
        sides = (names[0], names[1])
    data = diff(*sides, PLAIN)
    euros, dollars = (f"{v['design']['cost']:,.2f}".replace(",", " ") for v in verdicts)
    first, second = ("USD", "EUR") if back else ("EUR", "USD")
    shown = [render_diff(name, data) for name in ("markdown", "html")] + [console(on_diff(data))]
    for text in shown:
        plain = text.replace("\N{NO-BREAK SPACE}", " ")
        assert f"{euros} {first}" in plain
        assert f"{dollars} {second}" in plain
        assert f"{euros} {second}" not in plain
    cost = next(entry for entry in data.sums if entry.name == "cost")
    assert (cost.old_unit, cost.unit, cost.change) == (first, second, None)
    assert f"price in {second} (before: {first})" in headline(data)
    limits = next(r for r in data.requirements if r.kind == "cost")
    assert limits.old is not None
    assert limits.new is not None
    assert (limits.old.unit, limits.new.unit) == (first, second)


def test_what_was_taken_out_reads_as_it_was_written(files: tuple[Path, Path]) -> None:
    """Decimals in mappings and lists stood as {"number": "0.95"}; nested ones are no JSON."""
    old, new = files
    line = "  - {id: MC-9, kind: monte_carlo, quantile: 0.950, limit: 0.90 m}\n"
    change(old, ("requirements:\n", "requirements:\n" + line))
    drift = "effects:\n  - {effect: latency, sensor: position, parameters: {latency_s: 0.0010}}\n"
    new.write_text(new.read_text(encoding="utf-8") + drift, encoding="utf-8")
    text = console(on_diff(diff(old, new, PLAIN)))
    assert "quantile 0.950, limit 0.90 m" in text
    assert "parameters (latency_s 0.0010)" in " ".join(text.split())
    assert '"number"' not in text


def test_a_difference_satisfies_its_schema_and_reads_back(files: tuple[Path, Path]) -> None:
    """Real ones: causes tried alone, designs on both sides, none on either."""
    change(files[1], DISTANCE, ("limit: 0.30 m", "limit: 0.15 m"))
    several = diff(*files, PLAIN)
    change(files[1], ("limit: 0.15 m", "limit: 1 mm"))
    schema = schema_of(Diff, SCHEMA, "diff")
    jsonschema.Draft202012Validator.check_schema(schema)
    for found in (several, diff(*files, PLAIN), diff(files[1], files[1], PLAIN)):
        text = json_text(found.to_json())
        jsonschema.validate(json.loads(text), schema)
        assert read_as(Diff, text) == found


def _stored(spec: Path) -> Path:
    """The verdict on a spec, as `check` writes it, beside the spec."""
    target = spec.with_suffix(".json")
    target.write_text(json_text(check_file(spec, PLAIN).to_json()), encoding="utf-8")
    return target


RMSE = "{{id: RMS-1, kind: rmse, axis: {}, limit: 9 m}}"
WAIVER = "waiver: {reason: trial, expires: 2199-01-01}"
LATENCY = "effects:\n  - {effect: latency, sensor: attitude, parameters: {latency_s: 17 us}}\n"


@pytest.mark.parametrize(
    ("before", "after", "key"),
    [
        ("stages:\n", "horizon: {duration: 7 h}\nstages:\n", "horizon.duration_s"),
        ("stages:\n", LATENCY + "stages:\n", "effects.latency (uav.attitude)"),
        ("limit: 0.30 m", f"limit: 0.30 m, {WAIVER}", "requirements[ACC-1].waiver"),
        ("id: ACC-1", "id: ACC-7", "requirements[ACC-7]"),
        ("kind: cost, limit: 100000 EUR", "kind: mass, limit: 90 kg", "requirements[COST-1].kind"),
        (RMSE.format("3d"), RMSE.format("vertical"), "requirements[RMS-1].axis"),
        ("name: Small", "name: Tiny", "spec (hash)"),
    ],
    ids=["horizon", "effect", "waiver", "id", "kind", "axis", "what verdicts do not repeat"],
)
def test_verdict_files_never_differ_in_nothing(
    files: tuple[Path, Path], before: str, after: str, key: str
) -> None:
    """Two verdicts on specs that differ were said to differ in nothing, whatever they showed."""
    if "RMS-1" in before:
        for path in files:
            change(path, ("requirements:\n", f"requirements:\n  - {before}\n"))
    change(files[1], (before, after))
    found = diff(_stored(files[0]), _stored(files[1]))
    assert key in {cause.key for cause in found.causes}
    assert "Nothing" not in headline(found)


@pytest.mark.parametrize("stored", [False, True], ids=["specs", "verdict files"])
def test_a_waived_requirement_reads_waived(files: tuple[Path, Path], stored: bool) -> None:
    """It stood as `fail` below the headline `Meets every requirement`."""
    fails = (ROOT / "specs" / "better_sensor_worse_payload.yaml").read_text(encoding="utf-8")
    for path in files:
        path.write_text(fails, encoding="utf-8")
    change(files[1], ("kind: sync, limit: 1.0", f"kind: sync, limit: 1.0, {WAIVER}"))
    sides = tuple(_stored(path) for path in files) if stored else files
    found = diff(*sides, PLAIN)
    row = next(entry for entry in found.requirements if entry.id == "SYNC-1")
    assert (row.old and row.old.status, row.new and row.new.status) == ("fail", "fail")
    assert (row.old and row.old.waived, row.new and row.new.waived) == (None, True)
    shown = next(line for line in console(on_diff(found)).splitlines() if "  SYNC-1" in line)
    assert shown.count("fail") == 1
    assert shown.count("waived") == 1


@pytest.mark.parametrize(
    ("wrong", "where", "found"),
    [
        ({"schema": "syncline-design/verdict/v2"}, "schema", "verdict/v2"),
        ({"schema": "syncline-design/optimization/v1"}, "schema", "optimization/v1"),
        ({"schema": None}, "schema", "None"),
        ({"verdict": "refused"}, "verdict", "refused"),
        ({"horizon": None}, "horizon", ""),
    ],
)
def test_only_a_verdict_of_this_version_is_read(
    files: tuple[Path, Path], wrong: dict[str, str | None], where: str, found: str
) -> None:
    """A `verdict/v2` was read as v1, and other results were refused for a key that they lack."""
    stored = _stored(files[0])
    told = json.loads(stored.read_text(encoding="utf-8")) | wrong
    stored.write_text(json_text(told), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        diff(stored, stored)
    (flaw,) = caught.value.problems
    assert (flaw.path, found in flaw.found) == (where, True)


def test_a_verdict_of_an_earlier_state_says_so(files: tuple[Path, Path]) -> None:
    stored = _stored(files[0])
    told = json.loads(stored.read_text(encoding="utf-8"))
    del told["horizon"]
    stored.write_text(json_text(told), encoding="utf-8")
    with pytest.raises(BadInput, match="horizon: missing; perhaps an earlier syncline-design"):
        diff(stored, stored)


def test_the_catalogs_are_read_once_for_each_file(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They were parsed anew for every change that is tried alone."""
    change(files[1], DISTANCE, ("limit: 0.30 m", "limit: 0.15 m"))
    read: list[Path] = []
    plain = comparison_diff.catalogs_of

    def counted(document: ParsedFile, path: Path) -> Collection:
        read.append(path)
        return plain(document, path)

    monkeypatch.setattr(comparison_diff, "catalogs_of", counted)
    assert len(diff(*files, PLAIN).causes) == 2
    assert read == list(files)


WORDS = {
    "of a list what came and what went": (
        ("stages[uav].ranging.candidates", '["a", "b"]', '["b", "c", "d"]'),
        "stages[uav].ranging.candidates: c, d added and a removed",
    ),
    "of a list in another order both": (("x", '["a", "b"]', '["b", "a"]'), "x a, b to b, a"),
    "no list": (("x", '["a"]', "[]"), "x: a removed"),
    "a stage": (
        (
            "stages[auv]", None,
            '{"name": "auv", "platform": {"use": "auv", "distance": "6 m"}, '
            '"ranging": {"candidates": ["m3", "r2"], "per_mission": true}}',
        ),
        "stages[auv] added (name auv, platform (use auv, distance 6 m), "
        "ranging (candidates [m3, r2], per_mission yes))",
    ),
    "digits as they are written": (
        ("requirements[A]", '{"id": "A", "kind": "mass", "limit": 0.50}', None),
        "requirements[A] removed (kind mass, limit 0.50)",
    ),
    "a text": (("x", "100 m", "60 m"), "x 100 m to 60 m"),
    "a mapping": (("x", '{"a": 1.0, "b": null}', "y"), "x a 1.0, b none to y"),
}  # fmt: skip


@pytest.mark.parametrize(("cause", "words"), WORDS.values(), ids=WORDS.keys())
def test_mappings_and_lists_are_said_in_words(
    cause: tuple[str, str | None, str | None], words: str
) -> None:
    assert cause_words(Cause(*cause)) == words


def test_a_longer_list_of_candidates_is_no_json(files: tuple[Path, Path]) -> None:
    change(files[0], ("[hardware, gpio]", "[hardware]"))
    told = headline(diff(*files, PLAIN))
    assert "gpio added" in told
    assert "[" not in told.replace("stages[uav]", "")
