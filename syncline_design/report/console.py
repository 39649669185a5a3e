"""The verdict as plain text for a terminal: the answer first, then what it rests on."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap
from typing import Any

from syncline_design.model.horizon import duration_words
from syncline_design.model.quantity import Dimension, format_quantity
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import is_waived, qualification

Data = Mapping[str, Any]

WORDS = {
    "meets": "MEETS its requirements",
    "fails": "DOES NOT MEET its requirements",
    "infeasible": "INFEASIBLE: no design meets the requirements",
    "indeterminate": "NO VERDICT: a requirement could not be decided",
}
STATUS = {"pass": "PASS", "fail": "FAIL", "indeterminate": "OPEN"}
DIMENSIONS = {
    "accuracy": Dimension.LENGTH,
    "monte_carlo": Dimension.LENGTH,
    "cost": Dimension.MONEY,
    "mass": Dimension.MASS,
    "power": Dimension.POWER,
}


def verdict_text(data: Data, *, colour: bool | None = None) -> str:
    """All of a verdict, one section after the other; sections without content are left out."""
    paint = _painter(colour)
    sections = [
        _headline(data, paint),
        _design(data),
        _requirements(data, paint),
        _infeasibility(data),
        _syncline(data),
        _ledger(data),
        _monte_carlo(data),
        _warnings(data),
        _provenance(data),
    ]
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


def supports_colour() -> bool:
    """Colour only on a terminal, and never against NO_COLOR."""
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ


def _painter(colour: bool | None) -> Any:
    on = supports_colour() if colour is None else colour
    codes = {"good": "32", "bad": "31", "open": "33", "bold": "1"}
    return lambda text, how: f"\033[{codes[how]}m{text}\033[0m" if on else text


def _tone(verdict: str) -> str:
    tones = {"meets": "good", "pass": "good", "indeterminate": "open", "waived": "open"}
    return tones.get(verdict, "bad")


def _headline(data: Data, paint: Any) -> list[str]:
    spec = data["spec"]
    words = paint(WORDS[data["verdict"]] + qualification(data), _tone(data["verdict"]))
    return [f"{visible(spec['name'])} ({visible(spec['file'])}): {words}"]


def _time(value: float | None) -> str:
    return "unlimited" if value is None else format_quantity(value, Dimension.TIME)


def _length(value: float | None) -> str:
    """A length; null in JSON is one without an end, as of an interval from few samples."""
    return "unlimited" if value is None else format_quantity(value, Dimension.LENGTH)


def _resource(design: Data, key: str, dimension: Dimension) -> str | None:
    value = design.get(key)
    if value is None:
        return None
    if dimension is Dimension.MONEY:
        return format_quantity(value, dimension, currency=design["currency"])
    return format_quantity(value, dimension)


def _design(data: Data) -> list[str]:
    design = data.get("design")
    if not design:
        return []
    totals = [
        _resource(design, "cost", Dimension.MONEY),
        _resource(design, "mass", Dimension.MASS),
        _resource(design, "power", Dimension.POWER),
    ]
    known = ", ".join(t for t in totals if t) or "cost, mass and power not given"
    lines = [f"{'Chosen design' if data['spec']['open_roles'] else 'Design'}: {known}"]
    platforms = {s["name"]: s["platform"] for s in data["spec"]["stages"]}
    for stage in design["stages"]:
        lines += _stage_lines(stage, platforms[stage["name"]])
    for item in design["infrastructure"]:
        lines.append(
            f"  shared on {visible(item['vehicle'])}: {item['count']} x {visible(item['name'])}"
        )
    for clock in design["clocks"]:
        lines.append(f"  host clock of {visible(clock['vehicle'])}: {visible(clock['id'])}")
    return lines


def _stage_lines(stage: Data, platform: Data) -> list[str]:
    figures = (
        f"{format_quantity(platform['v_max_mps'], Dimension.SPEED)}, "
        f"{format_quantity(platform['omega_max_radps'], Dimension.ANGULAR_RATE)}, "
        f"range {_length(platform['distance_m'])}"
    )
    header = ["", "sensor", "timestamping", "tau", "tau_crit", "with lever arm", "tau/tau_crit"]
    rows = [header]
    for role, entry in stage["roles"].items():
        crit = entry["tau_crit_s"]
        ratio = "-" if crit is None else percent(entry["tau_s"] / crit)
        rows.append(
            [
                role,
                visible(entry["name"]),
                f"{visible(entry['timestamping'])} ({visible(entry['primitive'])})",
                _time(entry["tau_s"]),
                _time(crit),
                _time(entry["tau_crit_lever_arm_s"]),
                ratio,
            ]
        )
    return [f"  {visible(stage['name'])}: {visible(platform['name'])} ({figures})", *table(rows, 4)]


def percent(ratio: float) -> str:
    """A share for people: three digits, down to parts per million."""
    if not math.isfinite(ratio):
        return "-"
    return f"{100 * ratio:.3g} %"


def table(rows: Sequence[Sequence[str]], indent: int = 2, right: Iterable[int] = ()) -> list[str]:
    """Rows as aligned columns; columns in `right` are set flush right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    flush = set(right)
    lines = []
    for row in rows:
        cells = [
            c.rjust(w) if i in flush else c.ljust(w)
            for i, (c, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append((" " * indent + "  ".join(cells)).rstrip())
    return lines


def _figure(kind: str, value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    if kind in ("sync", "feasible"):
        return f"{value:.4g}"
    if kind == "cost":
        return format_quantity(value, Dimension.MONEY, currency=unit)
    return format_quantity(value, DIMENSIONS[kind])


def _requirements(data: Data, paint: Any) -> list[str]:
    rows = []
    for r in data["requirements"]:
        kind, unit = r["kind"], r["unit"]
        sign = "<" if kind == "sync" else "<="
        value = _figure(kind, r["value"], unit)
        what = {"sync": "tau / tau_crit", "feasible": "cannot exist"}.get(kind, kind)
        if kind == "monte_carlo":
            what = f"{percent(r['quantile'])} quantile"
        margin = "" if r["margin"] is None else f"margin {_signed(kind, r['margin'], unit)}"
        where = f"line {r['line']}" if r.get("line") else "implied"
        note = f"  {visible(r['note'])}" if r.get("note") else ""
        rows.append(
            [
                "WAIVED" if _waived(r) else STATUS[r["status"]],
                visible(r["id"]),
                what,
                f"{value} {sign} {_figure(kind, r['limit'], unit)}",
                margin,
                where + note,
            ]
        )
    if not rows:
        return []
    lines = table(rows)
    painted = [
        line.replace(row[0], paint(row[0], _tone("waived" if _waived(r) else r["status"])), 1)
        for line, row, r in zip(lines, rows, data["requirements"], strict=True)
    ]
    return ["Requirements", *painted]


def _waived(row: Data) -> bool:
    return row["status"] == "fail" and is_waived(row)


def _signed(kind: str, value: float, unit: str) -> str:
    sign = "-" if value < 0 else "+"
    return sign + _figure(kind, abs(value), unit)


def _infeasibility(data: Data) -> list[str]:
    why = data.get("infeasibility")
    return (
        ["Why, and what would help", *(f"  {visible(line)}" for line in why["text"])] if why else []
    )


def _syncline(data: Data) -> list[str]:
    s = data.get("syncline")
    if not s:
        return []
    crit = s["tau_crit_s"]
    bound = "sensor-bound" if crit is None or s["tau_s"] < crit else "sync-bound"
    other = "per_sensor" if s["model"] == "syncline" else "syncline"
    lever = s["lever_arm"]
    return [
        f"Syncline ({s['model']}): {_length(s['sensor_error_m'])} sensor"
        f" + {_length(s['sync_error_m'])} sync"
        + (f" + {_length(s['systematic_error_m'])} systematic" if s["systematic_error_m"] else "")
        + f" = {_length(s['total_m'])}",
        f"  tau {_time(s['tau_s'])} against tau_crit {_time(crit)}: {bound};"
        f" sync rate {format_quantity(s['sync_rate_mps'], Dimension.SPEED)}",
        f"  {other} model: {_length(s['models'][other]['total_m'])};"
        f" with lever arms: {_length(lever['total_m'])}, tau_crit {_time(lever['tau_crit_s'])}",
        *horizon_line(data),
    ]


def horizon_line(data: Data) -> list[str]:
    """What drifts, grids and heave are charged for."""
    horizon = data.get("horizon")
    if not horizon:
        return []
    tilt = format_quantity(horizon["tilt_rad"], Dimension.ANGLE)
    return [
        f"  horizon {duration_words(horizon['duration_s'])}, extent {_length(horizon['extent_m'])},"
        f" tilt {tilt}: what drifts, grids and heave are charged for"
    ]


def _ledger(data: Data) -> list[str]:
    s = data.get("syncline")
    if not s:
        return []
    rows = [
        [visible(t["stage"]), visible(t["term"]), _length(t["value_m"]), percent(t["share"])]
        for t in s["ledger"]
    ]
    return ["Where the error comes from", *table(rows, right=(2, 3))]


def _monte_carlo(data: Data) -> list[str]:
    mc = data.get("monte_carlo")
    if not mc:
        return []
    lines = [
        f"Monte Carlo on the nonlinear chain ({mc['samples']} samples, seed {mc['seed']}); noise is"
        " Gaussian, so single",
        "  errors do exceed the Syncline, which adds one-sigma magnitudes: no contradiction",
    ]
    rows = [
        [
            f"{percent(float(q))} quantile",
            _length(v["value_m"]),
            f"[{_length(v['low_m'])}, {_length(v['high_m'])}]",
        ]
        for q, v in mc["quantiles"].items()
    ]
    within = mc.get("probability_within_target")
    if within:
        interval = f"[{percent(within['low'])}, {percent(within['high'])}]"
        rows.append(["P(error <= target)", percent(within["value"]), interval])
    worst = mc.get("worst_case")
    if worst:
        ratio = f"{worst['ratio_to_syncline']:.4f} of the Syncline"
        if worst.get("bound_m") is not None:
            ratio += f"; upper bound {_length(worst['bound_m'])}{_tilt(worst)}"
        rows.append(["worst case, directions free", _length(worst["value_m"]), ratio])
    lines += table(rows)
    text = (mc.get("ensemble") or {}).get("text")
    return (
        [*lines, *wrap(f"{text}", 96, initial_indent="  ", subsequent_indent="  ")]
        if text
        else lines
    )


def _tilt(worst: Data) -> str:
    """Where the bound holds, as far as the reader may not expect it."""
    envelope = (worst.get("certificate") or {}).get("envelope")
    if envelope is None:
        return ""
    return f" at tilts up to {format_quantity(envelope['tilt_rad'], Dimension.ANGLE)}"


def _warnings(data: Data) -> list[str]:
    lines = [
        f"  ! {visible(w['message'])} [{visible(w['code'])}]" for w in data.get("warnings", ())
    ]
    return ["Warnings", *lines] if lines else []


def _provenance(data: Data) -> list[str]:
    p = data["provenance"]
    return [
        f"syncline-design {p['version']}, spec {p['spec_sha256'][:12]},"
        f" catalogs {p['catalogs_sha256'][:12]}, seed {p['seed']}"
    ]
