"""Verdicts of small specs, made by the product; what else one may say is put in by `replace`."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

from syncline_design.choice.outcome import Conflict, Explanation, Fix
from syncline_design.machine.records import with_texts
from syncline_design.paper.reproduce import Reproduction, reproduce
from syncline_design.report.document import Document
from syncline_design.report.on_simulation import on_simulation
from syncline_design.simulation import Simulation, SimulationSettings, simulate
from syncline_design.simulation.results import SpecName
from syncline_design.spec.load import load_text
from syncline_design.verdict.named import NamedDesign
from syncline_design.verdict.tree import FileProblem, Refused, Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests.simulation_systems import fixed_wing as fixed_wing_system

FILE = "specs/uav_corridor.yaml"
OPEN = """\
syncline: 1
name: UAV corridor mapping
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.12 m}
  - {id: SYNC-1, kind: sync, limit: 1.0}
  - {id: COST-1, kind: cost, limit: 300000 EUR}
  - {id: MASS-1, kind: mass, limit: 6 kg}
  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 0.30 m}
monte_carlo: {samples: 2000}
effects:
  - {effect: latency, sensor: position, parameters: {latency_s: 2 us}}
stages:
  - name: uav
    platform: uav_fixed_wing
    position: {candidates: [ublox_f9p_rtk]}
    attitude: {candidates: [sbg_ellipse, sbg_apogee, kongsberg_mru5]}
    ranging: {candidates: [velodyne_hdl32e, riegl_vux1uav]}
timestamping: {candidates: [hardware, gpio, arrival]}
"""
PINNED = """\
syncline: 1
name: UAV corridor mapping
requirements:
  - {id: ACC-1, kind: accuracy, limit: 5 cm}
  - {id: SYNC-1, kind: sync, limit: 1.0}
  - {id: COST-1, kind: cost, limit: 300000 EUR}
  - {id: MASS-1, kind: mass, limit: 6 kg}
  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 0.30 m}
monte_carlo: {samples: 2000}
stages:
  - name: uav
    platform: uav_fixed_wing
    position: {sensor: ublox_f9p_rtk, primitive: pps, timestamping: hardware}
    attitude: {sensor: sbg_apogee, primitive: pps, timestamping: hardware}
    ranging: {sensor: riegl_vux1uav, primitive: pps, timestamping: hardware}
"""
CHAIN = """\
syncline: 1
name: A chain whose second stage stands still
requirements:
  - {id: ACC-1, kind: accuracy, limit: 3 m}
stages:
  - name: vessel
    platform: {use: large_sv, distance: 800 m}
    clock: {candidates: [pps_gpio]}
    position: {sensor: ublox_f9p_rtk, primitive: pps, timestamping: pps_gnss}
    attitude: {sensor: kongsberg_mru5, primitive: pps, timestamping: gpio}
    ranging: {sensor: kongsberg_hipap502, primitive: pps, timestamping: gpio}
  - name: lander
    platform: {name: Lander, v_max: 0 m/s, omega_max: 0 deg/s, distance: 6 m, baseline: 0.8 m}
    clock: {candidates: [ocxo]}
    attitude: {sensor: sbg_ellipse, primitive: tov, timestamping: gpio}
    ranging: {sensor: kongsberg_m3, primitive: tov, timestamping: gpio}
"""

HOSTILE = (
    "</script><script>alert(1)</script>",
    r"$\frac{$",
    '=HYPERLINK("https://example.invalid","x")',
    "name\n::error file=a.py,line=1::owned",
    "bell\x07 null\x00 escape\x1b[31m",
    "\u202egnp.exe",
    "lone \ud800 surrogate",
    '"><img src=x onerror=alert(1)>',
    "{{ 7 * 7 }}{% raw %}",
    "<!-- ]]> & -->",
    "a|b\\n*c*_d_`e`[f](javascript:alert(1)) @everyone",
)


def line_of(spec: str, identity: str) -> int:
    """The line of a spec that holds a requirement."""
    return 1 + next(i for i, line in enumerate(spec.splitlines()) if f"id: {identity}," in line)


@functools.cache
def checked(spec: str, monte_carlo: bool = True) -> Verdict:
    """The verdict on a spec."""
    return check_loaded(load_text(spec, FILE), CheckSettings(1, monte_carlo=monte_carlo))


def fixed_wing() -> Verdict:
    """One stage, chosen, simulated, with a known effect; meets."""
    return checked(OPEN)


def with_requirement(verdict: Verdict, place: int, **changes: Any) -> Verdict:
    """A verdict with one of its requirements changed."""
    rows = list(verdict.requirements)
    rows[place] = replace(rows[place], **changes)
    return replace(verdict, requirements=tuple(rows))


def failing() -> Verdict:
    """Pinned and held to 5 cm: accuracy fails."""
    return checked(PINNED)


def infeasible() -> Verdict:
    """No design at all: accuracy and cost exclude one another."""
    return checked(OPEN.replace("300000", "60000"), monte_carlo=False)


def without_option() -> Verdict:
    """No design at all: the lidar may only be stamped on arrival, far too late."""
    ranging = "{candidates: [velodyne_hdl32e], timestamping: {candidates: [arrival]}}"
    return checked(OPEN.replace("{candidates: [velodyne_hdl32e, riegl_vux1uav]}", ranging), False)


def explained(verdict: Verdict, **changes: Any) -> Verdict:
    """An infeasible verdict with its reasons changed."""
    assert verdict.infeasibility is not None
    return replace(verdict, infeasibility=replace(verdict.infeasibility, **changes))


def two_stages() -> Verdict:
    """A chain of two stages, pinned, not simulated, with an unlimited tau_crit."""
    return checked(CHAIN, monte_carlo=False)


def with_hostile_text(text: str) -> Verdict:
    """Every free text of a verdict replaced by one hostile string."""
    plain = fixed_wing()
    assert plain.design is not None
    assert plain.syncline is not None
    assert plain.choice is not None
    rows = tuple(
        replace(row, id=row.id + text, note=text, status="fail") for row in plain.requirements
    )
    (stage,) = plain.spec.stages
    stage = replace(stage, name=text, platform=replace(stage.platform, name=text))
    terms = tuple(replace(term, term=text, stage=text) for term in plain.syncline.ledger)
    points = plain.choice.front or ()
    front = tuple(replace(one, design=_renamed(one.design, text)) for one in points)
    fix = Fix("cost", None, None, None, None, None, None, text)
    return replace(
        plain,
        verdict="fails",
        spec=replace(plain.spec, name=text, file="specs/x.yaml", stages=(stage,)),
        requirements=rows,
        design=_renamed(plain.design, text),
        syncline=replace(plain.syncline, ledger=terms),
        warnings=tuple(replace(one, message=text) for one in plain.warnings),
        effects=tuple(replace(one, sentence=text) for one in plain.effects or ()),
        assumptions=with_texts(plain.assumptions, lambda _: text),
        sources=with_texts(plain.sources, lambda _: text),
        choice=replace(
            plain.choice, front=front, excluded=with_texts(plain.choice.excluded, lambda _: text)
        ),
        infeasibility=Explanation((), Conflict((), False), (), (fix,), (), False),
    )


def _renamed(design: NamedDesign, text: str) -> NamedDesign:
    """A design whose stages and sensors all have one name."""
    stages = []
    for stage in design.stages:
        roles = {
            role: replace(one, name=text, sensor=text, timestamping_name=text)
            for role, one in stage.roles.items()
        }
        stages.append(replace(stage, name=text, roles=roles))
    return replace(design, stages=tuple(stages))


REFUSED = Refused(
    file="specs/bad.yaml",
    problems=(
        FileProblem(
            "specs/bad.yaml", 3, 7, "stages[0].platform",
            "unknown id uav_fixd_wing; did you mean uav_fixed_wing?",
        ),
    ),
    text="specs/bad.yaml:3:7: stages[0].platform: unknown id uav_fixd_wing",
)  # fmt: skip


@functools.cache
def reproduction() -> Reproduction:
    """The paper, computed for real; without the two figures that are simulated."""
    return reproduce(simulate=False, seed=0)


def simulation() -> tuple[Document, Simulation]:
    """A simulated system whose name is hostile; real figures."""
    system = fixed_wing_system()
    settings = SimulationSettings(samples=500, limit_m=0.3, tau_grid_s=(1e-5, 0.1, 1.0))
    named = SpecName("".join(HOSTILE), "specs/uav.yaml")
    result = replace(simulate(system, settings), spec=named)
    return on_simulation(result, system), result
