"""A measured log as evidence: its diagnosis, and what departures do to the spec's verdict."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field
from functools import cached_property
from typing import Final

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_shift import delay_made, delay_turns
from syncline_design.comparison.by_stretch import InStretches
from syncline_design.comparison.departing import (
    Departing,
    figure_of,
    of_finding,
    of_joint,
    of_others,
    of_rival,
)
from syncline_design.comparison.in_doubt import InDoubt, OneWay
from syncline_design.comparison.late_together import others_late
from syncline_design.comparison.noise_as_turn import either
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.noise_split import NoiseFactors
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.diagnosis.stretches import is_inside
from syncline_design.effects import registry
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit
from syncline_design.model.normal import NORMAL_95

_BIAS: Final = "bias_m"  # the parameter of a range that is off by a constant
_RATE: Final = "rate_radps"  # that of a heading that drifts


@dataclass(frozen=True, eq=False)
class LogEvidence:
    """What a log says: its diagnosis, and what departures do to the spec's verdict.

    last_stage: whose motion it holds.  clocks: of stages whose host clock is an assumption of its
    own, the stage that it stands at; else what drifts breaks the timing of the sensor.
    """

    found: Diagnosis
    paper: OnPaper
    last_stage: str
    clocks: Mapping[str, str] = field(default_factory=dict)
    sight: Sighted | None = None

    @classmethod
    def of(
        cls, sight: Sighted, paper: OnPaper, last_stage: str, clocks: Mapping[str, str]
    ) -> LogEvidence:
        """All that a log says."""
        return cls(sight.found, paper, last_stage, clocks, sight)

    @property
    def parts(self) -> InStretches:
        """What it says of stretches, and of departures that undo one another."""
        read = self.found.log
        if self.sight is None:
            return InStretches(self.paper, self.is_of, read.duration_s)
        seen = self.sight
        return InStretches(self.paper, self.is_of, read.duration_s, seen.stretches, seen.open,
                           read.kind)  # fmt: skip

    @property
    def began_s(self) -> float:
        """Stamp of its first row."""
        return 0.0 if self.sight is None or self.sight.ends_s is None else self.sight.ends_s[0]

    def others_of(self, finding: Finding) -> tuple[tuple[str, str, str], ...]:
        """What together would do in a finding's place: effect, sensor and stage of each."""
        own = (finding.effect, finding.sensor, finding.stage)
        known = self.sight.instead if self.sight is not None else ()
        return next((each.others for each in known if each.found == own), ())

    @cached_property
    def in_doubt(self) -> tuple[InDoubt, ...]:
        """What it shows beyond doubt, and explains in several ways."""
        causes = (f for f in self.found.findings if f.material and f.kind == "cause")
        told = [each for f in causes if (each := self._several(f)) is not None]
        return (*told, *self.parts.in_doubt(), *self._noise_in_doubt())

    def _noise_in_doubt(self) -> Iterator[InDoubt]:
        """Noise of an attitude that bearings would make as well."""
        known = {} if self.sight is None else self.sight.factors
        for f in self.found.findings:
            both = either(f, known) if f.material and f.kind == "noise" else None
            if both is not None:
                yield InDoubt(f.sentence, tuple(OneWay((one,)) for one in both), finding=f)

    def _several(self, finding: Finding) -> InDoubt | None:
        """A finding with all that would do in its place; None where nothing does."""
        ways = [OneWay((of_finding(finding),), finding.probability)]
        kept = of_others(finding)  # rivals are those of the sensor that it is named by
        ways += [OneWay((of_rival(a), *kept), a.probability) for a in finding.aliases]
        named = (finding.effect, finding.sensor, finding.stage)
        known = self.sight.instead if self.sight is not None else ()
        for each in known:
            if each.found == named:
                ways.append(OneWay(tuple(of_joint(one, each.figures) for one in each.others)))
        if any(e not in registry() for way in ways for e in way.effects):
            return None
        ways += others_late(of_finding(finding), self.paper.case, self.found.log.kind)
        if self._comes_and_goes(finding):
            ways = [way for way in ways if all(registry()[e].passing for e in way.effects)]
        if len(ways) < 2:
            return None
        slow = any(self._is_slow(part) for way in ways for part in way.parts)
        return InDoubt(finding.sentence, tuple(ways), finding.from_s, finding.to_s, finding, slow)

    def _comes_and_goes(self, finding: Finding) -> bool:
        """Whether it begins and ends within the log, as nothing does that is built in."""
        ends_s = None if self.sight is None else self.sight.ends_s
        if ends_s is None or finding.from_s is None or finding.to_s is None:
            return False
        inside = is_inside(finding.from_s, finding.to_s, ends_s)
        return inside and registry()[finding.effect].passing

    def breaks(self, one: Assumed, part: Departing) -> bool:
        """Whether a departure would break this assumption, or make a delay that does."""
        if self.is_of(part.effect, part.sensors, part.stage, one):
            return True
        delay = delay_made(one, part, self.found.log.duration_s)
        return delay is not None and delay_turns(one, delay, self.paper)

    def figure(self, one: Assumed, part: Departing) -> MeasuredFigure | None:
        """What a departure that breaks it would make of an assumption's figure."""
        if self.is_of(part.effect, part.sensors, part.stage, one):
            return figure_of(one, part.parameters)
        return delay_made(one, part, self.found.log.duration_s)

    def ways_of(self, one: Assumed, each: InDoubt) -> list[OneWay]:
        """The ways that would break an assumption."""
        return [way for way in each.ways if any(self.breaks(one, part) for part in way.parts)]

    def may_be(self, one: Assumed, each: InDoubt) -> bool:
        """Whether some of the ways break an assumption, and others do not."""
        return 0 < len(self.ways_of(one, each)) < len(each.ways)

    def is_sure(self, one: Assumed, finding: Finding) -> bool:
        """Whether a finding breaks an assumption, in whatever way it is explained."""
        mine = next((each for each in self.in_doubt if each.finding is finding), None)
        return mine is None or len(self.ways_of(one, mine)) == len(mine.ways)

    def within_figure(self, one: Assumed, finding: Finding) -> bool:
        """Whether a finding is a constant that a sensor's figure leaves to slower noise."""
        part = of_finding(finding)
        if one.name == "mounting":
            return self._is_slow_turn(part)
        return one.name == "noise" and (self._is_slow_bias(part) or self._is_slow_drift(part))

    def _is_slow(self, part: Departing) -> bool:
        """Whether a sound sensor's noise that is slower than the log leaves as much."""
        return self._is_slow_bias(part) or self._is_slow_drift(part) or self._is_slow_turn(part)

    def _is_slow_turn(self, part: Departing) -> bool:
        """Whether a constant turn is no more than an attitude's figure leaves to such noise.

        sum (a_k / sigma_k)^2 <= (1 - f^2) q, over roll, pitch and yaw or the heading alone, q the
        95 % quantile of chi-square of as many; f as of a bias.
        """
        turns = [p for p in part.parameters.values() if p.unit == "rad"]
        known = {} if self.sight is None else self.sight.factors
        own = known.get(f"{part.stage}/{part.sensors[0]}")
        whole = len(turns) == len(part.parameters) and len(turns) in (1, 3)
        if own is None or not whole or part.sensors != ("attitude",):
            return False
        if registry()[part.effect].breaks != "mounting" or len(own.sigma) != 3:
            return False
        sigmas = own.sigma[-len(turns) :]  # one turn is that of the heading
        size = sum((float(p.value) / s) ** 2 for p, s in zip(turns, sigmas, strict=True))
        slower = max(1.0 - own.loudest.low**2, 0.0)
        return bool(size <= slower * chi_square_limit(0.05, len(turns)))

    def _is_slow_bias(self, part: Departing) -> bool:
        """Whether a constant of a reading is no more than its figure leaves to noise that is slower
        than the log: |b| <= 1.96 sigma sqrt(1 - f^2), f the least factor that the log itself shows.
        """
        bias = part.parameters.get(_BIAS)
        if bias is None or registry()[part.effect].breaks != "noise":
            return False
        return abs(float(bias.value)) <= NORMAL_95 * self._slower(part, "range", 0)

    def _is_slow_drift(self, part: Departing) -> bool:
        """The same of a heading that drifts, by how far it is off at the ends of the log when it is
        right in the middle: |r| T / 2."""
        rate = part.parameters.get(_RATE)
        ends = None if self.sight is None else self.sight.ends_s
        if rate is None or ends is None or part.sensors != ("attitude",):
            return False
        off = 0.5 * abs(float(rate.value)) * (ends[1] - ends[0])
        return off <= NORMAL_95 * self._slower(part, "yaw", -1)

    def _slower(self, part: Departing, reading: str, place: int) -> float:
        """Standard deviation that the figure of a reading leaves to noise slower than the log."""
        known = {} if self.sight is None else self.sight.factors
        own = known.get(f"{part.stage}/{part.sensors[0]}")
        found = [f for f in own.parts if not f.readings or reading in f.readings] if own else []
        if own is None or not found:
            return 0.0
        return math.sqrt(max(1.0 - found[0].low ** 2, 0.0)) * float(own.sigma[place])

    def split(self, one: Assumed) -> NoiseFactors | None:
        """The noise of an assumption's sensor, by readings that have a figure of their own."""
        return None if self.sight is None else self.sight.factors.get(f"{one.stage}/{one.role}")

    def is_of(self, effect: str, sensors: Collection[str], stage: str, one: Assumed) -> bool:
        """Whether an effect of a stage's sensors would break this assumption."""
        if effect not in registry():  # a stand-in that is no effect, such as a wave
            return False
        breaks: str = registry()[effect].breaks
        if breaks == "clock" and stage in self.clocks:
            return (one.name, one.stage) == ("clock", self.clocks[stage])
        broken = "timing" if breaks == "clock" else breaks
        return (one.name, one.stage) == (broken, stage) and one.role in sensors
