"""Catalog entries that were measured: their bound is tau, their claim is shown and held to."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

from syncline_design.machine.records import read_as
from syncline_design.model import timing
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.report.result_schemas import result_schema
from syncline_design.report.schema import schema_text
from syncline_design.spec.load import BadInput, load
from syncline_design.spec.yaml_text import read
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = """\
syncline: 1
name: one stage
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.30 m}
  - {id: SYNC-1, kind: sync, limit: 1.0}
catalogs: [own.yaml]
%s
stages:
  - name: uav
    platform: {v_max: 20 m/s, omega_max: 0.001 deg/s, distance: 0.1 m, baseline: 0 m}
    position: {sensor: {modality: position, sigma_position: 1 cm, primitives: []},
               timestamping: own}
    attitude: {sensor: {modality: attitude, sigma_attitude: 0.01 deg, primitives: []},
               timestamping: exact}
    ranging: {sensor: {modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.01 deg,
              primitives: []}, timestamping: exact}
"""
CATALOG = """\
timestamping:
  exact:
    primitives: [arrival]
    error: {distribution: constant, value: 0 s}
  own:
    primitives: [arrival]
    error:
      distribution: empirical
      values: [-1 us, 3 us, 2 us]
%s
"""
CLAIM = ("claim: {coverage: %s, session_share: 0.95, confidence: 0.95, sessions: 7, hours: 56, "
         "rests_on: %s}")  # fmt: skip


def _keys(*lines: str) -> str:
    return "\n".join(f"      {line}" for line in lines)


def _load(folder: Path, *keys: str, extra: str = "") -> Path:
    (folder / "own.yaml").write_text(CATALOG % _keys(*keys), "utf-8")
    path = folder / "spec.yaml"
    path.write_text(SPEC % extra, "utf-8")
    return path


def _check(folder: Path, *keys: str, extra: str = "") -> Verdict:
    return check_loaded(load(_load(folder, *keys, extra=extra)), CheckSettings(monte_carlo=False))


def test_the_measured_bound_is_tau_everywhere(tmp_path: Path) -> None:
    """Its own values end at 3 us; 20 m/s for 4 ms are 8 cm."""
    found = _check(tmp_path, "bound: 4 ms", CLAIM % (0.9973, "independent"))
    assert found.syncline is not None
    assert found.syncline.tau_s == pytest.approx(4e-3, rel=1e-12)
    assert found.syncline.sync_error_m == pytest.approx(0.08, rel=1e-4)
    assert found.measured is not None
    assert found.measured[0].bound_s == 4e-3
    without = _check(tmp_path)
    assert without.syncline is not None
    assert without.syncline.tau_s == pytest.approx(3e-6, rel=1e-12)
    assert without.measured is None
    assert "measured" not in without.to_json()


def test_a_measured_bound_flips_the_verdict(tmp_path: Path) -> None:
    """tau_crit of the position is its error over its rate: sqrt(3) cm over 20 m/s, 866 us."""
    crit = 0.01 * 3**0.5 / 20.0
    for bound_s, word in ((0.95 * crit, "meets"), (1.05 * crit, "fails")):
        found = _check(tmp_path, f"bound: {bound_s * 1e6:.6f} us")
        assert found.verdict == word


def test_the_worst_case_reaches_to_the_bound_on_both_sides() -> None:
    error = timing.TimingError(timing.Empirical((1e-6, 2e-6)), bound_s=5e-6)
    assert timing.bound(error) == 5e-6
    assert timing.support(error) == (-5e-6, 5e-6)
    drifted = timing.TimingError(timing.Empirical((1e-6,)), drifted_s=1e-6, bound_s=5e-6)
    assert timing.bound(drifted) == pytest.approx(6e-6)


@pytest.mark.parametrize(
    ("claim", "extra", "codes"),
    [
        (CLAIM % (0.9973, "independent"), "", set()),
        (CLAIM % (0.95, "independent"), "", {"measured-claim"}),
        (CLAIM % (0.95, "independent"), "coverage_factor: 2", set()),
        (CLAIM % (0.9, "independent"), "coverage_factor: 2", {"measured-claim"}),
        (CLAIM % (0.9973, "servo"), "", {"measured-servo"}),
        (CLAIM % (0.9973, "servo_and_declared"), "", set()),
        (CLAIM % (0.9973, "independent"), "horizon: {duration: 9 h}", {"measured-horizon"}),
        (CLAIM % (0.9973, "independent"), "horizon: {duration: 8 h}", set()),
        ("claim: {coverage: 0.9973, made: false}", "", {"measured-claim"}),
    ],
)
def test_a_claim_is_held_against_the_spec(
    claim: str, extra: str, codes: set[str], tmp_path: Path
) -> None:
    found = _check(tmp_path, "bound: 1 ms", claim, extra=extra)
    said = {one.code for one in found.warnings if one.code.startswith("measured")}
    assert said == codes | {"measured-unchecked"}  # as these have no digest


def test_outputs_say_that_it_was_measured(tmp_path: Path) -> None:
    digest = "0123456789abcdef" * 4
    found = _check(
        tmp_path, "bound: 1 ms", CLAIM % (0.95, "servo"), "conditions: in the van, 20 deg",
        f"evidence: [{{file: tracking.log, sha256: {digest}}}]",
        "events: [{kind: unlock, count: 2, largest: 3 ms}, {kind: step, size_s: 1e-3, "
        "from: 2026-01-01T00:00:00Z, to: 2026-01-01T00:00:01Z}]",
    )  # fmt: skip
    text = " ".join(console(on_verdict(found)).split())
    assert "Measured timing errors" in text
    assert "95 % of the time in 95 % of sessions of 8 h at 95 % confidence, from 7 sessions" in text
    assert "in the van, 20 deg" in text
    told = json.loads(json.dumps(found.to_json()))
    jsonschema.Draft202012Validator(result_schema("verdict")).validate(told)
    assert read_as(Verdict, json.dumps(told)).measured == found.measured
    (entry,) = told["measured"]
    assert entry["evidence"] == [{"file": "tracking.log", "sha256": digest}]
    assert (entry["entry"], entry["section"], entry["events"]) == ("own", "timestamping", 3)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (("bound: 4",), "bound"),
        (("bound: -4 us",), "out of range"),
        (("bound: 4 us", "calibrated: 1 us"), "beside calibrated"),
        (("claim: {confidence: 0.9}",), "coverage"),
        (("claim: {coverage: 95}",), "coverage"),
        (("evidence: [{file: a.log, sha256: abc}]",), "SHA-256"),
        (("evidences: []",), "evidence"),
    ],
)
def test_slips_in_a_measured_entry_are_named(
    keys: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=words):
        load(_load(tmp_path, *keys))


def test_the_schema_of_catalogs_knows_the_keys(tmp_path: Path) -> None:
    validator = jsonschema.Draft7Validator(json.loads(schema_text("catalog")))
    _load(tmp_path, "bound: 1 ms", CLAIM % (0.95, "servo"), "events: [{kind: gap, from: '2026'}]")
    data = json.loads(json.dumps(read(tmp_path / "own.yaml").data, default=list))
    validator.validate(data)
    data["timestamping"]["own"]["error"]["claim"]["coverage"] = 95
    assert not validator.is_valid(data)
