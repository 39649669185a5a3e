"""What a departure would do to the verdict: the spec checked again with the departure listed.

The requirements that `check` judges are all asked, whatever their kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Final

from syncline_design.diagnosis.result import Diagnosis, Finding, Smallest
from syncline_design.effects import registry
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.edit import with_effects
from syncline_design.spec.effects_listed import EffectChoice
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.verify import check_loaded

HALVINGS: Final = 8  # of the octaves below a size, in the search for where it begins to matter
OCTAVES: Final = 12.0
SLOW: Final = ("monte_carlo", "thu", "tvu", "rmse", "quantile")  # tenths of a second a design


@dataclass(frozen=True, eq=False)
class OnPaper:
    """A pinned spec, the findings of its log that do not matter by themselves, and a seed."""

    case: Case
    slight: tuple[Finding, ...]
    seed: int = 0

    @classmethod
    def beside(cls, case: Case, found: Diagnosis, seed: int) -> OnPaper:
        """The pinned spec beside what its log's diagnosis found."""
        slight = tuple(f for f in found.findings if not f.material and f.fits_a_spec)
        return cls(case, slight, seed)

    def meets(self, entries: Sequence[EffectChoice] = ()) -> bool:
        """Whether the spec with these effects still meets its requirements."""
        in_force().check()
        settings = CheckSettings(seed=self.seed, monte_carlo=self._simulates, brief=True)
        return check_loaded(with_effects(self.case, entries), settings).verdict == "meets"

    @cached_property
    def sound(self) -> bool:
        """Whether it does by itself: what fails anyway is not turned by anything."""
        return self.meets()

    @cached_property
    def _simulates(self) -> bool:
        return any(one.kind == "monte_carlo" for one in self.case.spec.requirements)

    @cached_property
    def keeps_slight(self) -> bool:
        """Whether all that was found and does not matter by itself does not together either."""
        return not self.slight or self.meets(self._slight)

    @property
    def _slight(self) -> tuple[EffectChoice, ...]:
        return tuple(entry for finding in self.slight for entry in finding.as_entries())

    def turned_by(self, own: Sequence[Finding]) -> bool:
        """Whether findings that do not matter by themselves turn the verdict."""
        entries = [e for f in own if f.fits_a_spec for e in f.as_entries()]
        return self.sound and bool(entries) and not self.meets(entries)

    def turned(self, effect: str, sensor: str, stage: str, values: Mapping[str, float]) -> bool:
        """Whether a departure turns the verdict, its other parameters at zero."""
        zero = {p.name: 0.0 for p in registry()[effect].parameters}
        return self.sound and not self.meets([_entry(effect, sensor, stage, {**zero, **values})])

    def noisier(self, sensor: str, stage: str, factor: float) -> bool:
        """Whether a sensor so many times noisier than its figure turns the verdict."""
        wider = next(one for one in registry().values() if one.opens == "factor")
        one = _entry(wider.name, sensor, stage, {wider.parameters[0].name: factor})
        return self.sound and factor > 1.0 and not self.meets([one])

    def hides(self, shown: Smallest) -> bool:
        """Whether what may be there, one log in 20 apart, is still too large for the verdict."""
        return self.sound and not self.meets([self._added(shown, size_of(shown))])

    def turns_at(self, shown: Smallest) -> float | None:
        """The least size of a departure that turns the verdict, of one that does when large.

        None where a requirement takes too long to judge for a search.
        """
        if any(one.kind in SLOW for one in self.case.spec.requirements):
            return None
        most, low, high = size_of(shown), -OCTAVES, 0.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            kept = self.meets([self._added(shown, most * 2.0**middle)])
            low, high = (middle, high) if kept else (low, middle)
        return most * float(2.0**high)

    def _added(self, shown: Smallest, size: float) -> EffectChoice:
        zero = {p.name: 0.0 for p in registry()[shown.effect].parameters}
        return _entry(shown.effect, shown.sensor, shown.stage, {**zero, shown.parameter: size})


def size_of(shown: Smallest) -> float:
    """What nearly all such logs would have shown, or what this log does not exclude at 19 of 20,
    where that is less; else the largest that the effect can have."""
    known = [size for size in (shown.sure, shown.within) if size is not None]
    if known:
        return min(known)
    return next(p.high for p in registry()[shown.effect].parameters if p.name == shown.parameter)


def _entry(effect: str, sensor: str, stage: str, values: dict[str, float]) -> EffectChoice:
    return EffectChoice(effect=effect, sensor=sensor, stage=stage, parameters=dict(values))  # type: ignore[arg-type]
