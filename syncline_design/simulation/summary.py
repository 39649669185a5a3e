"""A simulation in words and as a CSV table."""

from __future__ import annotations

import math
from itertools import groupby

from syncline_design.model.system import System
from syncline_design.simulation.comparison import CAUSES
from syncline_design.simulation.results import ComparisonRow, MonteCarlo, SimulationResult

ENVELOPE_WORDS = {
    "limits": "speed and turn rate at their limits, directions free",
    "inside": "speed and turn rate uniform up to their limits, directions free",
    "trajectory": "along the trajectory",
}
CSV_HEADER = "tau_s,worst_case_m,syncline_m,ratio,bound_m,gap,reason"


def summary_text(result: SimulationResult, system: System) -> str:
    """The result for a terminal: probabilities, worst case, and the comparison over tau."""
    lines = [
        *monte_carlo_lines(result.monte_carlo, result.trajectory),
        "",
        *_worst_case_lines(result),
        "",
        *_grid_lines(result),
    ]
    if system.effects:
        names = ", ".join(f"{entry.effect} ({entry.sensor})" for entry in system.effects)
        lines += ["", f"Known effects acting: {names}."]
    return "\n".join(lines)


def monte_carlo_lines(found: MonteCarlo, trajectory: str | None = None) -> list[str]:
    """Quantiles of |error| and P(|error| <= target), each with its interval."""
    where = ENVELOPE_WORDS[found.envelope]
    if trajectory is not None:
        where += f" {trajectory}"
    lines = [f"Monte Carlo: {found.samples} samples (plain), seed {found.seed}, {where}"]
    lines += [
        f"  {100 * q.quantile:g} % of errors below {length(q.value_m)}  "
        f"[{length(q.low_m)}, {length(q.high_m)}]"
        for q in found.quantiles
    ]
    within = found.within_target
    if within is not None:
        lines.append(
            f"  P(error <= {length(within.target_m)}) = {within.value:.6g}  "
            f"[{within.low:.6g}, {within.high:.6g}]"
        )
    if found.ensemble is not None:
        lines.append(f"  {found.ensemble.text()}")
    lines.append(f"  intervals hold with {100 * found.confidence:g} % confidence")
    lines.append(
        "  the Syncline adds one-sigma magnitudes and is no quantile (39 % of errors exceed it "
        "where position noise is all there is): errors above it do not contradict it"
    )
    return lines


def _worst_case_lines(result: SimulationResult) -> list[str]:
    worst = result.monte_carlo.worst_case
    return [
        f"Worst case at tau = {duration(worst.tau_s)}, every magnitude at most its Syncline term: "
        f"{length(worst.value_m)}, {worst.ratio:.4f} of the Syncline's {length(worst.syncline_m)}",
        f"  nothing exceeds {length(worst.bound_m)} ({100 * worst.gap:.2g} % above what was found) "
        f"at tilts up to {math.degrees(worst.tilt_rad):.3g} deg and these shifts, with sensors at "
        "one sigma",
    ]


def _grid_lines(result: SimulationResult) -> list[str]:
    lines = [
        f"Over tau (tau_crit = {duration(result.tau_crit_s)}):",
        f"  {'tau':>10}  {'worst case':>12}  {'Syncline':>12}  {'ratio':>7}",
    ]
    for row in result.grid:
        found = row.worst_case
        lines.append(
            f"  {duration(found.tau_s):>10}  {length(found.value_m):>12}  "
            f"{length(found.syncline_m):>12}  {found.ratio:7.4f}"
        )
    return [*lines, *_cause_lines(result.grid)]


def _cause_lines(grid: tuple[ComparisonRow, ...]) -> list[str]:
    """Runs of neighbouring taus whose ratio leaves 1 for the same main cause, each in words."""
    lines = []
    for cause, run in groupby(grid, key=lambda row: row.causes[0] if row.causes else ""):
        rows = list(run)
        if not cause:
            continue
        ratios = [row.worst_case.ratio for row in rows]
        taus = _span(duration(rows[0].worst_case.tau_s), duration(rows[-1].worst_case.tau_s))
        span = _span(f"{min(ratios):.3f}", f"{max(ratios):.3f}")
        lines.append(f"  {taus}, ratio {span}: {CAUSES[cause]}")
    if not lines:
        return ["The worst case stays within 2 % of the Syncline over the whole grid."]
    return ["Where it leaves 1 by more than 2 %, and why:", *lines]


def _span(first: str, last: str) -> str:
    return first if first == last else f"{first} to {last}"


def grid_csv(result: SimulationResult) -> str:
    """The comparison over tau as CSV, one row per tau, numbers at full precision."""
    lines = [CSV_HEADER]
    for row in result.grid:
        found = row.worst_case
        figures = (
            found.tau_s,
            found.value_m,
            found.syncline_m,
            found.ratio,
            found.bound_m,
            found.gap,
        )
        reason = row.reason.replace('"', '""')
        lines.append(",".join([*(repr(float(f)) for f in figures), f'"{reason}"']))
    return "\n".join(lines) + "\n"


def length(value_m: float) -> str:
    """A length to five digits in the unit that suits it."""
    return _scaled(value_m, (("m", 1.0), ("mm", 1e-3), ("um", 1e-6)), "m")


def duration(value_s: float) -> str:
    """A time to four digits in the unit that suits it."""
    return _scaled(value_s, (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)), "s", 4)


def _scaled(value: float, units: tuple[tuple[str, float], ...], plain: str, digits: int = 5) -> str:
    for unit, size in units:
        if abs(value) >= size:
            return f"{value / size:.{digits}g} {unit}"
    return f"{value:.{digits}g} {plain}"
