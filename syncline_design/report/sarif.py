"""SARIF 2.1.0, as code scanning reads it: a result per failing requirement, at its line.

Source: OASIS Static Analysis Results Interchange Format (SARIF) Version 2.1.0, 27 March 2020,
sections 3.13 (sarifLog), 3.14 (run), 3.27 (result), 3.35 (suppression), 3.49 (reportingDescriptor).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, Final
from urllib.parse import quote

from syncline_design import __version__
from syncline_design.report.ci import SILENT, Notice, all_notices
from syncline_design.report.json_out import json_text
from syncline_design.report.text import unticked, visible
from syncline_design.verdict.tree import Checked

SCHEMA_URI: Final = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)
_RULES: Final[dict[str, str]] = {
    "accuracy": "The Syncline of the design keeps the required accuracy.",
    "sync": "Every timestamp error stays below its critical value.",
    "cost": "The price keeps its limit.",
    "mass": "The mass keeps its limit.",
    "power": "The power keeps its limit.",
    "monte_carlo": "A quantile of the simulated error keeps its limit.",
    "worst_case": "The certified worst case keeps its limit.",
    "thu": "A quantile of the horizontal error keeps its limit.",
    "tvu": "A quantile of the vertical error keeps its limit.",
    "rmse": "The root mean square error keeps its limit.",
    "quantile": "A quantile of the error keeps its limit.",
    "timing": "Stamps keep the bound that the verdict rests on.",
    "latency": "Data are not older than their stamps by more than the verdict rests on.",
    "lever_arm": "Lever arms are as the spec says.",
    "mounting": "Sensors are mounted as the spec says.",
    "noise": "Sensors are as good as their figures.",
    "clock": "The host's clock keeps its bound.",
    "speed": "The vehicle keeps the spec's v_max.",
    "rate": "The vehicle keeps the spec's omega_max.",
    "one_of": "None of several assumptions that a log cannot tell apart is broken.",
    "sample_spacing": "Two samples of a ranging sensor are close enough.",
    "failing_share": "Figures within their intervals seldom break a requirement.",
    "feasible": "Every entry can work where it stands.",
    "infeasible": "Some design meets every requirement.",
    "indeterminate": "A verdict could be reached.",
    "spec": "The spec can be read.",
}
_LEVELS: Final = {
    "fail": "error",
    "waived": "error",
    "known": "error",
    "undecided": "error",
    "warning": "note",
}


def render_sarif(verdicts: Sequence[Checked]) -> str:
    """A SARIF log with one run; what passes is left out, what is waived is suppressed, what is
    no worse than in the baseline is unchanged."""
    return sarif_log([f for f in all_notices(verdicts) if f.level not in SILENT])


def sarif_log(found: Sequence[Notice]) -> str:
    """A SARIF log of these notices."""
    rules = sorted({_rule_id(f) for f in found})
    run = {
        "tool": {
            "driver": {
                "name": "syncline-design",
                "version": __version__,
                "rules": [_rule(rule) for rule in rules],
            }
        },
        "columnKind": "unicodeCodePoints",
        "results": [_result(notice, rules) for notice in found],
    }
    return json_text({"$schema": SCHEMA_URI, "version": "2.1.0", "runs": [run]})


def _rule_id(notice: Notice) -> str:
    return visible(notice.rule)


def _rule(rule: str) -> dict[str, Any]:
    text = _RULES.get(rule, "What the reader of a verdict should know.")
    return {"id": rule, "shortDescription": {"text": text}}


def _result(notice: Notice, rules: list[str]) -> dict[str, Any]:
    rule = _rule_id(notice)
    result: dict[str, Any] = {
        "ruleId": rule,
        "ruleIndex": rules.index(rule),
        "kind": "fail",
        "level": _LEVELS[notice.level],
        "message": {"text": visible(unticked(notice.message))},
        "locations": [_location(notice)],
        "partialFingerprints": {"requirement/v1": _fingerprint(notice)},
    }
    if notice.level == "waived":
        result["suppressions"] = [
            {"kind": "inSource", "justification": visible(unticked(notice.justification))}
        ]
    elif notice.level == "known":
        result["baselineState"] = "unchanged"
    return result


def _location(notice: Notice) -> dict[str, Any]:
    return {
        "physicalLocation": {
            "artifactLocation": {"uri": artifact_uri(notice.file)},
            "region": {"startLine": notice.line, "startColumn": notice.column},
        }
    }


def artifact_uri(file: str) -> str:
    """A path as a URI reference: forward slashes, percent-encoded; absolute ones as file:."""
    path = PurePath(file)
    encoded = quote(path.as_posix().encode("utf-8", "replace"), safe="/")
    return f"file://{encoded}" if path.is_absolute() else encoded


def _fingerprint(notice: Notice) -> str:
    """Stable under changes of the figures: file, rule and requirement."""
    parts = (notice.file, notice.rule, notice.label or notice.message)
    return hashlib.sha256("\0".join(parts).encode("utf-8", "replace")).hexdigest()[:32]
