"""How far a study is, and its result as it is handed out."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from syncline_design.machine.notebooks import Shown
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Json
from syncline_design.studies.data import study_data
from syncline_design.studies.finished import Finished
from syncline_design.studies.summary import StudySummary, summarise

FEW, EARLY_S = 20, 20.0  # cases and seconds before which their rate tells nothing


@dataclass(frozen=True)
class StudyResult(Finished, Shown):
    """A finished study; iterate `cases()` for its results, in the order of the study."""

    @cached_property
    def summary(self) -> StudySummary:
        """What it says as a whole, for every output."""
        return summarise(self)

    def to_json(self) -> Json:
        """The study as data, with a row for every case: what `study --output json:-` prints."""
        return study_data(self, self.summary).to_json()


@dataclass(frozen=True, slots=True)
class Progress:
    """Cases done of all, how many of them were there already, and the time it took so far."""

    done: int
    total: int
    reused: int
    elapsed_s: float
    retried: int = 0

    @property
    def remaining_s(self) -> float | None:
        """What is left at the rate so far; None while there is none that tells."""
        computed = self.done - self.reused
        if computed <= 0:
            return None if self.done < self.total else 0.0
        if computed < FEW and self.elapsed_s < EARLY_S:
            return None  # starting the workers is most of it
        return self.elapsed_s / computed * (self.total - self.done)


Report = Callable[[Progress], None]
