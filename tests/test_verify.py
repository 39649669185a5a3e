"""Verdicts: limits met exactly or just missed, effects, waivers, warnings, lever arms."""

from __future__ import annotations

import json
import math
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from syncline_design.simulation.figures import error_statistics
from syncline_design.simulation.run import own_worst_case
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

PINNED = """\
syncline: 1
name: pinned
requirements:
  - {{id: ACC-1, kind: accuracy, limit: {limit}}}
{requirements}
stages:
  - name: uav
    platform: {{v_max: 20 m/s, omega_max: 60 deg/s, distance: 50 m, baseline: {baseline}}}
    position:
      sensor: {{modality: position, sigma_position: [3 cm, 4 cm, 12 cm], primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: {tau}}}}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
{more}"""

SENSOR_ERROR = 0.13 + 0.01 + (math.sqrt(3) + math.sqrt(2)) * math.radians(0.1) * 50
SYNC_RATE = 20 + 50 * math.radians(60)


def checked(
    *,
    limit: str = "1 m",
    tau: str = "1 ms",
    requirements: str = "",
    more: str = "",
    baseline: str = "1 m",
    **settings: Any,
) -> Verdict:
    """The verdict of one pinned system, worked out by hand above."""
    text = PINNED.format(
        limit=limit, tau=tau, requirements=requirements, more=more, baseline=baseline
    )
    return check_loaded(load_text(text, "pinned.yaml"), CheckSettings(**settings))


def check(**keys: Any) -> dict[str, Any]:
    """The same as it is written."""
    return checked(**keys).to_json()


def requirement(verdict: dict[str, Any], identity: str) -> dict[str, Any]:
    (found,) = [r for r in verdict["requirements"] if r["id"] == identity]
    return found


def test_the_syncline_part_is_what_the_paper_s_formulas_give_by_hand() -> None:
    found = check()["syncline"]
    assert found["sensor_error_m"] == pytest.approx(SENSOR_ERROR, rel=1e-14)
    assert found["sync_rate_mps"] == pytest.approx(SYNC_RATE, rel=1e-14)
    assert found["tau_s"] == 1e-3
    assert found["tau_crit_s"] == pytest.approx(SENSOR_ERROR / SYNC_RATE, rel=1e-14)
    assert found["total_m"] == pytest.approx(SENSOR_ERROR + SYNC_RATE * 1e-3, rel=1e-14)
    assert found["models"]["per_sensor"]["sync_error_m"] == pytest.approx(20e-3, rel=1e-14)
    ledger = sum(term["value_m"] for term in found["ledger"])
    assert ledger == pytest.approx(found["total_m"], rel=1e-14)


def test_every_key_of_the_interface_is_there_and_is_json() -> None:
    verdict = json.loads(json.dumps(check(), allow_nan=False))
    assert {"schema", "verdict", "requirements", "design", "syncline", "monte_carlo"} <= set(
        verdict
    )
    assert verdict["schema"] == "syncline-design/verdict/v1"
    assert set(verdict["provenance"]) >= {"version", "spec_sha256", "catalogs_sha256", "seed"}
    assert set(verdict["monte_carlo"]["quantiles"]) == {"0.5", "0.95", "0.997"}
    role = verdict["design"]["stages"][0]["roles"]["position"]
    assert set(role) >= {"sensor", "primitive", "timestamping", "tau_s", "tau_crit_s"}
    assert role["tau_crit_s"] == pytest.approx(0.13 / 20, rel=1e-14)


def test_a_limit_met_exactly_passes_and_one_missed_by_1e_12_fails() -> None:
    total = check()["syncline"]["total_m"]
    assert requirement(check(limit=f"{total!r} m"), "ACC-1")["status"] == "pass"
    short = checked(limit=f"{total * (1 - 1e-12)!r} m")
    assert requirement(short.to_json(), "ACC-1")["status"] == "fail"
    assert short.verdict == "fails"
    assert short.exit_code == 1


def test_sync_is_strict_and_implied_when_the_spec_is_silent() -> None:
    implied = requirement(check(), "SYNC")
    assert implied["implied"]
    assert implied["limit"] == 1.0
    assert implied["value"] == pytest.approx(
        max(20e-3 / 0.13, SYNC_RATE * 1e-3 / SENSOR_ERROR), rel=1e-12
    )
    exactly = check(tau="6.5 ms", requirements="  - {id: S, kind: sync, limit: 1.0}")
    assert requirement(exactly, "S")["status"] == "fail"  # tau_pos = 0.13 / 20 s, not below


def test_a_written_sync_requirement_may_relax_the_implied_one() -> None:
    relaxed = check(tau="6.5 ms", requirements="  - {id: S, kind: sync, limit: 5.0}")
    assert relaxed["verdict"] == "meets"
    assert not any(r["implied"] for r in relaxed["requirements"])


def test_a_known_latency_raises_tau_and_a_known_bias_the_systematic_part() -> None:
    plain = check()
    late = check(
        more="effects:\n  - {effect: latency, sensor: position, parameters: {latency_s: 2 ms}}\n"
    )
    assert late["syncline"]["tau_s"] == pytest.approx(3e-3, rel=1e-14)
    assert late["effects"][0]["sentence"] == "position data are 2 ms older than their stamps"
    biased = check(
        more="effects:\n  - {effect: range_bias, sensor: ranging, parameters: {bias_m: 0.25}}\n"
    )
    added = biased["syncline"]["total_m"] - plain["syncline"]["total_m"]
    assert added == pytest.approx(0.25, rel=1e-12)
    median = "0.5"
    assert (
        biased["monte_carlo"]["quantiles"][median]["value_m"]
        > plain["monte_carlo"]["quantiles"][median]["value_m"]
    )


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{effect: latencyy, sensor: position, parameters: {latency_s: 2 ms}}", "latency?"),
        ("{effect: latency, sensor: target, parameters: {latency_s: 2 ms}}", "does not act"),
        ("{effect: latency, sensor: position, parameters: {bias_m: 2 mm}}", "unknown parameter"),
        ("{effect: range_bias, sensor: ranging, parameters: {}}", "missing parameter bias_m"),
        (
            "{effect: frame_convention, sensor: position, parameters: {convention: upside_down}}",
            "not one of the choices",
        ),
    ],
)
def test_an_effect_that_does_not_exist_or_fit_is_refused_at_its_line(
    entry: str, words: str
) -> None:
    with pytest.raises(BadInput, match=words) as refused:
        check(more=f"effects:\n  - {entry}\n", requirements="  # none")
    line = PINNED.count("\n") + 2  # the entry stands below `effects:`, which follows all else
    assert {problem.line for problem in refused.value.problems} == {line}


def test_a_waiver_in_force_covers_a_failure_and_an_expired_one_does_not() -> None:
    waived = (
        "  - {id: M, kind: monte_carlo, quantile: 0.95, limit: 1 mm, "
        "waiver: {reason: trial, expires: 2026-12-31}}"
    )
    before = check(requirements=waived, today=date(2026, 12, 31))
    assert before["verdict"] == "meets"
    assert requirement(before, "M")["status"] == "fail"
    after = check(requirements=waived, today=date(2027, 1, 1))
    assert after["verdict"] == "fails"
    assert any(w["code"] == "waiver" for w in after["warnings"])


def test_the_lever_arm_is_warned_of_only_where_it_changes_more_than_a_tenth() -> None:
    assert not [w for w in check(baseline="1 cm")["warnings"] if w["code"] == "lever-arm"]
    warned = [w for w in check(baseline="10 m")["warnings"] if w["code"] == "lever-arm"]
    assert any("uav.position" in w["message"] for w in warned)


def test_a_monte_carlo_requirement_is_undecided_without_simulation() -> None:
    verdict = checked(
        requirements="  - {id: M, kind: monte_carlo, quantile: 0.95, limit: 1 m}",
        monte_carlo=False,
    )
    assert verdict.verdict == "indeterminate"
    assert verdict.exit_code == 3


def test_the_same_spec_and_seed_give_the_same_verdict_and_another_seed_other_samples() -> None:
    first, other = check(seed=1), check(seed=2)
    own_worst_case.cache_clear()  # computed anew, not remembered
    error_statistics.cache_clear()
    again = check(seed=1)
    assert json.dumps(first) == json.dumps(again)
    assert first["monte_carlo"]["quantiles"] != other["monte_carlo"]["quantiles"]


def test_an_open_spec_falls_back_to_the_next_design_that_passes_monte_carlo(tmp_path: Path) -> None:
    text = (Path(__file__).parent.parent / "specs" / "uav_corridor.yaml").read_text("utf-8")
    loaded = load_text(text, "specs/uav_corridor.yaml")
    cheapest = check_loaded(loaded, CheckSettings()).to_json()
    value = requirement(cheapest, "MC-1")["value"]
    tighter = text.replace("limit: 0.40 m", f"limit: {value - 0.004:.4f} m").replace(
        "limit: 65000 EUR", "limit: 165000 EUR"
    )
    verdict = check_loaded(load_text(tighter, "specs/uav_corridor.yaml"), CheckSettings()).to_json()
    assert verdict["verdict"] == "meets"
    assert verdict["design"]["cost"] > cheapest["design"]["cost"]
    assert verdict["warnings"][0]["code"] == "passed-over"
