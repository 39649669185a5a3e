"""A plan from its request to its result."""

from __future__ import annotations

import math
from typing import Final

from syncline_design.machine.deadline import NoVerdict, in_force
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.planning.drives import WholeDrive, outcome, steered_s
from syncline_design.planning.effort import ROWS_OF_A_DRIVE, Effort
from syncline_design.planning.enough import Shortest, shortest
from syncline_design.planning.placing import AREA_SHARE, LegTold, lasting_s, way_of
from syncline_design.planning.search import LegSearch, best_within, together
from syncline_design.planning.setup import SECONDS, PlanRequest, Setup
from syncline_design.planning.standard import times_needed
from syncline_design.planning.telling import PlanRun, Telling, duration_s
from syncline_design.planning.wanted import (
    PlanError,
)
from syncline_design.spec.case import Case

LONGEST_S: Final = 4 * 3600.0  # of a drive that is looked for to say the least minutes
LONGEST_TOLD_S: Final = 168 * 3600.0  # more of the same that takes longer is no answer
SEARCH_SHARE: Final = 0.5  # of the command's time


def plan(case: Case, request: PlanRequest | None = None) -> PlanRun:
    """The drive that tells what is asked.

    Raises BadInput for a spec that cannot be used, PlanError for a request that cannot be met at
    all, NoVerdict for a search that ended before it came to a drive; what cannot be reached in the
    minutes is a result.
    """
    with one_thread():
        setup = Setup.begun(case, request or PlanRequest())
        return _enough_in_calm_water(setup) or _Planning(setup).run()


def _enough_in_calm_water(setup: Setup) -> PlanRun | None:
    """The drive of a ship that is enough with waves and without, in the minutes; None where none
    was found, or where nothing is looked at twice, since the effort is counted."""
    if not setup.world.in_waves or setup.request.effort is not None:
        return None
    calm = setup.in_calm_water
    try:
        legs = _Planning(calm).enough_within()
    except NoVerdict:
        return None
    if legs is None:
        return None
    found = outcome(setup.world, setup.world.looked_at([told.leg for told in legs]))
    if not setup.reached(found):
        return None
    return Telling(setup).whole(found, duration_s(found), SECONDS * setup.request.minutes)


@dataclass(frozen=True, eq=False)
class _Planning:
    """One plan in the making."""

    setup: Setup

    def enough_within(self) -> list[LegTold] | None:
        """The shortest drive that is enough; None where it takes more than the minutes."""
        search = self._search()
        most_s = SECONDS * self.setup.request.minutes
        found = shortest(self.setup, search, most_s)
        within = found.judged and steered_s(self.setup.world, found.legs) <= most_s
        return found.legs if within else None

    def _search(self) -> LegSearch:
        """A search within a part of the command's time."""
        in_force().doing("searching for legs")
        limit = in_force().left_s()
        deadline = in_force().inner(None if limit is None else SEARCH_SHARE * limit)
        effort = Effort() if self.setup.request.effort is None else self.setup.request.effort
        effort.begun += self.setup.rows / ROWS_OF_A_DRIVE
        return LegSearch(self.setup.told, self.setup.judge, deadline, self._area(), effort)

    def run(self) -> PlanRun:
        most_s = SECONDS * self.setup.request.minutes
        search = self._search()
        whole = shortest(self.setup, search, max(LONGEST_S, most_s))
        search = search.at(whole.margin)
        reaches = whole.judged or search.reaches(whole.legs)
        if search.is_over and not reaches:
            raise NoVerdict("the search ended before it came to a drive that tells what is asked")
        chosen = self._chosen(search, whole, most_s, reaches=reaches)
        in_force().doing("looking at the whole drive")
        chosen, found = self._judged(search, chosen, most_s)
        least_s = self._least_s(whole, found, most_s)
        return Telling(self.setup).whole(found, least_s, most_s)

    def _chosen(
        self, search: LegSearch, whole: Shortest, most_s: float, *, reaches: bool
    ) -> list[LegTold]:
        """The drive to tell: the one that is enough, else the best within the time.  Where nothing
        is as short as that, the shorter of the two."""
        whole_s = steered_s(self.setup.world, whole.legs)
        if reaches and whole_s <= most_s:
            return whole.legs
        best = best_within(search, most_s)
        best_s = steered_s(self.setup.world, best)
        return whole.legs if whole.judged and best_s > most_s and whole_s <= best_s else best

    def _area(self) -> tuple[float, float] | None:
        """The tightest area of the vehicles that drive; PlanError where not one leg fits."""
        stages = {t.leg.stage for t in self.setup.told}
        driving = enumerate(self.setup.world.vehicles)
        areas = [v.area_m for k, v in driving if k in stages and v.area_m]
        if not areas:
            return None
        area = (min(a[0] for a in areas), min(a[1] for a in areas))
        known = LegSearch(self.setup.told, self.setup.judge, in_force(), area)
        if not any(known.fits([told]) for told in self.setup.told):
            least = min((way_of([told]).extent_m for told in self.setup.told), key=max)
            raise PlanError(
                f"area [{to_digits(area[0])} m, {to_digits(area[1])} m]: not one leg of this "
                f"vehicle stays within "
                f"it; the smallest takes {to_places(least[0] / AREA_SHARE, 0)} m by "
                f"{to_places(least[1] / AREA_SHARE, 0)} m: widen it, or lower v_max"
            )
        return area

    def _judged(
        self, search: LegSearch, chosen: list[LegTold], most_s: float
    ) -> tuple[list[LegTold], WholeDrive]:
        """The whole drive; with more legs where the joints took what the search had counted on."""
        found = outcome(self.setup.world, chosen)
        for _ in range(3):
            if self.setup.reached(found) or not search.reaches(chosen):
                break
            added = self._one_more(search, chosen, most_s)
            if added is None:
                break
            chosen = [*chosen, added]
            found = outcome(self.setup.world, chosen)
        return chosen, found

    def _one_more(self, search: LegSearch, chosen: list[LegTold], most_s: float) -> LegTold | None:
        """The leg that tells most about what is worst."""
        trials = [[*chosen, told] for told in self.setup.told]
        trials = [trial for trial in trials if lasting_s(trial) <= most_s and search.fits(trial)]
        if not trials:
            return None
        return min(trials, key=lambda trial: search.value(trial)[1])[-1]

    def _least_s(self, whole: Shortest, found: WholeDrive, most_s: float) -> float | None:
        """The least time that reaches all: this drive's, another one's, or so much of its kind.

        A drive that is told for want of one within the time may be the shorter of both.  None
        where no drive is enough as a whole, and more of the same would not help: two effects that
        it does not tell apart do not part by its length.
        """
        known = [duration_s(found)] if self.setup.reached(found) else []
        if known and known[0] <= most_s:
            return known[0]
        if whole.judged:
            known.append(steered_s(self.setup.world, whole.legs))
        if known:
            return max(min(known), 1.001 * most_s)
        needed = times_needed(self.setup.judge, together(whole.legs))
        longer_s = math.inf if needed is None else needed * lasting_s(whole.legs)
        return longer_s if most_s < longer_s <= max(LONGEST_TOLD_S, most_s) else None
