"""The design report: one verdict as one offline HTML page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from syncline_design.choice.outcome import ROADS
from syncline_design.report import (
    choice_tables,
    errata,
    numbers,
    page,
    verdict_tables,
    verdict_words,
)
from syncline_design.report.simulated import (
    certificate,
    ensemble,
    quantiles,
    simulation_facts,
)
from syncline_design.report.svg import InlineFigure
from syncline_design.report.text import harmless
from syncline_design.report.verdict_figures import (
    accuracy_target,
    lowest_limit,
    syncline_curve,
    verdict_figures,
)
from syncline_design.report.verdict_words import Json, items, part


@dataclass(frozen=True, slots=True)
class Explorer:
    """What the page's script needs to move tau and the target; null where unknown."""

    floor_m: float
    rate_mps: float
    tau_s: float
    tau_crit_s: float | None
    target_m: float | None
    sync_limit: float
    others_pass: bool
    tau_span: tuple[float, float]
    target_span: tuple[float, float]


def render_verdict(verdict: Json) -> str:
    """The HTML report of one verdict (schema syncline-design/verdict/v1); same input, same bytes.

    Any optional part that is missing or null is left out of the page.
    """
    verdict = harmless(verdict)
    drawn = verdict_figures(verdict)
    sections = _sections(verdict, drawn)
    return page.render_page(
        "verdict.html.j2",
        kind="Design report",
        contents=[(key, label) for key, label in _CONTENTS if sections[key]],
        sections=sections,
        outcome=verdict_words.outcome(verdict),
        name=str(part(verdict, "spec").get("name") or "Unnamed system"),
        sentence=verdict_words.design_sentence(verdict),
        key_facts=_key_facts(verdict),
        figures={key: drawing(drawn.get(key)) for key in _FIGURES},
        box=drawn["syncline"].box if "syncline" in drawn else None,
        numbers=numbers,
        explorer=_explorer(verdict),
        syncline_facts=_syncline_facts(verdict),
        simulation_facts=_simulation_facts(verdict),
        simulation_notes=_simulation_notes(verdict),
        proof=_proof(verdict),
        incomplete=part(verdict, "choice").get("incomplete") or (),
    )


def drawing(figure: InlineFigure | None) -> Any:
    """A figure as ready HTML, None as None."""
    return None if figure is None else page.trusted_svg(figure.svg)


_FIGURES = ("syncline", "timing", "ledger", "histogram", "grid", "choice")
_CONTENTS = (
    ("infeasibility", "Why not"),
    ("requirements", "Requirements"),
    ("warnings", "Warnings"),
    ("payload", "Payload"),
    ("timing", "Timing"),
    ("syncline", "Syncline"),
    ("ledger", "Ledger"),
    ("simulation", "Simulation"),
    ("choice", "Choice"),
    ("effects", "Known effects"),
    ("basis", "Basis"),
    ("provenance", "Provenance"),
)


def _sections(verdict: Json, drawn: dict[str, InlineFigure]) -> dict[str, Any]:
    """Content of every section by key; empty where the verdict has none."""
    tables = verdict_tables
    has_roles = next(tables.roles(verdict), None) is not None
    choice, simulated = part(verdict, "choice"), part(verdict, "monte_carlo")
    candidates: dict[str, Any] = {
        "infeasibility": part(verdict, "infeasibility"),
        "requirements": tables.requirements(verdict) if verdict.get("requirements") else None,
        "warnings": items(verdict, "warnings"),
        "payload": (tables.payload(verdict), tables.shared(verdict)) if has_roles else None,
        "timing": tables.taus(verdict) if has_roles else None,
        "syncline": tables.models(verdict) if "syncline" in drawn else None,
        "ledger": tables.ledger(verdict) if "ledger" in drawn else None,
        "simulation": quantiles(simulated) if simulated else None,
        "choice": choice_tables.choice_tables(verdict) if choice else None,
        "effects": items(verdict, "effects"),
        "basis": _basis(verdict),
        "provenance": _provenance(verdict),
    }
    return candidates


def _basis(verdict: Json) -> dict[str, Any] | None:
    tables = [
        t for t in (verdict_tables.assumptions(verdict), verdict_tables.sources(verdict)) if t
    ]
    notes = errata.relevant(verdict)
    return {"tables": tables, "errata": notes} if tables or notes else None


def _provenance(verdict: Json) -> list[tuple[str, str]]:
    provenance = part(verdict, "provenance")
    labels = (
        ("version", "syncline-design"),
        ("spec_sha256", "Spec, SHA-256"),
        ("catalogs_sha256", "Catalogs, SHA-256"),
        ("seed", "Seed"),
        ("python", "Python"),
        ("numpy", "NumPy"),
    )
    known = [(label, str(provenance[key])) for key, label in labels
             if provenance.get(key) is not None]  # fmt: skip
    file = part(verdict, "spec").get("file")
    return [*([("Spec file", str(file))] if file else []), *known]


def _key_facts(verdict: Json) -> list[tuple[str, str]]:
    """Price, error, tightest margin: the answer in figures."""
    design, syncline = part(verdict, "design"), part(verdict, "syncline")
    facts = []
    if design.get("cost") is not None:
        currency = verdict_tables.currency_of(verdict)
        facts.append(("Price", numbers.money(design["cost"], currency)))
    target = accuracy_target(verdict)
    if syncline.get("total_m") is not None:
        total = numbers.length(syncline["total_m"])
        of = f" of {numbers.length(target)}" if target else ""
        facts.append(("Syncline error", total + of))
    row = verdict_words.tightest(items(verdict, "requirements"))
    if row is not None:
        facts.append(("Tightest margin", f"{row.get('id')}: {verdict_words.margin_text(row)}"))
    probability = numbers.finite(
        part(part(verdict, "monte_carlo"), "probability_within_target").get("value")
    )
    if probability is not None:
        facts.append(("Simulated within target", numbers.percent(probability, 4)))
    for key, label, shown in (("mass", "Mass", numbers.mass), ("power", "Power", numbers.power)):
        if design.get(key) is not None:
            facts.append((label, shown(design[key])))
    return facts


def _syncline_facts(verdict: Json) -> list[tuple[str, str]]:
    syncline = part(verdict, "syncline")
    facts = [
        ("Sensor error (roof)", numbers.length(syncline.get("sensor_error_m"))),
        ("Synchronisation rate (slope)", numbers.speed(syncline.get("sync_rate_mps"))),
        ("\u03c4 of the system", numbers.time(syncline.get("tau_s"))),
        ("\u03c4_crit of the system", numbers.time_limit(syncline.get("tau_crit_s"))),
        ("Synchronisation error", numbers.length(syncline.get("sync_error_m"))),
        ("Total error", numbers.length(syncline.get("total_m"))),
    ]
    if syncline.get("systematic_error_m"):
        facts.insert(-1, ("Known effects", numbers.length(syncline["systematic_error_m"])))
    return facts


def _simulation_facts(verdict: Json) -> list[tuple[str, str]]:
    """The facts of the Monte Carlo part, and the horizon that it runs over."""
    facts = simulation_facts(part(verdict, "monte_carlo"))
    if horizon := part(verdict, "horizon"):
        facts.append(("Horizon", numbers.horizon(horizon)))
    return facts


def _simulation_notes(verdict: Json) -> list[str]:
    """For what the upper bound holds, and over what the quantiles run, in sentences."""
    monte_carlo = part(verdict, "monte_carlo")
    return [text for text in (certificate(monte_carlo), ensemble(monte_carlo)) if text]


def _proof(verdict: Json) -> str:
    """How it is known that nothing better exists."""
    proof = part(part(verdict, "choice"), "proof")
    if not proof:
        return ""
    method = ROADS.get(str(proof.get("method")), str(proof.get("method")))
    combinations = str(part(verdict, "spec").get("combinations") or "")
    among = f" among {_grouped(combinations)} combinations" if combinations.isdigit() else ""
    optimal = "proven optimal" if proof.get("optimal") else "not proven optimal"
    checked = ", recomputed exactly afterwards" if proof.get("rechecked") else ""
    found = f"Found by {method}{among}: {optimal}{checked}."
    return f"{found} {choice_tables.tolerance_sentence(verdict)}".strip()


def _grouped(digits: str) -> str:
    """Digits of a whole number of any size, in groups of three; rounded beyond 15 of them."""
    if len(digits) > 15:
        return f"{digits[0]}.{digits[1:3]}e{len(digits) - 1}"
    return f"{int(digits):,}".replace(",", "\N{NO-BREAK SPACE}")


def _explorer(verdict: Json) -> Explorer | None:
    """Values for the sliders; the total follows the model that decides, in proportion to tau."""
    curve = syncline_curve(verdict)
    if curve is None or not curve.tau_s or curve.total_m is None:
        return None
    rows = items(verdict, "requirements")
    fixed = [row for row in rows if row.get("kind") not in ("accuracy", "sync", "monte_carlo")]
    rate = (curve.total_m - curve.floor_m) / curve.tau_s
    centre = curve.tau_crit_s or curve.tau_s
    target = curve.target_m
    middle = target or curve.total_m
    return Explorer(
        floor_m=curve.floor_m,
        rate_mps=rate,
        tau_s=curve.tau_s,
        tau_crit_s=curve.tau_crit_s,
        target_m=target,
        sync_limit=lowest_limit(verdict, "sync") or 1.0,
        others_pass=all(verdict_words.status_of(row).word in ("pass", "waived") for row in fixed),
        tau_span=(min(centre / 1e3, curve.tau_s / 2), max(centre * 1e2, curve.tau_s * 2)),
        target_span=(min(middle, curve.floor_m) / 4, max(middle, curve.total_m) * 10),
    )
