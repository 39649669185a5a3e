"""What a reader of a verdict has to know besides it: lever arms, clocks, assumptions, effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from syncline_design.model.budget import differs
from syncline_design.model.quantity import Dimension, format_quantity
from syncline_design.model.system import UTC
from syncline_design.spec.load import LoadedSpec
from syncline_design.verdict.tree import Verified

Json = dict[str, Any]


def cautions(
    loaded: LoadedSpec, verified: Verified, assumed: Sequence[Mapping[str, Any]]
) -> list[Json]:
    """The `warnings` of a verdict: a code to filter by, a sentence to read, what it is about."""
    return [
        caution.to_json()
        for caution in (
            *_worst_case(verified),
            *_lever_arm(verified),
            *_clocks(loaded, verified),
            *_waivers(verified),
            *_simulation(verified),
            *_assumptions(assumed),
        )
    ]


@dataclass(frozen=True, slots=True)
class Caution:
    """One warning; entry: of a catalog; key: its figure; requirement: an id of the spec."""

    code: str
    message: str
    entry: str = ""
    key: str = ""
    requirement: str = ""

    def to_json(self) -> Json:
        """The entry under `warnings`; what it is not about is left out."""
        about = {"entry": self.entry, "key": self.key, "requirement": self.requirement}
        named = {name: text for name, text in about.items() if text}
        return {"code": self.code, "message": self.message} | named


def _time(value: float) -> str:
    return format_quantity(value, Dimension.TIME)


def _length(value: float) -> str:
    return format_quantity(value, Dimension.LENGTH)


def _worst_case(verified: Verified) -> Iterator[Caution]:
    """A design that keeps an accuracy limit which its certified worst case exceeds.

    Of several limits the tightest one that is kept: a failed one says enough itself.
    """
    kept = [r for r in verified.requirements if r.kind == "accuracy" and r.status == "pass"]
    worst = verified.worst_case_1sigma_m
    if worst is None or not kept:
        return
    tightest = min(kept, key=lambda row: row.limit)
    if not worst <= tightest.limit:
        yield Caution(
            "worst-case-above-limit",
            f"{tightest.id}: the Syncline keeps {_length(tightest.limit)}, yet with every sensor "
            "at one sigma and every timestamp within its own bound the certified worst case is "
            f"{_length(worst)}: the Syncline leaves out what lever arms, tilt and scatter add",
            requirement=tightest.id,
        )


def _lever_arm(verified: Verified) -> Iterator[Caution]:
    """Where leaving the lever arm out, as the paper does, is optimistic by more than 10 %."""
    figures = verified.figures
    for row in figures.sensors:
        if differs(row.tau_crit_s, row.tau_crit_lever_arm_s):
            ratio = row.tau_crit_s / row.tau_crit_lever_arm_s
            broken = " and is exceeded" if not row.tau_s < row.tau_crit_lever_arm_s else ""
            yield Caution(
                "lever-arm",
                f"{row.stage}.{row.role}: with the lever arm, tau_crit is "
                f"{_time(row.tau_crit_lever_arm_s)} instead of {_time(row.tau_crit_s)} "
                f"(the paper's figure is optimistic by a factor of {ratio:.3g}){broken}",
            )
    lever = figures.lever_arm
    if differs(figures.total_m, lever.total_m):
        yield Caution(
            "lever-arm",
            f"with lever arms the total error is {_length(lever.total_m)} instead of "
            f"{_length(figures.total_m)}",
        )


def _clocks(loaded: LoadedSpec, verified: Verified) -> Iterator[Caution]:
    """Vehicles whose clocks are taken as common because the spec says nothing."""
    vehicles = {stage.vehicle for stage in verified.system.stages}
    timed = {stage.vehicle_name for stage in loaded.spec.stages if stage.clock is not None}
    silent = sorted(vehicles - timed)
    if len(vehicles) > 1 and silent:
        yield Caution(
            "common-clock",
            f"the clocks of {', '.join(sorted(vehicles))} are taken as common because "
            f"{', '.join(silent)} gives no `clock`; across vehicles without a common clock "
            "holdover drift is the honest figure",
        )
        return
    for stage in verified.system.stages:
        if stage.vehicle not in silent:
            continue
        if stage.ranging is None:
            if stage.position is not None and stage.position.timeline != UTC:
                yield Caution(
                    "common-clock",
                    f"{stage.name} is stamped on the host clock and held against true time, and "
                    "no `clock` says how far these are apart: the offset is taken as 0",
                )
            continue
        lines = {"utc" if s.timeline == UTC else "host" for s in stage.sensors()}
        if len(lines) > 1:
            yield Caution(
                "common-clock",
                f"{stage.name} has sensors on the host clock and on UTC, and no `clock` says how "
                "far these are apart: the offset is taken as 0",
            )


def _waivers(verified: Verified) -> Iterator[Caution]:
    for row in verified.requirements:
        if row.waiver is not None:
            state = "expired on" if row.waiver["expired"] else "in force until"
            yield Caution(
                "waiver",
                f"{row.id}: waiver {state} {row.waiver['expires']}: {row.waiver['reason']}",
                requirement=row.id,
            )


def _simulation(verified: Verified) -> Iterator[Caution]:
    if verified.monte_carlo is None:
        yield Caution("no-monte-carlo", f"no Monte Carlo cross-check: {verified.trouble}")
        return
    ensemble = verified.monte_carlo.ensemble
    if ensemble is not None and ensemble.outside:
        yield Caution(
            "trajectory-outside",
            f"{ensemble.outside_text()}; beyond, their figures do not hold and the simulated "
            "errors may exceed them",
        )


def _assumptions(assumed: Sequence[Mapping[str, Any]]) -> Iterator[Caution]:
    """Figures without a public source, one line an entry."""
    by_entry: dict[str, list[str]] = {}
    for one in assumed:
        by_entry.setdefault(str(one["entry"]), []).append(str(one["figure"]))
    for entry, figures in by_entry.items():
        message = f"assumption, no public source: {', '.join(figures)} of {entry}"
        yield Caution("assumption", message, entry=entry, key=", ".join(figures))
