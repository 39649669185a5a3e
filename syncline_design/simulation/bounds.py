"""Upper bounds of the error by geometry: what no choice of directions can exceed.

They hold in a stated envelope: every pair's relative shift at most tau (plus what effects add),
tilt at most the horizon's, every sensor at one sigma in each of its norms, speed, turn rate and
distance at most the platform's, time and place within the horizon, and known effects at most at
what the budget charges for them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from syncline_design.effects import acting as acting_effects
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import budget
from syncline_design.model.known import Known
from syncline_design.model.lever_arms import arm_difference, arm_lengths, ranging_arm_m
from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Look, Stage, System

# Largest relative shifts [s] of position and attitude against ranging, and of both to each other.
StageShifts = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Added:
    """What known effects add to one stage at most.

    position_s, attitude_s: to the relative shifts; turn_rad: turn of the measured attitude;
    euler_rad: noise of roll, pitch and yaw; sight_rad: turn of the line of sight in the body;
    offset_m: displacements.
    """

    position_s: float = 0.0
    attitude_s: float = 0.0
    turn_rad: float = 0.0
    euler_rad: float = 0.0
    sight_rad: float = 0.0
    offset_m: float = 0.0


@dataclass(frozen=True, slots=True)
class StageBound:
    """One stage's largest error [m] at given relative shifts, and what it is made of.

    bound_m: by chords and the law of cosines; triangle_m: the plain sum of terms with arcs;
    lever_arm_m: what lever arms add to triangle_m; arc_m, chord_m: the swing of the line of sight
    as the arc d w tau and as the chord it is; across_m: errors across the line of sight;
    range_m: the range noise along it; tilt_m: what tilted Euler axes add to the attitude noise.
    """

    bound_m: float
    triangle_m: float
    lever_arm_m: float
    arc_m: float
    chord_m: float
    across_m: float
    range_m: float
    tilt_m: float


def chord(angle_rad: float) -> float:
    """2 sin(a/2), a <= pi: how far the end of a unit vector gets when it turns by a at most."""
    return 2.0 * math.sin(0.5 * min(angle_rad, math.pi))


def stage_bound(
    stage: Stage, first: bool, shifts_s: StageShifts, tilt_rad: float, added: Added
) -> StageBound:
    """Largest |e| [m] of one stage for relative shifts up to (tau_p, tau_a) plus what effects add.

    |dp| <= v tau_p + sigma_p; the antenna's arm l_G turns by at most w tau_p, in two parts where
    an effect displaces by its own; the measured attitude is off by at most
    a = w tau_a + turn + sigma_Theta sqrt(1 + |sin pitch|) (a path of length s in Euler angles turns
    by at most s sqrt(1 + |sin pitch|)), |pitch| at most tilt + w tau_a + turn + sigma_Theta; the
    measured vector and the true one enclose at most a + sigma_u, and their lengths differ by at
    most sigma_r, which bounds their distance by the law of cosines.  Under a bounded `look` a sight
    near the vertical swings by less, and what is turned as a whole, l_L - l_G + d n, may be shorter
    than the sum of both; the smaller of the two bounds holds.

    What the antenna's arm is off by on its own is (R(s_p) - R') l_G, R' the measured attitude: it
    hangs on how far the stamps of position and attitude are apart (tau_pa), whatever the ranging
    sensor's.  Together with (R' - R) l_L and the sight that is a third bound, the smaller one where
    long arms see the ranging sensor's stamp twice.
    """
    v, omega = float(stage.platform.v_max_mps), float(stage.platform.omega_max_radps)
    sigma_p = 0.0 if stage.position is None else math.hypot(*stage.position.sigma)
    antenna, difference = arm_lengths(stage, first)
    position_s, attitude_s, between_s = shifts_s
    turn_p = omega * (position_s + added.position_s)
    position = v * (position_s + added.position_s) + sigma_p + added.offset_m
    arms = (chord(omega * position_s) + chord(omega * added.position_s)) * antenna
    if stage.ranging is None or stage.attitude is None:
        arc = position + turn_p * antenna
        return StageBound(position + arms, arc, turn_p * antenna, 0.0, 0.0, 0.0, 0.0, 0.0)
    d = float(stage.platform.distance_m)
    sigma_a = math.hypot(*stage.attitude.sigma) + added.euler_rad
    sigma_u = math.hypot(*stage.ranging.sigma[1:]) + added.sight_rad
    sigma_r = float(stage.ranging.sigma[0])
    turn_a = omega * (attitude_s + added.attitude_s) + added.turn_rad
    pitch = min(tilt_rad + turn_a + sigma_a, 0.5 * math.pi)
    off = turn_a + sigma_a * math.sqrt(1.0 + math.sin(pitch))
    swung = turn_a + sigma_a * _euler_growth(stage.look, pitch, tilt_rad + turn_a + sigma_a)
    lever = turn_p * antenna + (turn_a + sigma_a) * difference
    across = d * (turn_a + sigma_a + sigma_u)
    swing = omega * (attitude_s + added.attitude_s)
    seen = _vector_distance(d, sigma_r, swung + sigma_u)
    alone = chord(omega * between_s + off - omega * attitude_s) * antenna
    alone += chord(omega * added.position_s) * antenna
    return StageBound(
        bound_m=position
        + min(
            arms + chord(off) * difference + seen,
            arms
            + chord(off) * longest_lever_m(stage, first, d)
            + _vector_distance(d, sigma_r, sigma_u),
            alone + chord(off) * ranging_arm_m(stage) + seen,
        ),
        triangle_m=position + lever + across + sigma_r,
        lever_arm_m=lever,
        arc_m=d * swing,
        chord_m=d * chord(swing),
        across_m=across,
        range_m=sigma_r,
        tilt_m=d * sigma_a * (math.sqrt(1.0 + math.sin(min(tilt_rad, 0.5 * math.pi))) - 1.0),
    )


def _euler_growth(look: Look | None, pitch_rad: float, leans_rad: float) -> float:
    """How much farther than its length a path in Euler angles swings a line of sight at most.

    The turn itself grows by sqrt(1 + |sin pitch|).  A yaw angle turns about the vertical and swings
    a sight at an angle g from it by sin g only, roll and pitch by their own length: together by
    |(a, b)| + |c| sin g <= sqrt(1 + sin(g)^2) for a unit vector (a, b, c).  leans_rad: how far the
    body's down axis is from the vertical at most, all along the path but for its own length again.
    """
    turned = math.sqrt(1.0 + math.sin(pitch_rad))
    if look is None or look.elevation is None:
        return turned
    low, high = look.elevation
    steepness = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    off = 0.5 * math.pi - steepness + math.sqrt(2.0) * leans_rad
    return min(turned, math.sqrt(1.0 + math.sin(min(off, 0.5 * math.pi)) ** 2))


def longest_lever_m(stage: Stage, first: bool, distance_m: float) -> float:
    """Largest |l_L - l_G + d n| [m] over the lines of sight n: what an attitude error turns.

    At a given elevation the azimuth nearest to that of l_L - l_G is the worst, whatever the
    elevation; then h cos(el) - z sin(el) is largest at atan2(-z, h) or at an end.
    """
    _, length = arm_lengths(stage, first)
    vectors = arm_difference(stage, first)
    if stage.look is None or vectors is None:
        return distance_m + length
    x, y, z = vectors
    level = math.hypot(x, y) * math.cos(azimuth_apart(stage.look, math.atan2(y, x)))
    low, high = stage.look.elevation or (-0.5 * math.pi, 0.5 * math.pi)
    best = min(max(math.atan2(-z, level), low), high)
    along = max(level * math.cos(e) - z * math.sin(e) for e in (low, high, best))
    return math.sqrt(max(length**2 + distance_m**2 + 2.0 * distance_m * along, 0.0))


def azimuth_apart(look: Look, azimuth_rad: float) -> float:
    """The least angle [rad] between an azimuth and those that are looked at."""
    if look.azimuth is None:
        return 0.0
    low, high = look.azimuth
    ahead = (azimuth_rad - low) % (2.0 * math.pi)
    if ahead <= high - low:
        return 0.0
    return min(ahead - (high - low), 2.0 * math.pi - ahead)


def _vector_distance(length: float, longer_by: float, angle_rad: float) -> float:
    """Distance of two vectors, one `longer_by` longer, that enclose at most an angle."""
    other = length + longer_by
    squared = longer_by**2 + length * other * chord(angle_rad) ** 2
    return math.sqrt(squared)


def chain_bounds(system: System, tau_s: float) -> tuple[StageBound, ...]:
    """Each stage's bound with every pair's relative shift at most tau plus what effects add."""
    return pairwise_bounds(system, tuple((tau_s, tau_s, 2.0 * tau_s) for _ in system.stages))


def pairwise_bounds(system: System, shifts_s: Sequence[StageShifts]) -> tuple[StageBound, ...]:
    """Each stage's bound at its largest shifts plus what effects add."""
    known = acting_effects.known_of(system)
    tilt = system.horizon.tilt_rad
    return tuple(
        stage_bound(stage, index == 0, shifts, tilt, _added(system, index, known))
        for index, (stage, shifts) in enumerate(zip(system.stages, shifts_s, strict=True))
    )


def _added(system: System, index: int, known: Known) -> Added:
    """The effects of one stage, summed; scattered Euler angles apart from fixed turns.

    What moves the measured object at d moves it by a share sigma_r / d more with range noise: of
    several distances the nearest counts for that, the farthest for all else.
    """
    stage = system.stages[index]
    d = distance_m(stage)
    d = d if stage.platform.nearest_m is None else float(stage.platform.nearest_m)
    stretched = stage.ranging.sigma[0] / d if stage.ranging is not None and d > 0.0 else 0.0
    turn = euler = sight = offset = later = 0.0
    for one, what in acting_effects.stage_contributions(system, index):
        if one.effect.kind == "stochastic" and not one.effect.implied:
            euler += what.turn_rad
        else:
            turn += what.turn_rad
        sight += what.sight_rad
        later += what.shift_s
        offset += what.systematic_m * (1.0 + stretched if one.sensor == "ranging" else 1.0)
    position = pair_extra_s(system, index, "position", known)
    attitude = pair_extra_s(system, index, "attitude", known)
    return Added(
        position + _under_way_s(system, index, later), attitude + later, turn, euler, sight, offset
    )


def _under_way_s(system: System, index: int, later_s: float) -> float:
    """By how much a position is too late at most, beside tau [s]: by 2 r / c of the stage's own
    ranging, less 2 r / c of the ranging that fixed it, at any distance of both."""
    relayed_s = _relayed_s(system, index)
    if not relayed_s:
        return later_s
    least = later_s * near_share(system.stages[index]) - relayed_s
    most = later_s - relayed_s * near_share(system.stages[index - 1])
    return max(abs(least), abs(most))


def near_share(stage: Stage) -> float:
    """The near end of a stage's distances over the far end."""
    near, far = stage.platform.nearest_m, float(stage.platform.distance_m)
    return 1.0 if near is None else float(near) / far


def _relayed_s(system: System, index: int) -> float:
    """By how much the fixes of the stage before are later than its stamps say, beside tau [s]."""
    if index == 0:
        return 0.0
    before = acting_effects.stage_contributions(system, index - 1)
    return math.fsum(what.relayed_s for _, what in before)


def pair_extra_s(system: System, index: int, role: RoleName, known: Known) -> float:
    """What known effects add [s] to a stage's position or attitude pair.

    Its own sensor's (from the second stage on, the position is the ranging of the stage before)
    and the reference's, which the ranging sensor is.
    """
    stage = system.stages[index]
    own: tuple[str, RoleName] = (stage.name, role)
    if role == "position" and index > 0:
        own = (system.stages[index - 1].name, "ranging")
    extra = known.extra_tau_s
    reference = 0.0 if stage.ranging is None else extra.get((stage.name, "ranging"), 0.0)
    return extra.get(own, 0.0) + reference


def references(system: System, tau_s: float) -> tuple[float, float, float]:
    """(bound, triangle, Syncline) [m] at relative shifts of at most tau.

    Known effects widen the pairs' shifts and add their systematic terms to all three; the
    Syncline is the paper's [eq:syncline], (sum of v + d w) tau + sensor errors.
    """
    known = acting_effects.known_of(system)
    bounds = chain_bounds(system, tau_s)
    widest = max(
        pair_extra_s(system, index, role, known)
        for index in range(len(system.stages))
        for role in ("position", "attitude")
    )
    figures = budget(system, known)
    syncline = (
        figures.sensor_error_m + figures.systematic_m + figures.sync_rate_mps * (tau_s + widest)
    )
    return (
        math.fsum(part.bound_m for part in bounds),
        math.fsum(part.triangle_m for part in bounds),
        syncline,
    )
