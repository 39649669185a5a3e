"""Verdicts made by hand for tests of the outputs; figures follow from plain sums written here."""

from __future__ import annotations

import collections.abc
import copy
import functools
import itertools
import math
import types
from dataclasses import replace
from typing import Any, get_args, get_origin, get_type_hints

from syncline_design.choice.outcome import Explanation
from syncline_design.machine.records import Record
from syncline_design.paper.reproduce import Reproduction, reproduce
from syncline_design.report.document import Document
from syncline_design.report.on_simulation import on_simulation
from syncline_design.simulation import Simulation, SimulationSettings, simulate
from syncline_design.simulation.results import SpecName
from syncline_design.verdict.tree import (
    ChoiceResult,
    FileProblem,
    NamedDesign,
    Refused,
    RequirementResult,
    Verdict,
)
from tests.simulation_systems import fixed_wing as fixed_wing_system

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


def role(sensor: str, name: str, primitive: str, tau: float, crit: float, error: float) -> Any:
    methods = {"tov": "hardware", "pps": "hardware", "network": "ptp_hw"}
    names = {"tov": "timer capture", "pps": "timer capture", "network": "PTP, hardware stamps"}
    return {
        "sensor": sensor,
        "name": name,
        "primitive": primitive,
        "timestamping": methods[primitive],
        "timestamping_name": names[primitive],
        "timeline": "host" if primitive == "tov" else "utc",
        "tau_s": tau,
        "tau_crit_s": crit,
        "tau_crit_lever_arm_s": 0.94 * crit,
        "sensor_error_m": error,
        "cost": 9_000.0,
    }


def _fixed_wing() -> dict[str, Any]:
    """Its plain data."""
    v, omega, d = 21.0, math.radians(77.9), 100.0
    rate = v + d * omega
    sigma_att = math.radians(math.hypot(0.008, 0.008, 0.03))
    sigma_u = math.radians(math.hypot(0.006, 0.006))
    errors = {"position": 0.01, "attitude": sigma_att * d, "ranging": 0.01 + sigma_u * d}
    sensor_error = sum(errors.values())
    tau = 20e-6
    total = sensor_error + rate * tau
    roles = {
        "position": role("ublox_f9p_rtk", "u-blox F9P RTK", "tov", 1e-6, 0.01 / v, 0.01),
        "attitude": role(
            "sbg_apogee", "SBG Apogee", "pps", 5e-6, errors["attitude"] / rate, errors["attitude"]
        ),
        "ranging": role(
            "riegl_vux1uav", "RIEGL VUX-1UAV", "network", 19e-6, errors["ranging"] / rate,
            errors["ranging"],
        ),
    }  # fmt: skip
    return {
        "schema": "syncline-design/verdict/v1",
        "verdict": "meets",
        "spec": {
            "name": "UAV corridor mapping",
            "file": "specs/uav_corridor.yaml",
            "currency": "EUR",
            "sync_model": "syncline",
            "objective": "cost",
            "coverage_factor": 3,
            "combinations": "5760",
            "open_roles": ["uav.position", "uav.attitude"],
            "stages": [
                {
                    "name": "uav",
                    "vehicle": "uav",
                    "platform": {
                        "id": "uav_fixed_wing",
                        "name": "UAV fixed wing",
                        "v_max_mps": v,
                        "omega_max_radps": omega,
                        "distance_m": d,
                        "baseline_m": 1.0,
                    },
                }
            ],
        },
        "horizon": {"duration_s": 3600.0, "extent_m": 1000.0, "tilt_rad": math.radians(10.0)},
        "requirements": [
            requirement("ACC-1", "accuracy", total, 0.30, "m", 8),
            requirement("SYNC-1", "sync", 0.16, 1.0, "", 9),
            requirement("COST-1", "cost", 38_400.0, 40_000.0, "EUR", 10),
            requirement("MASS-1", "mass", 2.1, 3.0, "kg", 11),
            requirement("MC-1", "monte_carlo", 0.071, 0.30, "m", 12)
            | {"quantile": 0.95, "low": 0.0705, "high": 0.0714},
        ],
        "design": {
            "cost": 38_400.0,
            "mass": 2.1,
            "power": 41.0,
            "currency": "EUR",
            "infrastructure": [
                {
                    "id": "timing_board",
                    "name": "Timing board",
                    "vehicle": "uav",
                    "count": 1,
                    "cost": 400.0,
                }
            ],
            "clocks": [{"vehicle": "uav", "id": "pps_hardware"}],
            "stages": [
                {"name": "uav", "platform": "uav_fixed_wing", "vehicle": "uav", "roles": roles}
            ],
        },
        "syncline": syncline_section(v, omega, d, errors, tau),
        "monte_carlo": monte_carlo_section(total),
        "warnings": [
            {"code": "assumption", "message": "price of riegl_vux1uav is an assumption"},
        ],
        "assumptions": [
            {
                "entry": "riegl_vux1uav",
                "section": "sensors",
                "figure": "cost",
                "value": "30000 EUR",
                "note": "no public price",
            },
        ],
        "sources": [
            {
                "entry": "uav_fixed_wing",
                "section": "platforms",
                "source": "Jellum et al., arXiv:2209.01136v2, table 2",
            },
            {
                "entry": "sbg_apogee",
                "section": "sensors",
                "source": "Jellum et al., arXiv:2209.01136v2, table 3",
            },
        ],
        "effects": [
            {
                "effect": "latency",
                "sensor": "position",
                "stage": "uav",
                "parameters": {"latency_s": 0.002},
                "sentence": "The position data are 2 ms older than their stamp.",
            },
        ],
        "choice": choice_section(total),
        "infeasibility": None,
        "provenance": {
            "version": "0.1.0",
            "spec_sha256": "a" * 64,
            "catalogs_sha256": "b" * 64,
            "files": [],
            "seed": 1,
            "python": "3.11.2",
            "numpy": "2.0.0",
        },
    }


def requirement(
    name: str, kind: str, value: float, limit: float, unit: str, line: int
) -> dict[str, Any]:
    met = value < limit if kind == "sync" else value <= limit
    return {
        "id": name,
        "kind": kind,
        "status": "pass" if met else "fail",
        "value": value,
        "limit": limit,
        "unit": unit,
        "margin": limit - value,
        "line": line,
        "column": 5,
        "note": "",
        "implied": False,
    }


def syncline_section(
    v: float, omega: float, d: float, errors: dict[str, float], tau: float
) -> dict[str, Any]:
    rate = v + d * omega
    sensor_error = sum(errors.values())
    terms = [
        ("sigma_p", errors["position"], "sensor"),
        ("sigma_Theta*d", errors["attitude"], "sensor"),
        ("sigma_r", 0.01, "sensor"),
        ("sigma_u*d", errors["ranging"] - 0.01, "sensor"),
        ("v_max*tau", v * tau, "sync"),
        ("d*omega_max*tau", d * omega * tau, "sync"),
    ]
    total = sensor_error + rate * tau
    lever_rate = rate + omega
    return {
        "sensor_error_m": sensor_error,
        "sync_rate_mps": rate,
        "tau_s": tau,
        "tau_crit_s": sensor_error / rate,
        "sync_error_m": rate * tau,
        "systematic_error_m": 0.0,
        "total_m": total,
        "model": "syncline",
        "models": {
            "syncline": {"sync_error_m": rate * tau, "total_m": total},
            "per_sensor": {"sync_error_m": 0.8 * rate * tau, "total_m": total - 0.2 * rate * tau},
        },
        "lever_arm": {
            "tau_crit_s": sensor_error / lever_rate,
            "total_m": sensor_error + lever_rate * tau,
            "sync_rate_mps": lever_rate,
            "differs": False,
        },
        "stages": [
            {
                "name": "uav",
                "sensor_error_m": sensor_error,
                "sync_rate_mps": rate,
                "tau_s": tau,
                "tau_crit_s": sensor_error / rate,
            }
        ],
        "ledger": [
            {
                "term": term,
                "stage": "uav",
                "value_m": value,
                "kind": kind,
                "share": value / total,
            }
            for term, value, kind in terms
        ],
    }


def monte_carlo_section(total: float) -> dict[str, Any]:
    edges = [0.005 * i for i in range(25)]
    middles = [0.5 * (a + b) for a, b in itertools.pairwise(edges)]
    density = [m * math.exp(-((m / 0.03) ** 2)) for m in middles]
    envelope = {"shift_s": 20e-6, "tilt_rad": math.radians(10.0), "sensors": "one sigma"}
    worst = 0.97 * total
    return {
        "samples": 200_000,
        "seed": 1,
        "envelope": "limits",
        "estimator": "plain",
        "effective_samples": 200_000,
        "confidence": 0.95,
        "ensemble": {
            "over": "over_missions",
            "mission_constants": [],
            "per_sample": ["noise"],
            "outside": [],
            "text": "every sample is a mission of its own",
        },
        "quantiles": {
            "0.5": {"value_m": 0.031, "low_m": 0.0309, "high_m": 0.0311},
            "0.95": {"value_m": 0.071, "low_m": 0.0705, "high_m": 0.0714},
            "0.997": {"value_m": 0.094, "low_m": 0.093, "high_m": 0.0954},
        },
        "probability_within_target": {"target_m": 0.30, "value": 1.0, "low": 0.99998, "high": 1.0},
        "worst_case": {
            "tau_s": 20e-6,
            "value_m": worst,
            "syncline_m": total,
            "ratio_to_syncline": 0.97,
            "bound_m": total,
            "certificate": {
                "gap": 0.03,
                "triangle_m": total,
                "envelope": envelope,
                "text": "with every sensor at one sigma nothing exceeds the bound",
            },
        },
        "histogram": {"edges_m": edges, "density": density},
    }


def choice_section(total: float) -> dict[str, Any]:
    front = [
        {"cost": 31_000.0, "error_m": 0.42, "design": "u-blox F9P RTK, SBG Ellipse, HDL-32E"},
        {"cost": 34_500.0, "error_m": 0.21, "design": "u-blox F9P RTK, SBG Apogee, HDL-32E"},
        {"cost": 38_400.0, "error_m": total, "design": "u-blox F9P RTK, SBG Apogee, VUX-1UAV"},
        {"cost": 61_000.0, "error_m": 0.039, "design": "u-blox F9P RTK, MRU5, VUX-1UAV"},
    ]
    return {
        "proof": {"method": "front", "optimal": True, "rechecked": True},
        "front": front,
        "staircase": [
            {"cost": 31_000.0, "tightest_m": 0.42, "looser_than_m": None, "extra": None},
            {"cost": 34_500.0, "tightest_m": 0.21, "looser_than_m": 0.42, "extra": 3_500.0},
        ],
        "next_best": [{"cost": 39_100.0, "error_m": 0.093, "design": front[2]["design"]}],
        "excluded": [
            {
                "stage": "uav",
                "role": "attitude",
                "sensor": "kongsberg_mru5",
                "primitive": "arrival",
                "method": "uart",
                "reason": "tau 2 ms exceeds its tau_crit of 38 us",
            },
        ],
    }


def typed(kind: Any, data: Any) -> Any:
    """Plain data as the records of a type; a key too many or too few is an error."""
    if data is None:
        return None
    if isinstance(kind, types.UnionType):
        return typed(next(arg for arg in get_args(kind) if arg is not type(None)), data)
    if get_origin(kind) is tuple:
        return tuple(typed(get_args(kind)[0], entry) for entry in data)
    if get_origin(kind) is collections.abc.Mapping:
        return {key: typed(get_args(kind)[1], entry) for key, entry in data.items()}
    if not (isinstance(kind, type) and issubclass(kind, Record)):
        return data
    if kind in (NamedDesign, ChoiceResult, Explanation):
        return data  # invented in part: the reports read these as plain data
    hints = get_type_hints(kind)
    return kind(**{key: typed(hints[key], entry) for key, entry in data.items()})


def fixed_wing() -> Verdict:
    """One stage, everything present, meets."""
    found: Verdict = typed(Verdict, _fixed_wing())
    return found


def with_requirement(verdict: Verdict, place: int, **changes: Any) -> Verdict:
    """A verdict with one of its requirements changed."""
    rows = list(verdict.requirements)
    rows[place] = replace(rows[place], **changes)
    return replace(verdict, requirements=tuple(rows))


def failing() -> Verdict:
    """The same system held to 5 cm: accuracy fails."""
    verdict = replace(fixed_wing(), verdict="fails")
    assert verdict.syncline is not None
    row = requirement("ACC-1", "accuracy", verdict.syncline.total_m, 0.05, "m", 8)
    return with_requirement(verdict, 0, **row)


INFEASIBILITY: dict[str, Any] = {
    "roles_without_options": [
        {"stage": "uav", "role": "attitude", "nearest": "sbg_ellipse with gpio",
         "misses_by": 1.8,
         "text": "No option for uav attitude: the nearest, sbg_ellipse stamped by gpio, has 1.8 "
                 "times the timestamp error that it may have"},
    ],
    "conflict": {
        "requirements": [{"id": "ACC-1", "line": 8}, {"id": "COST-1", "line": 10}],
        "minimal": True,
    },
    "fixes": [
        {"kind": "requirement", "requirement": "ACC-1", "from": 0.05, "to": 0.098,
         "text": "ACC-1 from 5 cm to 9.8 cm", "proven": True},
        {"text": "COST-1 by 3 400 EUR"},
    ],
    "text": [
        "No design meets this spec.",
        "  No option for uav attitude: the nearest, sbg_ellipse stamped by gpio, has 1.8 times the "
        "timestamp error that it may have",
    ],
}  # fmt: skip


def infeasible() -> Verdict:
    """No design at all."""
    rows = [
        requirement("ACC-1", "accuracy", 1.0, 0.05, "m", 8)
        | {"status": "fail", "value": None, "margin": None, "note": "part of the conflict"},
        requirement("COST-1", "cost", 1.0, 9_000.0, "EUR", 10)
        | {"status": "fail", "value": None, "margin": None, "note": "part of the conflict"},
        requirement("SYNC-1", "sync", 0.5, 1.0, "1", 9)
        | {"status": "indeterminate", "value": None, "margin": None},
    ]
    return replace(
        fixed_wing(),
        verdict="infeasible",
        requirements=typed(tuple[RequirementResult, ...], rows),
        infeasibility=copy.deepcopy(INFEASIBILITY),
        design=None,
        syncline=None,
        monte_carlo=None,
        choice=None,
    )


def two_stages() -> Verdict:
    """A chain of two stages, with an unlimited tau_crit and missing optional parts."""
    plain = _fixed_wing()
    second = copy.deepcopy(plain["design"]["stages"][0])
    second["name"] = second["vehicle"] = "auv"
    del second["roles"]["position"]
    second["roles"]["attitude"]["tau_crit_s"] = None
    plain["design"]["stages"].append(second)
    stage = copy.deepcopy(plain["spec"]["stages"][0]) | {"name": "auv", "vehicle": "auv"}
    plain["spec"]["stages"].append(stage)
    for key in ("monte_carlo", "choice", "effects", "assumptions"):
        plain[key] = None
    found: Verdict = typed(Verdict, plain)
    return found


def with_hostile_text(text: str) -> Verdict:
    """Every free text of a verdict replaced by one hostile string."""
    plain = _fixed_wing()
    plain["spec"]["name"] = text
    plain["spec"]["file"] = "specs/x.yaml"
    plain["spec"]["stages"][0]["name"] = text
    plain["spec"]["stages"][0]["platform"]["name"] = text
    for row in plain["requirements"]:
        row["id"] = row["id"] + text
        row["note"] = text
        row["status"] = "fail"
    plain["verdict"] = "fails"
    stage = plain["design"]["stages"][0]
    stage["name"] = text
    for entry in stage["roles"].values():
        entry["name"] = entry["sensor"] = entry["timestamping_name"] = text
    for term in plain["syncline"]["ledger"]:
        term["term"] = term["stage"] = text
    for key, fields in (("warnings", ("message",)), ("effects", ("sentence",))):
        for entry in plain[key]:
            for field in fields:
                entry[field] = text
    for entry in plain["assumptions"] + plain["sources"]:
        for field in entry:
            entry[field] = text
    for entry in plain["choice"]["front"] + plain["choice"]["excluded"]:
        for field, value in entry.items():
            if isinstance(value, str):
                entry[field] = text
    plain["infeasibility"] = {
        "roles_without_options": [],
        "conflict": None,
        "fixes": [{"text": text}],
    }
    found: Verdict = typed(Verdict, plain)
    return found


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
    return reproduce(simulate=False)


def simulation() -> tuple[Document, Simulation]:
    """A simulated system whose name is hostile; real figures."""
    system = fixed_wing_system()
    settings = SimulationSettings(samples=500, limit_m=0.3, tau_grid_s=(1e-5, 0.1, 1.0))
    named = SpecName("".join(HOSTILE), "specs/uav.yaml")
    result = replace(simulate(system, settings), spec=named)
    return on_simulation(result, system), result
