"""Effects that look alike: fair refits inside a class, the best named, and what the evidence is.

Truth and Cramer-Rao bounds are the hidden world's own.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import chi2

from diagnosis_samples import LATENCY, diagnosis
from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.candidates import candidates, directed_parts, signatures
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import data_of, fit
from syncline_design.diagnosis.identify import competed
from syncline_design.diagnosis.result import Rival
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.trials import with_effect
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.spec.load import load
from tests.world import Hidden, WorldLog, hidden, make_log, scenario

Document = dict[str, Any]
EXACT = 0.9999


def ask(log: WorldLog, folder: Path) -> Document:
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    document: Document = diagnose(
        spec, [log.to_csv(folder / "log.csv")], DiagnosisSettings()
    ).to_json()
    return document


def pairs(entries: list[Document]) -> set[tuple[str, str]]:
    return {(entry["effect"], entry["sensor"]) for entry in entries}


@pytest.mark.parametrize(("platform", "sensor"), [("car_stops", "position"),
                                                  ("multirotor_lines", "ranging")])  # fmt: skip
def test_an_exact_alias_is_one_and_fits_as_well(platform: str, sensor: str, tmp_path: Path) -> None:
    """Without a time shift a lever arm of the antenna is that of the scanner, sign turned.

    1500 rows: the noise is fitted on part of them only.
    """
    arm = hidden("lever_arm", sensor, x_m=0.15, y_m=-0.1, z_m=0.12)
    document = ask(make_log(scenario(platform, 17, 150.0, 10.0), (arm,)), tmp_path)
    (finding,) = document["findings"]
    other = ({"position", "ranging"} - {finding["sensor"]}).pop()
    assert finding["effect"] == "lever_arm"
    (alias,) = [a for a in finding["aliases"] if a["effect"] == "lever_arm"]
    assert alias["sensor"] == other
    assert abs(alias["nats_worse"]) < 0.5
    assert not [a for a in finding["excluded"] if a["cosine"] > EXACT]


DELAYS = (
    ("fixed_wing_circuits", 3, hidden("latency", "position", latency_s=0.05)),
    ("car_stops", 21, hidden("latency", "position", latency_s=0.02)),
    ("vessel_figure_eights", 6, hidden("latency", "attitude", latency_s=0.12)),
    ("multirotor_lines", 9, hidden("latency", "ranging", latency_s=0.015)),
)


@pytest.mark.parametrize(("platform", "seed", "delay"), DELAYS)
def test_a_plain_delay_is_called_one(
    platform: str, seed: int, delay: Hidden, tmp_path: Path
) -> None:
    """And nothing that fits better by more than its freedom is listed beside it."""
    document = ask(make_log(scenario(platform, seed, 80.0, 5.0), (delay,)), tmp_path)
    (finding,) = document["findings"]
    assert (finding["effect"], finding["sensor"]) == (delay.effect, delay.sensor)
    for other in finding["aliases"]:
        assert other["nats_worse"] > -2.0
    for other in finding["excluded"]:
        assert other["cosine"] < 0.99
        assert other["nats_worse"] > 0.0


def test_a_lag_that_is_no_delay_is_called_a_lag(tmp_path: Path) -> None:
    """A slow filter on a multirotor that turns round: 0.25 s against manoeuvres of a second."""
    lag = hidden("filter_lag", "position", time_constant_s=0.25)
    document = ask(make_log(scenario("multirotor_lines", 31, 120.0, 5.0), (lag,)), tmp_path)
    assert ("filter_lag", "position") in pairs(document["findings"])


FAULTS = (
    (
        hidden("elevation_bias", "ranging", bias_rad=0.002),
        hidden("latency", "position", latency_s=0.045),
    ),
    (
        hidden("range_bias", "ranging", bias_m=0.06),
        hidden("latency", "position", latency_s=0.02),
    ),
)
BOUNDS = 14.0


@pytest.mark.parametrize("faults", FAULTS)
def test_evidence_is_what_leaving_an_effect_out_costs(
    faults: tuple[Hidden, ...], tmp_path: Path
) -> None:
    """0.5 (value / bound)^2 nat to first order, the bound being Cramer and Rao's with both free.

    Faults of 14 bounds each: 98 nat.  Noise that may take up part of what is left out makes it
    cheaper, by less than 60 %; luck of four standard errors is allowed on either side.
    """
    run = scenario("multirotor_lines", 8, 120.0, 5.0)
    first = make_log(run, faults).cramer_rao()
    faults = tuple(
        fault.with_values({name: BOUNDS * first[k, name] for name, _ in fault.parameters})
        for k, fault in enumerate(faults)
    )
    log = make_log(run, faults)
    bounds, document = log.cramer_rao(), ask(log, tmp_path)
    found = {(f["effect"], f["sensor"]): f for f in document["findings"]}
    assert set(found) == {(fault.effect, fault.sensor) for fault in faults}
    for (index, name), bound in bounds.items():
        finding = found[faults[index].effect, faults[index].sensor]
        ratio = faults[index].number(name) / bound
        assert 0.2 * (ratio - 4.0) ** 2 < finding["gain_nat"] < 0.5 * (ratio + 4.0) ** 2
        if finding["gain_nat"] < 300.0:
            log10_p = float(chi2.logsf(2.0 * finding["gain_nat"], 1)) / math.log(10.0)
            assert finding["log10_p"] == pytest.approx(log10_p, rel=1e-6)
    ranked = [finding["gain_nat"] for finding in document["findings"]]
    assert ranked == sorted(ranked, reverse=True)


WRONG = (
    (hidden("latency", "attitude", latency_s=0.06), ("range_scale", "ranging")),
    (hidden("heading_bias", "attitude", bias_rad=0.01), ("clock_drift", "position")),
    (hidden("range_bias", "ranging", bias_m=0.2), ("heading_drift", "attitude")),
)


@pytest.mark.parametrize(("truth", "wrong"), WRONG)
def test_a_better_name_of_another_signature_takes_the_place(
    truth: Hidden, wrong: tuple[str, str], tmp_path: Path
) -> None:
    """A search that took a wrong turn: whatever fits better by far competes, alike or not."""
    run = scenario("multirotor_lines", 12, 60.0, 5.0)
    (tmp_path / "spec.yaml").write_text(make_log(run, (truth,)).spec_yaml(), encoding="utf-8")
    log = make_log(run, (truth,)).to_csv(tmp_path / "log.csv")
    inputs = measured(load(tmp_path / "spec.yaml"), [log])
    view = scene(inputs.system, inputs.log, inputs.known)
    data = data_of(view, structure_of(view, directed_parts(view, candidates(view))))
    found = signatures(view, candidates(view))
    start = next(s for s in found if s.candidate.label[:2] == wrong)
    named = with_effect(data, fit(data, (), ()), start, fit(data, (), ()).level)
    settled, compared = competed(data, named, start.candidate.label, found)
    assert [label[:2] for label in settled.labels] == [(truth.effect, truth.sensor)]
    assert settled.nll < named.nll - 20.0
    for other in (*compared.aliases, *compared.lookalikes):
        assert other.loss > -2.0 or not other.possible


def test_words_follow_the_sign_of_the_comparison() -> None:
    """What fits better is never said to fit worse, on the console or on the page."""
    better = Rival("packetised_timestamps", "attitude", "rig", 0.97, -157.4, possible=False)
    as_well = Rival("latency", "attitude", "rig", 0.6, -0.8)
    worse = Rival("filter_lag", "position", "rig", 0.999, 31.6)
    bent = Rival("flexure", "ranging", "rig", 0.995, -12.3, possible=False)
    found = diagnosis(findings=(replace(LATENCY, lookalikes=(better, bent, as_well, worse)),))
    for render in (html, console, markdown):
        told = re.sub(r"<[^>]+>|\\", "", render(on_diagnosis(found)))
        said = " ".join(told.replace("\u00a0", " ").split())
        assert "-157" not in said
        assert "filter lag (position), 31.6 nat worse" in said
        assert "157 nat better, but this log does not scatter as it would have to" in said
        assert "12.3 nat better, but only with impossible values" in said
        assert "latency (attitude), as well in its place" in said
