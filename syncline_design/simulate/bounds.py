"""Upper bounds of the error by geometry: what no choice of directions can exceed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from syncline_design.model.budget import budget
from syncline_design.model.system import RoleName, Stage, System
from syncline_design.simulate import known_effects
from syncline_design.simulate.draws import arm_lengths

ExtraTau = Mapping[tuple[str, RoleName], float]


@dataclass(frozen=True, slots=True)
class StageBound:
    """One stage's largest error [m] at given relative shifts, and what it is made of.

    bound_m: by chords and the law of cosines; triangle_m: the plain sum of terms with arcs;
    lever_arm_m: what lever arms add to triangle_m; arc_m, chord_m: the swing of the line of sight
    as the arc d w tau and as the chord it is; across_m: errors across the line of sight;
    range_m: the range noise along it.
    """

    bound_m: float
    triangle_m: float
    lever_arm_m: float
    arc_m: float
    chord_m: float
    across_m: float
    range_m: float


def chord(angle_rad: float) -> float:
    """2 sin(a/2), a <= pi: how far the end of a unit vector gets when it turns by a at most."""
    return 2.0 * math.sin(0.5 * min(angle_rad, math.pi))


def stage_bound(stage: Stage, first: bool, tau_p_s: float, tau_a_s: float) -> StageBound:
    """Largest |e| [m] of one stage for position shifts up to tau_p and attitude shifts up to tau_a.

    |dp| <= v tau_p + sigma_p; the antenna's arm l_G turns by at most w tau_p; the measured
    attitude is off by at most a = w tau_a + sigma_Theta sqrt(1 + sin(pitch)), pitch <= w tau_a +
    sigma_Theta (a path of length s in Euler angles turns by at most s sqrt(1 + |sin pitch|)); the
    measured vector and the true one enclose at most a + sigma_u, and their lengths differ by at
    most sigma_r, which bounds their distance by the law of cosines.
    """
    platform = stage.platform
    v, omega = float(platform.v_max_mps), float(platform.omega_max_radps)
    sigma_p = 0.0 if stage.position is None else math.hypot(*stage.position.sigma)
    antenna, difference = arm_lengths(stage, first)
    turn_p, turn_a = omega * tau_p_s, omega * tau_a_s
    position = v * tau_p_s + sigma_p
    if stage.ranging is None or stage.attitude is None:
        arc = position + turn_p * antenna
        chorded = position + chord(turn_p) * antenna
        return StageBound(chorded, arc, turn_p * antenna, 0.0, 0.0, 0.0, 0.0)
    d = float(platform.distance_m)
    sigma_a = math.hypot(*stage.attitude.sigma)
    sigma_u = math.hypot(*stage.ranging.sigma[1:])
    sigma_r = float(stage.ranging.sigma[0])
    pitch = min(turn_a + sigma_a, 0.5 * math.pi)
    tilt = turn_a + sigma_a * math.sqrt(1.0 + math.sin(pitch))
    arms = chord(turn_p) * antenna + chord(tilt) * difference
    sight = _vector_distance(d, sigma_r, tilt + sigma_u)
    lever = turn_p * antenna + (turn_a + sigma_a) * difference
    across = d * (turn_a + sigma_a + sigma_u)
    return StageBound(
        bound_m=position + arms + sight,
        triangle_m=position + lever + across + sigma_r,
        lever_arm_m=lever,
        arc_m=d * turn_a,
        chord_m=d * chord(turn_a),
        across_m=across,
        range_m=sigma_r,
    )


def _vector_distance(length: float, longer_by: float, angle_rad: float) -> float:
    """Distance of two vectors, one `longer_by` longer, that enclose at most an angle."""
    other = length + longer_by
    squared = longer_by**2 + length * other * chord(angle_rad) ** 2
    return math.sqrt(squared)


def chain_bounds(system: System, tau_s: float) -> tuple[StageBound, ...]:
    """Each stage's bound with every pair's relative shift at most tau plus what effects add."""
    extra, _ = known_effects.contributions(system)
    return tuple(
        stage_bound(
            stage,
            index == 0,
            tau_s + pair_extra_s(system, index, "position", extra),
            tau_s + pair_extra_s(system, index, "attitude", extra),
        )
        for index, stage in enumerate(system.stages)
    )


def pair_extra_s(system: System, index: int, role: RoleName, extra: ExtraTau) -> float:
    """What known effects add [s] to a stage's position or attitude pair.

    Its own sensor's (from the second stage on, the position is the ranging of the stage before)
    and the reference's, which the ranging sensor is.
    """
    stage = system.stages[index]
    own: tuple[str, RoleName] = (stage.name, role)
    if role == "position" and index > 0:
        own = (system.stages[index - 1].name, "ranging")
    reference = 0.0 if stage.ranging is None else extra.get((stage.name, "ranging"), 0.0)
    return extra.get(own, 0.0) + reference


def references(system: System, tau_s: float) -> tuple[float, float, float]:
    """(bound, triangle, Syncline) [m] at relative shifts of at most tau.

    Known effects widen the pairs' shifts and add their systematic terms to all three; the
    Syncline is the paper's [eq:syncline], (sum of v + d w) tau + sensor errors.
    """
    extra, systematic = known_effects.contributions(system)
    added = math.fsum(value for _, _, value in systematic)
    bounds = chain_bounds(system, tau_s)
    widest = max(
        pair_extra_s(system, index, role, extra)
        for index in range(len(system.stages))
        for role in ("position", "attitude")
    )
    figures = budget(system, extra, systematic)
    syncline = (
        figures.sensor_error_m + figures.systematic_m + figures.sync_rate_mps * (tau_s + widest)
    )
    return (
        math.fsum(part.bound_m for part in bounds) + added,
        math.fsum(part.triangle_m for part in bounds) + added,
        syncline,
    )
