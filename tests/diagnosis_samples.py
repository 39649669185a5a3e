"""A typed diagnosis for tests of the outputs, and real ones of small logs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from syncline_design.comparison.meaning import (
    ChargedHorizon,
    DesignMeaning,
    DiagnosisAndDesign,
    ErrorFigure,
    Summary,
)
from syncline_design.diagnosis.gap_result import (
    Fit,
    Gap,
    HeldOut,
    Regime,
    Remaining,
    Saved,
    WholeGap,
)
from syncline_design.diagnosis.plotted import (
    AxisResiduals,
    CovariateMap,
    Coverage,
    MapCell,
    Plots,
    Residuals,
)
from syncline_design.diagnosis.result import (
    DiagnosisProvenance,
    Estimate,
    Finding,
    Likelihoods,
    LogRead,
    MotionQuantiles,
    Noise,
    Rival,
    SpecRead,
)

GOOD = Fit(rms_m=0.021, reduced_chi2=1.02, nll_per_sample=-4.1, coverage_95=0.949)
POOR = Fit(rms_m=0.283, reduced_chi2=33.1, nll_per_sample=12.1, coverage_95=0.31)
CLOSED = Gap(
    held_out=HeldOut(POOR, GOOD, GOOD, GOOD),
    expected_rms_m=0.0217,
    closed_fraction=0.981,
    nll_saved_per_sample=Saved(16.2, 0.4),
)
LATENCY = Finding(
    effect="latency",
    sensor="position",
    stage="car",
    parameters={"latency_s": Estimate(0.0871, 0.0003, "s", True, "87.1 \u00b1 0.3 ms")},
    aliases=(Rival("lever_arm", "position", "car", 0.999, 0.4),),
    lookalikes=(),
    excluded=(Rival("filter_lag", "position", "car", 0.8, 140.7),),
    sentence="GNSS positions are 87.1 ms older than their stamps.",
    evidence="saves 812.0 nat; noise alone does that with a chance of less than 1e-300",
    gain_nat=812.0,
    log10_p=-352.0,
    confused_with="a forward lever arm",
    separated_by="vary the speed",
    source="Jellum et al.",
)
DESIGN = DesignMeaning(
    before=Summary("meets", (), None),
    after=Summary("fails", (), None),
    text=("ACC-1 now fails", "the payload changes"),
    figures=(
        ErrorFigure("syncline_m", "Syncline, which decides", 0.117, 3.94),
        ErrorFigure("simulated_95_m", "simulated", 0.1, 0.68, (0.09, 0.11), (0.6, 0.7)),
    ),
    horizon=ChargedHorizon(3600.0, 1000.0, 0.17, "Horizon: 1 h, 1 km about the origin"),
)


def _residuals() -> Residuals:
    time = tuple(0.5 * i for i in range(200))
    signature = tuple(0.4 * math.sin(0.05 * t) for t in time)
    axis = AxisResiduals(signature, (0.0,) * 200, signature, (0.02,) * 200)
    return Residuals(time, {"north": axis, "east": axis, "down": axis})


def diagnosis(**changed: Any) -> DiagnosisAndDesign:
    """A latency found in a car's log, and what it means for the design."""
    cells = (
        MapCell(0.0, 2.0, "along", 1.0, 0.01, 90),
        MapCell(2.0, 4.0, "along", 9.0, 0.1, 90),
    )
    parts: dict[str, Any] = {
        "verdict": "explained",
        "sound": True,
        "checks": (),
        "findings": (LATENCY,),
        "remaining": Remaining(False, 0.0217, False, 0.4, ()),
        "where": (Regime("speed", 6.2, 9.0, "m/s", "along", -508.0, -0.652, 500),),
        "first_disagreement_s": 0.0,
        "gap": WholeGap(
            held_out=CLOSED.held_out,
            expected_rms_m=0.0217,
            closed_fraction=0.981,
            nll_saved_per_sample=CLOSED.nll_saved_per_sample,
            regime=replace(CLOSED, held_rows="speed above 7 m/s"),
            placebo=replace(CLOSED, added="boresight (ranging)"),
        ),
        "steps": (
            replace(CLOSED, added="latency (position)"),
            replace(CLOSED, added="boresight (ranging)"),
        ),
        "unseen": ("boresight: the vehicle never tilted",),
        "log": LogRead(
            kind="georeference",
            rows=3000,
            used=2987,
            rejected={"missing values": 13},
            thinned=0,
            notes=(),
            duration_s=300.0,
            interval_s=0.1,
            fitted=2987,
            motion={"speed": MotionQuantiles(0.8, 7.8, "m/s")},
        ),
        "noise": Noise({"car/position": 0.9}, {}, 800, Likelihoods(-3252.1, -19209.6)),
        "plots": Plots(
            _residuals(),
            (CovariateMap("speed", "m/s", cells),),
            (Coverage(0.5, 0.1, 0.5), Coverage(0.8, 0.2, 0.79), Coverage(0.95, 0.31, 0.949)),
        ),
        "spec": SpecRead("Car", "car.yaml"),
        "log_files": ("car.csv",),
        "provenance": DiagnosisProvenance("0.1.0", 0, 0.05, 4, (), "ab", "cd"),
        "design": DESIGN,
    }
    return DiagnosisAndDesign(**parts | changed)
