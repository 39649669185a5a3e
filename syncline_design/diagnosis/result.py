"""What a diagnosis says, and how it is written down (schema syncline-design/diagnosis/v1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from syncline_design.diagnosis.checks import Check
from syncline_design.diagnosis.findings import Finding, figure_text
from syncline_design.diagnosis.gap import Gap
from syncline_design.diagnosis.regimes import Cell
from syncline_design.diagnosis.remainder import Remainder
from syncline_design.spec.effects_listed import EffectChoice

SCHEMA = "syncline-design/diagnosis/v1"
Verdict = Literal["agrees", "explained", "unexplained"]
Json = dict[str, Any]
EXIT_CODES: Mapping[Verdict, int] = {"agrees": 0, "explained": 1, "unexplained": 1}


@dataclass(frozen=True, slots=True)
class Stairs:
    """The held-out gap after an addition."""

    label: str
    gap: Gap


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The outcome; `plots` holds what figures need, plain lists and numbers."""

    verdict: Verdict
    checks: tuple[Check, ...]
    findings: tuple[Finding, ...]
    remaining: Remainder
    left: bool  # whether what remains is more than noise
    where_before: tuple[Cell, ...]
    where_after: tuple[Cell, ...]
    first_disagreement_s: float | None
    gap: Gap | None
    regime: tuple[str, Gap | None]
    placebo: tuple[str, Gap | None]
    steps: tuple[Stairs, ...]
    unseen: tuple[str, ...]
    log: Json
    noise: Json
    plots: Json
    spec: Json | None
    log_files: tuple[str, ...]
    provenance: Json

    @property
    def exit_code(self) -> int:
        """0 agrees, 1 something is missing."""
        return EXIT_CODES[self.verdict]

    @property
    def sound(self) -> bool:
        """Whether the log contradicts neither itself nor the limits of the spec's platform."""
        return all(check.severity != "contradiction" for check in self.checks)

    @property
    def unexplained(self) -> bool:
        return self.verdict == "unexplained"

    def effects_entries(self) -> tuple[EffectChoice, ...]:
        """The findings as entries of a spec's `effects:`, for `spec_writer.with_effects_text`."""
        return tuple(_entry(finding) for finding in self.findings)

    def to_json(self) -> Json:
        """Plain data; every number is finite or null."""
        document = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "sound": self.sound,
            "checks": [asdict(check) for check in self.checks],
            "findings": [finding_json(f) for f in self.findings],
            "remaining": {
                "unexplained": self.unexplained,
                "spec_m": None if self.gap is None else self.gap.expected_rms_m,
                "beyond_noise": self.left,
                "p": self.remaining.p,
                "where": [_cell_json(c) for c in self.where_after],
            },
            "where": [_cell_json(c) for c in self.where_before],
            "first_disagreement_s": self.first_disagreement_s,
            "gap": self._gap_json(),
            "steps": [{"added": s.label, **_gap_json(s.gap)} for s in self.steps],
            "unseen": list(self.unseen),
            "log": self.log,
            "noise": self.noise,
            "plots": self.plots,
            "spec": self.spec,
            "log_files": list(self.log_files),
            "provenance": self.provenance,
        }
        clean: Json = _finite(document)
        return clean

    def _gap_json(self) -> Json:
        return {
            **_gap_json(self.gap),
            "regime": {"held_out": self.regime[0], **_gap_json(self.regime[1])},
            "placebo": {"added": self.placebo[0], **_gap_json(self.placebo[1])},
        }


def _entry(finding: Finding) -> EffectChoice:
    values = {name: figure.value for name, figure in finding.parameters.items()}
    spreads = {
        name: figure.standard_uncertainty
        for name, figure in finding.parameters.items()
        if figure.standard_uncertainty is not None and math.isfinite(figure.standard_uncertainty)
    }
    return EffectChoice(
        effect=finding.effect.name,
        sensor=finding.sensor,  # type: ignore[arg-type]
        stage=finding.stage,
        parameters=values,
        standard_uncertainty=spreads,
        source="diagnose",
    )


def finding_json(finding: Finding) -> Json:
    """One finding as an entry of `findings`."""
    return {
        "effect": finding.effect.name,
        "sensor": finding.sensor,
        "stage": finding.stage,
        "parameters": {
            name: {**asdict(f), "text": figure_text(f)} for name, f in finding.parameters.items()
        },
        "aliases": [asdict(a) for a in finding.aliases],
        "lookalikes": [asdict(a) for a in finding.lookalikes],
        "excluded": [asdict(a) for a in finding.excluded],
        "sentence": finding.sentence,
        "evidence": finding.evidence,
        "gain_nat": finding.gain_nat,
        "log10_p": finding.log10_p,
        "confused_with": finding.effect.confused_with,
        "separated_by": finding.effect.separated_by,
        "source": finding.effect.source,
    }


def _cell_json(cell: Cell) -> Json:
    return asdict(cell)


def _gap_json(gap: Gap | None) -> Json:
    if gap is None:
        return {"held_out": None, "closed_fraction": None}
    return {
        "held_out": {
            "before": asdict(gap.before),
            "after": asdict(gap.after),
            "floor": asdict(gap.floor),
            "fitted": asdict(gap.fitted),
        },
        "expected_rms_m": gap.expected_rms_m,
        "closed_fraction": gap.closed_fraction,
        "nll_saved_per_sample": {"value": gap.difference, "standard_error": gap.difference_error},
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
