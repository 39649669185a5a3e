"""Scoring of one diagnosis against the truth, and the table over many."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.study_ideal import told_apart
from tests.world import DISCRETE, STOCHASTIC, Hidden
from tests.world.bound import fitted_keys
from tests.world.worldlog import WorldLog

Row = dict[str, Any]
NO_SLOPE = STOCHASTIC | DISCRETE
SAME_MOMENT = 0.03  # of the log
FEW = 3  # aliases that a noise effect may carry


def names_of(finding: Row) -> set[tuple[str, str]]:
    """(effect, sensor) pairs that a finding stands for: itself and its class."""
    names = {(finding["effect"], finding["sensor"])}
    for alias in finding.get("aliases", []):
        if isinstance(alias, dict):
            names.add((alias["effect"], alias.get("sensor", finding["sensor"])))
        else:
            effect, _, rest = str(alias).partition("(")
            sensor = rest.split(",")[0].strip(" )") or finding["sensor"]
            names.add((effect.strip(), sensor))
    return names


def same(effect: Hidden, finding: Row) -> bool:
    stage = finding.get("stage")
    right_stage = stage is None or effect.stage is None or stage == effect.stage
    return right_stage and (effect.effect, effect.sensor) in names_of(finding)


def exact(effect: Hidden, finding: Row) -> bool:
    return same(effect, finding) and (effect.effect, effect.sensor) == (
        finding["effect"],
        finding["sensor"],
    )


def stands_for(log: WorldLog, effect: Hidden, finding: Row) -> bool:
    """The finding names the effect, or a class that holds it and that the log cannot open.

    An alias counts only if the world itself says that the two cannot be told apart here.
    """
    if exact(effect, finding) or _is_the_step(log, effect, finding):
        return True
    if not same(effect, finding) or effect.effect in NO_SLOPE:
        return same(effect, finding) and len(finding["aliases"]) <= FEW
    other = (finding["effect"], finding["sensor"], finding.get("stage"))
    return not told_apart(log, effect, other)


def _is_the_step(log: WorldLog, effect: Hidden, finding: Row) -> bool:
    """A delay from the moment of a clock's step to the end of the log is that step."""
    if effect.effect != "timestamp_step" or finding["effect"] != "latency":
        return False
    if finding["sensor"] != effect.sensor or finding.get("from_s") is None:
        return False
    time_s = log.run.stamps_s
    late = abs(finding["from_s"] - time_s[0] - effect.number("time_s"))
    early = time_s[-1] - finding["to_s"]
    return bool(max(late, early) < SAME_MOMENT * float(np.ptp(time_s)))


def parameters(log: WorldLog, effect: Hidden, finding: Row, bounds: dict[Any, float]) -> list[Row]:
    rows = []
    for index, name in fitted_keys((effect,)):
        found = finding["parameters"].get(name)
        if found is None:
            continue
        error = float(found["value"]) - effect.number(name)
        stated = found.get("standard_uncertainty")
        rows.append(
            {
                "name": name,
                "true": effect.number(name),
                "found": found["value"],
                "z": error / stated if stated else None,
                "over_bound": error / bounds[index, name] if (index, name) in bounds else None,
            }
        )
    return rows


def score(log: WorldLog, document: Row) -> Row:
    """What was named, what was not, and how well the parameters came out."""
    findings, truth = document["findings"], log.truth
    right_ones = [[stands_for(log, effect, f) for f in findings] for effect in truth]
    named = [any(row) for row in right_ones]
    wrong = [f for k, f in enumerate(findings) if not any(row[k] for row in right_ones)]
    bounds = log.cramer_rao() if len(truth) == 1 and truth[0].effect not in NO_SLOPE else {}
    fitted = [
        row
        for effect in truth
        if effect.effect not in NO_SLOPE
        for finding in findings
        if exact(effect, finding)
        for row in parameters(log, effect, finding, bounds)
    ]
    gap = document.get("gap") or {}
    return {
        "verdict": document["verdict"],
        "truth": [(e.effect, e.sensor, dict(e.parameters)) for e in truth],
        "found": [
            (f["effect"], f["sensor"], sorted(map("/".join, names_of(f) - {_own(f)})))
            for f in findings
        ],
        "named": bool(named) and all(named),
        "wrong": [(f["effect"], f["sensor"]) for f in wrong],
        "parameters": fitted,
        "closed_fraction": gap.get("closed_fraction"),
    }


def _own(finding: Row) -> tuple[str, str]:
    return finding["effect"], finding["sensor"]


def proportion(hits: Iterable[bool]) -> str:
    """Share in per cent with its 95 % Clopper-Pearson interval."""
    values = list(hits)
    if not values:
        return "-"
    k, n = sum(values), len(values)
    low = 0.0 if k == 0 else float(stats.beta.ppf(0.025, k, n - k + 1))
    high = 1.0 if k == n else float(stats.beta.ppf(0.975, k + 1, n - k))
    return f"{100 * k / n:.0f} % [{100 * low:.0f}, {100 * high:.0f}]"


def spread(values: list[float]) -> str:
    """Standard deviation about zero, and a robust one beside it when they differ by half."""
    if len(values) < 5:
        return "-"
    plain = float(np.sqrt(np.mean(np.square(values))))
    robust = float(1.4826 * np.median(np.abs(values)))
    text = f"{plain:.2f}"
    return text if plain < 1.5 * robust else f"{text} (robust {robust:.2f})"


def _clean(rows: list[Row]) -> str:
    return proportion(bool(_physical(row)) for row in rows)


def _physical(row: Row) -> list[Any]:
    """Wrong names, noise effects apart: those say something else about a log."""
    return [wrong for wrong in row["wrong"] if wrong[0] not in STOCHASTIC]


def right(group: str) -> tuple[str, Callable[[Row], bool]]:
    """What a right answer is in a group, in words and as a test."""
    if group.startswith("clean, noise of another"):
        return "no physical effect named", lambda row: not _physical(row)
    if group.startswith("clean"):
        return "nothing named, agrees", lambda row: not row["found"] and row["verdict"] == "agrees"
    if "not in the dictionary" in group:
        return "unexplained", lambda row: row["verdict"] == "unexplained"
    return "named, or its class", lambda row: bool(row["named"])


def table(rows: list[Row]) -> str:
    """The study's table in Markdown, a line per group."""
    lines = [
        "| logs | n | right answer | share right [95 %] | best possible | false names | "
        "parameter z | error / bound | closed fraction, median (5 %) |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for group in dict.fromkeys(row["group"] for row in rows):
        part = [row for row in rows if row["group"] == group and "error" not in row]
        if not part:
            continue
        words, good = right(group)
        z = [p["z"] for row in part for p in row["parameters"] if p["z"] is not None]
        over = [p["over_bound"] for row in part for p in row["parameters"] if p["over_bound"]]
        closed = [r["closed_fraction"] for r in part if r["closed_fraction"] is not None]
        shown = f"{np.median(closed):.2f} ({np.quantile(closed, 0.05):.2f})" if closed else "-"
        if group.startswith("clean"):
            shown = "-"
        wrong = proportion(bool(row["wrong"]) for row in part)
        share = proportion(good(row) for row in part)
        ideal = [row["ideal"] for row in part if row["ideal"] is not None]
        best = f"{100 * np.mean(ideal):.0f} %" if ideal else "-"
        lines.append(
            f"| {group} | {len(part)} | {words} | {share} | {best} | {wrong} | {spread(z)} | "
            f"{spread(over)} | {shown} |"
        )
    return "\n".join(lines)


def by_effect(rows: list[Row], group: str) -> str:
    """One line per effect of a group: how often named, and how often anyone could."""
    part = [row for row in rows if row["group"] == group and "error" not in row]
    lines = ["| hidden effect | named | best possible | what else was named |", "|---|---|---|---|"]
    for label in sorted({row["label"] for row in part}):
        own = [row for row in part if row["label"] == label]
        ideal = [row["ideal"] for row in own if row["ideal"] is not None]
        best = f"{100 * np.mean(ideal):.0f} %" if ideal else "-"
        others = sorted({" ".join(wrong) for row in own for wrong in row["wrong"]})
        named = f"{sum(row['named'] for row in own)} of {len(own)}"
        lines.append(f"| {label} | {named} | {best} | {', '.join(others) or 'nothing'} |")
    return "\n".join(lines)


def misses(rows: list[Row]) -> str:
    """Every case that went wrong, one line each."""
    lines = []
    for row in rows:
        if "error" in row:
            lines.append(f"{row['id']}: {row['error']}")
        elif not right(row["group"])[1](row) or row["wrong"]:
            lines.append(f"{row['id']}: {row['verdict']}, found {row['found']}")
    return "\n".join(lines)
