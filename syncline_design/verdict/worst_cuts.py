"""What a design whose certified worst case fails teaches: a sum over roles that rules others out.

The certificate of a stage (`simulation.bounds`) is, with a the turn of the measured attitude, u
that of the line of sight and l = |l_L - l_G|,
  v s_p + k sigma_p + chord(a) l + sqrt((k sigma_r)^2 + d (d + k sigma_r) chord(a + u)^2) + ...
where all that is left out is never negative.  chord is concave: on 0 .. A it is at least
x chord(A) / A.  A root of squares is at least its tangent, (x x0 + y y0) / |(x0, y0)|.  A pair's
largest shift is at least the sum of both half widths.  What remains is linear in what each role
adds, so that a search can leave out whole branches by it.  Known effects only ever add.  Where a
look bounds l' = |l_L - l_G + d n| below d + l the certificate is the smaller of two bounds; of both
lower ones the smaller slope of each magnitude is taken.  A third bound has |l_L| in place of l, the
smaller of both counts.
"""

from __future__ import annotations

import math

import numpy as np

from syncline_design.choice.chosen_system import sigma_of, timing_error
from syncline_design.choice.options import Floats
from syncline_design.choice.table import Cut, Design, Problem, RoleTable
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model import timing
from syncline_design.model.lever_arms import arm_lengths, ranging_arm_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Stage, System
from syncline_design.simulation.bounds import chord, longest_lever_m
from syncline_design.spec.case import Case
from syncline_design.verdict.stated import Certified, Stated

SAME = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Taught:
    """A design whose certified worst case failed a requirement.

    weight: what its limit at the far end of the distances is divided by where it failed; added: of
    each role what its sensors add to the sum [m], by their numbers; shifted: what one second of
    half width adds [m/s]; errors: sensor errors [m] as the spec has them.
    """

    case: Case
    requirement: str
    weight: float
    added: tuple[Floats, ...]
    shifted: tuple[float, ...]
    errors: tuple[Floats, ...]

    def cut(self, problem: Problem, limit_m: float) -> Cut:
        """The limit on a sum that it means for the options of a problem."""
        weights = tuple(self._weights(r, table) for r, table in enumerate(problem.roles))
        return Cut(self.requirement, weights, self._most(limit_m))

    def rules_out(self, problem: Problem, design: Design, limit_m: float) -> bool:
        """Whether a design fails the limit by that sum."""
        total = 0.0
        for r, (table, place) in enumerate(zip(problem.roles, design.options, strict=True)):
            total += float(self._weights(r, table, [place])[0])
        return total > self._most(limit_m)

    def _most(self, limit_m: float) -> float:
        return limit_m / self.weight * (1.0 + SAME)

    def _weights(self, r: int, table: RoleTable, rows: list[int] | None = None) -> Floats:
        """What options of a role add; nothing where a what-if has made them better."""
        options = table.options if rows is None else table.options.take(rows)
        found = self.added[r][options.sensor]
        if self.shifted[r]:
            found = found + self.shifted[r] * self._half_widths(table, rows)
        known = options.error >= self.errors[r][options.sensor] * (1.0 - SAME)
        return np.asarray(np.where(known, found, 0.0))

    def _half_widths(self, table: RoleTable, rows: list[int] | None) -> Floats:
        """Half the support of each option's timestamp error [s]."""
        options = table.options if rows is None else table.options.take(rows)
        role, k = self.case.stages[table.stage].role(table.role), self.case.spec.coverage_factor
        widths = np.zeros(int(options.method.max(initial=-1)) + 1)
        bounds = np.full(len(widths), math.inf)
        for one in options.first_of_each(options.method):
            stamping = None if role is None else role.inline or role.method(one.method)
            if stamping is None:
                continue
            number = int(options.method[options.place_of(one.names) or 0])
            error = timing_error(stamping.error)
            low, high = timing.support(error, k)
            widths[number] = 0.5 * (high - low)
            bounds[number] = timing.bound(error, k)
        kept = options.tau >= bounds[options.method] * (1.0 - SAME)
        return np.asarray(np.where(kept, widths[options.method], 0.0))


def taught(
    case: Case, asked: Problem, system: System, requirement: str, found: tuple[Certified, Stated]
) -> Taught:
    """What the failure of a system teaches; found: the figure, and where it is worst."""
    wanted, at = found
    weight = 1.0
    if wanted.rule is not None:
        far = float(system.stages[-1].platform.distance_m)
        a, b = wanted.rule
        weight = math.hypot(a, b * far) / math.hypot(a, b * at.distance_m)
    added, shifted, errors = [], [], []
    for table in asked.roles:
        role = case.stages[table.stage].role(table.role)
        sigmas = [sigma_of(one.entry, table.role) for one in (() if role is None else role.sensors)]
        slopes = _slopes(case, asked, system, table.stage, at)
        added.append(slopes.of(table.role, np.array(sigmas).reshape(-1, 3)))
        shifted.append(0.0 if case.effects else slopes.by_shift(table.role))
        pool, error = table.anywhere(), np.zeros(len(sigmas))
        error[pool.sensor] = pool.error
        errors.append(error)
    return Taught(case, requirement, weight, tuple(added), tuple(shifted), tuple(errors))


@dataclass(frozen=True, slots=True)
class _Slopes:
    """What a stage's magnitudes add at least: sensors at k sigma, along and across the sight."""

    k: float
    speed: float
    turn: float
    next_speed: float
    along: float  # per metre of range noise
    across: float  # per radian of attitude
    sight: float  # per radian of the sight in the body
    arm: float  # per radian of attitude

    def of(self, role: RoleName, sigma: Floats) -> Floats:
        """What sensors of these deviations (n, 3) add [m]."""
        if role == "position":
            return np.asarray(self.k * np.linalg.norm(sigma, axis=1))
        if role == "attitude":
            return np.asarray(self.k * (self.across + self.arm) * np.linalg.norm(sigma, axis=1))
        sight = np.linalg.norm(sigma[:, 1:], axis=1)
        return np.asarray(self.k * (self.along * sigma[:, 0] + self.sight * sight))

    def by_shift(self, role: RoleName) -> float:
        """What a second of half a timestamp error's width adds [m/s]."""
        if role == "position":
            return self.speed
        turning = self.turn * (self.across + self.arm)
        return turning if role == "attitude" else turning + self.speed + self.next_speed


def _slopes(case: Case, asked: Problem, system: System, index: int, at: Stated) -> _Slopes:
    """The tangent at a system's own figures."""
    stage, k = system.stages[index], float(system.coverage_factor)
    last = index + 1 == len(system.stages)
    following = 0.0 if last else float(system.stages[index + 1].platform.v_max_mps)
    v, omega = float(stage.platform.v_max_mps), float(stage.platform.omega_max_radps)
    if stage.ranging is None or stage.attitude is None:
        return _Slopes(k, v, 0.0, following, 0.0, 0.0, 0.0, 0.0)
    d = at.distance_m if last else float(stage.platform.distance_m)
    widest = _widest_rad(case, asked, index, omega, k)
    secant = chord(widest) / widest if widest > 0.0 else 1.0
    x, y = k * stage.ranging.sigma[0], d * secant * _angle(stage, k)
    length = math.hypot(x, y) or 1.0
    arm = min(arm_lengths(stage, index == 0)[1], ranging_arm_m(stage))  # of two of the bounds
    across, turned = y / length * d * secant, arm * secant
    whole = longest_lever_m(stage, index == 0, d) * secant
    if whole >= d * secant + turned:  # the other bound is never the smaller one
        return _Slopes(k, v, omega, following, x / length, across, across, turned)
    seen = d * secant * k * math.hypot(*stage.ranging.sigma[1:])
    other = math.hypot(x, seen) or 1.0
    return _Slopes(
        k, v, omega, following, min(x / length, x / other), min(across + turned, whole) - turned,
        min(across, seen / other * d * secant), turned,
    )  # fmt: skip


def _angle(stage: Stage, k: float) -> float:
    assert stage.ranging is not None
    assert stage.attitude is not None
    return k * (math.hypot(*stage.attitude.sigma) + math.hypot(*stage.ranging.sigma[1:]))


def _widest_rad(case: Case, asked: Problem, index: int, omega: float, k: float) -> float:
    """At least the largest angle that any option's noise and half width make on a stage."""
    total = 0.0
    for table in asked.roles:
        role = case.stages[table.stage].role(table.role)
        if table.stage != index or table.role == "position" or role is None:
            continue
        skip = 1 if table.role == "ranging" else 0
        sigmas = (sigma_of(one.entry, table.role)[skip:] for one in role.sensors)
        total += k * max((math.hypot(*sigma) for sigma in sigmas), default=0.0)
        total += omega * float(table.anywhere().tau.max(initial=0.0))
    return total
