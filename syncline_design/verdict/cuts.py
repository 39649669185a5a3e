"""What a design that failed a figure teaches about all others: sums of noise that rule them out.

Where a design is worst, every other design errs at least by the noise of its sensors there
(`simulation.noise_shares`), which is a sum over roles.  The search takes such sums as further
limits, so that it leaves out whole branches and stays exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from syncline_design.choice.chosen_system import sigma_of
from syncline_design.choice.options import Floats
from syncline_design.choice.table import Cut, Design, Problem
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation.ascent import FreeVector
from syncline_design.simulation.noise_shares import NoiseAt, most_noise, noise_at
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import Wanted, worst_point
from syncline_design.spec.case import Case

MARGIN = 1.01  # by which noise alone exceeds a limit before a design is left out unseen
MOST_LEARNED = 64  # situations of one requirement
SURE = 2.0  # bounds of normal timestamp errors hold k standard deviations, these twice as many
SAME = 1e-9
PROMISING = 0.95  # of the sum that rules a design out: from here on its own worst situation may do
MOST_SEARCHED = 3  # situations of one spec, from where its own is not searched for any more
MOST_REUSED = 8  # situations of other designs that are tried before one is searched


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """A situation in which a design failed a requirement.

    wanted, weight: the figure, and what its limit at the far end of the distances is divided by
    there; variances: of each role the variances of its sensors per axis, by their numbers; errors:
    their sensor errors [m] as the spec has them; rates: the turn rate of each stage [rad/s]; point,
    blocks: the situation, and what of a system it chooses.
    """

    case: Case
    requirement: str
    wanted: Wanted
    weight: float
    noise: NoiseAt
    variances: tuple[Floats, ...]
    errors: tuple[Floats, ...]
    rates: tuple[float, ...]
    point: Array
    blocks: tuple[FreeVector, ...]

    def cut(self, problem: Problem, limit_m: float) -> Cut:
        """The limit on a sum that it means for the options of a problem."""
        widest = {r: float(t.options.tau.max(initial=0.0)) for r, t in enumerate(problem.roles)}
        turns = self._turns_rad(problem, widest)
        weights = []
        for r, table in enumerate(problem.roles):
            added = self.variances[r] @ self.noise.least((table.stage, table.role), turns)
            known = table.options.error >= self.errors[r][table.options.sensor] * (1.0 - SAME)
            weights.append(np.where(known, added[table.options.sensor], 0.0))
        return Cut(self.requirement, tuple(weights), self.most(limit_m))

    def most(self, limit_m: float) -> float:
        """The largest sum with which a design may still keep a limit [m2]."""
        return most_noise(self.wanted, MARGIN * limit_m / self.weight)

    def rules_out(self, problem: Problem, design: Design, limit_m: float) -> bool:
        """Whether a design fails the limit by the noise of its sensors here."""
        return self.share(problem, design, limit_m) > 1.0

    def share(self, problem: Problem, design: Design, limit_m: float) -> float:
        """The noise of a design's sensors here over the largest with which it may keep a limit."""
        taus = {r: float(problem.roles[r].options.tau[p]) for r, p in enumerate(design.options)}
        turns = self._turns_rad(problem, taus)
        total = 0.0
        for r, (table, place) in enumerate(zip(problem.roles, design.options, strict=True)):
            number = int(table.options.sensor[place])
            if table.options.error[place] >= self.errors[r][number] * (1.0 - SAME):
                share = self.noise.least((table.stage, table.role), turns)
                total += float(self.variances[r][number] @ share)
        return total / self.most(limit_m)

    def _turns_rad(self, problem: Problem, tau_s: Mapping[int, float]) -> dict[int, float]:
        """How far a shift of its attitude turns each stage at most, bounds of all roles given."""
        offset = sum(
            max((clock.offset_bound_s for clock in vehicle.clocks), default=0.0)
            for vehicle in problem.vehicles
        )
        found: dict[int, float] = {}
        for r, table in enumerate(problem.roles):
            if table.role != "position":
                turn = SURE * self.rates[table.stage] * (tau_s[r] + offset)
                found[table.stage] = found.get(table.stage, 0.0) + turn
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Failed:
    """A design that failed a requirement of a problem, asked as the spec has it."""

    case: Case
    asked: Problem
    problem: Problem
    design: Design
    system: System
    requirement: str
    wanted: Wanted
    limit_m: float


def learned(failed: Failed, known: Sequence[Learned], seed: int) -> Learned | None:
    """What a failure teaches; nothing where no sum of noise would have ruled the design out.

    Situations in which others failed come first: the worst one is seldom another.  Its own is
    searched for where none is known, or where the known ones nearly rule it out.
    """
    situations = Situations(failed.system)
    own = [one for one in known if one.case is failed.case]
    reused = [
        _learned_at(failed, situations, one.point)
        for one in _apart(known, own)
        if one.blocks == situations.blocks
    ]
    best = max((_share(failed, one) for one in (*own, *reused)), default=1.0)
    for one in reused:
        if _share(failed, one) > 1.0:
            return one
    if best < PROMISING or len(own) > MOST_SEARCHED:
        return None if own else reused[0]
    return _learned_at(failed, situations, worst_point(failed.system, failed.wanted, seed))


def _share(failed: Failed, one: Learned) -> float:
    return one.share(failed.problem, failed.design, failed.limit_m)


def _apart(known: Sequence[Learned], own: Sequence[Learned]) -> list[Learned]:
    """The latest situations, each once, that are not among a spec's own."""
    seen = {id(one.point) for one in own}
    found: list[Learned] = []
    for one in reversed(known):
        if id(one.point) not in seen and len(found) < MOST_REUSED:
            seen.add(id(one.point))
            found.append(one)
    return found


def _learned_at(failed: Failed, situations: Situations, point: Array) -> Learned:
    """What a design teaches in a situation."""
    case, system, wanted = failed.case, failed.system, failed.wanted
    weight = float(np.max(wanted.weight(situations, point[:, None])))
    variances, errors = [], []
    for table in failed.asked.roles:
        role = case.stages[table.stage].role(table.role)
        sensors = () if role is None else role.sensors
        sigmas = [sigma_of(one.entry, table.role) for one in sensors]
        variances.append(np.array(sigmas).reshape(-1, 3) ** 2)
        pool, error = table.anywhere(), np.zeros(len(sensors))
        error[pool.sensor] = pool.error
        errors.append(error)
    rates = tuple(float(stage.platform.omega_max_radps) for stage in system.stages)
    return Learned(
        case, failed.requirement, wanted, weight, noise_at(system, wanted, point),
        tuple(variances), tuple(errors), rates, point, situations.blocks,
    )  # fmt: skip
