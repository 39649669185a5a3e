"""Evidence of stretches of a log, and what it leaves open while other assumptions are free."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from typing import Final

from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.departing import Departing, amount, figure_of, of_stretch
from syncline_design.comparison.in_doubt import InDoubt, OneWay
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.late_together import others_late
from syncline_design.comparison.on_paper import OnPaper
from syncline_design.comparison.whole_delay import Passing
from syncline_design.diagnosis.consequence import SHARE
from syncline_design.diagnosis.result import Smallest
from syncline_design.diagnosis.stretches import OtherFit, ShownSize, Stands, Stretches
from syncline_design.diagnosis.undone import LeftOpen
from syncline_design.diagnosis.unlike_readings import factor_effect
from syncline_design.effects import plain_delay, registry
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, percent, rounded, to_digits
from syncline_design.model.normal import NEARLY_ALL, NORMAL_95

SPOKEN_OF: Final = 0.5  # of a log: what acts in so much of it has to show
_AS_LARGE: Final = "makes a fifth of the spec's noise or more"
TOLD_S: Final = 1.0  # a short stretch whose size is told beside
IsOf = Callable[[str, tuple[str, ...], str, Assumed], bool]


@dataclass(frozen=True, slots=True)
class InStretches:
    """What stands out in stretches of a log or would have, and what it leaves open.

    duration_s, kind: of the log.  is_of: whether an effect of sensors of a stage breaks an
    assumption.
    """

    paper: OnPaper
    is_of: IsOf
    duration_s: float
    found: Stretches = field(default_factory=Stretches)
    open: tuple[LeftOpen, ...] = ()
    kind: str = ""

    def standing(self, one: Assumed) -> Judgement | None:
        """What stands out and turns the verdict: of this assumption, or perhaps of it.

        Of several stretches that break it the figure is of the largest departure, and all are said.
        """
        said = [j for s in self.found.stands if (j := self._of(s, one)) is not None]
        broken = sorted((j for j in said if j.status == "broken"), key=_size, reverse=True)
        if not broken:
            return said[0] if said else None
        return replace(broken[0], words="; ".join(j.words for j in broken))

    def late(self, one: Assumed, began_s: float) -> Iterator[Passing]:
        """Delays of the sensor that are its own beyond doubt, on top of what acts all along."""
        for s in self.found.stands:
            said = self._of(s, one)
            if said is not None and said.status == "broken" and s.label[0] == plain_delay().name:
                (delay,) = of_stretch(s).parameters.values()
                yield Passing(delay, s.from_s - began_s, s.to_s - began_s)

    def in_doubt(self) -> Iterator[InDoubt]:
        """What stands out beyond doubt beside what fits as well; all of it turns the verdict."""
        for s in self.found.stands:
            fits: list[Stands | OtherFit] = [s, *_in_its_place(s)]
            turning = all(self._turns(f) for f in fits) or s.share >= SHARE
            ways = (*(OneWay((of_stretch(fit),)) for fit in fits), *self._together(s), *_noises(s))
            if s.sure and len(ways) > 1 and turning:
                said = f"{of_stretch(s).words} stands out {_placed(s)}"
                sound = bool(s.noise_of)
                yield InDoubt(said, ways, s.from_s, s.to_s, may_be_sound=sound)

    def _together(self, s: Stands) -> list[OneWay]:
        return list(others_late(of_stretch(s), self.paper.case, self.kind))

    def _of(self, s: Stands, one: Assumed) -> Judgement | None:
        name, sensor, _ = s.label
        own = self.is_of(name, (sensor,), s.stage, one)
        others = [part for way in self._together(s) for part in way.parts]
        also = any(self.is_of(f.label[0], (f.label[1],), f.stage, one) for f in s.instead)
        also = also or any(self.is_of(p.effect, p.sensors, p.stage, one) for p in others)
        turns = self._turns(s)
        if not (own or also) or not (turns or (s.sure and s.share >= SHARE)):
            return None
        place = _placed(s)
        rivals = _in_its_place(s)
        alone = all(self.is_of(f.label[0], (f.label[1],), f.stage, one) for f in rivals)
        alone = alone and not others and not s.noise_of
        if own and s.sure and alone:
            part = of_stretch(s)
            matters = "would turn the verdict" if turns else _AS_LARGE
            words = f"{_found(s)} {place}, and {matters}{_built_in(s)}"
            return Judgement("broken", words, figure_of(one, part.parameters), s.from_s, s.to_s)
        if s.sure and s.noise_of:
            whose = " or ".join(s.noise_of)
            words = (f"{of_stretch(s).words} stands out {place}, and slow noise of {whose} for a "
                     "while does as well: this log cannot tell which")  # fmt: skip
        elif s.sure:
            words = f"this log cannot tell it from what stands out {place}: {name} ({sensor})"
        else:
            by_chance = to_digits(math.exp(s.log_p), 1)
            words = (f"{of_stretch(s).words} seems to stand out {place}: a sound log shows as much "
                     f"anywhere with a chance of {by_chance}; a longer log would tell")  # fmt: skip
        return Judgement("not_shown", words, None, s.from_s, s.to_s)

    def _turns(self, one: Stands | OtherFit) -> bool:
        return self.paper.turned(one.label[0], one.label[1], one.stage, _values(one))

    def slight(self, one: Assumed) -> tuple[float, str]:
        """The largest size, and in words, of what stands out of this assumption beyond doubt and
        neither turns the verdict nor is as large as what matters; 0 and nothing of none."""
        own = [s for s in self.found.stands if s.sure and s.share < SHARE and not self._turns(s)]
        own = [s for s in own if self.is_of(s.label[0], (s.label[1],), s.stage, one)]
        figures = [figure_of(one, of_stretch(s).parameters) for s in own]
        ends = [end for f in figures if f is not None for end in (f.low, f.value, f.high)]
        words = [f"; {of_stretch(s).words} stands out {_placed(s)}, and is slight" for s in own]
        return max((abs(end) for end in ends if end is not None), default=0.0), "".join(words)

    def least_s(self, one: Assumed) -> tuple[float, str] | None:
        """The shortest stretch in which what turns the verdict would have shown, and what shows.

        None where nothing was looked for in stretches; inf where no stretch shows it.
        """
        told = [self._shortest(own) for own in self._reaches(one)]
        return max(told, key=lambda pair: pair[0]) if told else None

    def _reaches(self, one: Assumed) -> list[list[ShownSize]]:
        groups: dict[tuple[str, str, int], list[ShownSize]] = {}
        for reach in self.found.reaches:
            name, sensor, _ = reach.label
            if self.is_of(name, (sensor,), reach.stage, one):
                groups.setdefault(reach.label, []).append(reach)
        return list(groups.values())

    def _shortest(self, own: Sequence[ShownSize]) -> tuple[float, str]:
        """Of one effect, by the parameter that shows least at each length; by halving."""
        lengths = own[0].lengths_s
        worst = [max(own, key=lambda r: r.sizes[k]) for k in range(len(lengths))]

        def shown(k: int) -> bool:
            size = worst[k].sizes[k]
            name, sensor, _ = worst[k].label
            values = {worst[k].parameter: min(size, worst[k].most)}
            return math.isfinite(size) and not self.paper.turned(
                name, sensor, worst[k].stage, values
            )

        low, high = 0, len(lengths)
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if shown(middle) else (middle + 1, high)
        least = lengths[low] if low < len(lengths) else math.inf
        return least, "; ".join(_sizes(lengths, worst, low))

    def needs_s(self, one: Assumed) -> float | None:
        """How long a log of such motion and noise would show what turns the verdict; None: unknown.

        A stretch that shows it may be half of the log; where none does, what shows in all of it
        falls with the root of its length.
        """
        told = [self._needs_s(own) for own in self._reaches(one)]
        return None if None in told else max((t for t in told if t is not None), default=None)

    def _needs_s(self, own: Sequence[ShownSize]) -> float | None:
        least, _ = self._shortest(own)
        if math.isfinite(least):
            return least / SPOKEN_OF
        worst = max(own, key=lambda r: r.sizes[-1])
        size = worst.sizes[-1]
        if not math.isfinite(size):
            return None
        name, sensor, _ = worst.label
        shown = Smallest(name, sensor, worst.stage, worst.parameter, size, size)
        at = self.paper.turns_at(shown)
        return None if at is None else worst.lengths_s[-1] * (size / at) ** 2 / SPOKEN_OF

    def undone(self, one: Assumed, least: float | None = None) -> Iterator[str]:
        """Departures that another one undoes on this log, so far that the verdict would turn.

        least: the size from which on they count instead.
        """
        told: set[tuple[str, str, int]] = set()
        for each in self.open:
            name, sensor, _ = each.label
            if each.label in told or not self.is_of(name, (sensor,), each.stage, one):
                continue
            values = {each.parameter: each.size}
            turns = least is None and self.paper.turned(name, sensor, each.stage, values)
            if turns or (least is not None and each.size > least):
                told.add(each.label)
                by, whose, _ = each.by
                yield (f"{name} may be as large as {amount(each.size, each.unit)} where {by} "
                       f"({whose}) undoes it on this log; alone it would be known to "
                       f"{amount(each.alone, each.unit)}")  # fmt: skip

    def largest_undone(self, one: Assumed) -> float:
        """The largest size, in the assumption's unit, that others undo on this log; else 0."""
        sizes = (
            each.size
            for each in self.open
            if each.unit == one.unit
            and self.is_of(each.label[0], (each.label[1],), each.stage, one)
        )
        return max(sizes, default=0.0)

    def room_undone(self, one: Assumed) -> float:
        """Half the 95 % interval of a departure beside those that others undo on this log; else 0.

        Of several components the root sum of squares, which no length of them exceeds.
        """
        sizes: dict[tuple[str, str, int], dict[str, float]] = {}
        for each in self.open:
            own = self.is_of(each.label[0], (each.label[1],), each.stage, one)
            if own and each.unit == one.unit:
                sizes.setdefault(each.label, {})[each.parameter] = each.size
        widest = max((math.hypot(*parts.values()) for parts in sizes.values()), default=0.0)
        return NORMAL_95 / NEARLY_ALL * widest


def _size(said: Judgement) -> float:
    return 0.0 if said.measured is None else abs(said.measured.value or 0.0)


def _sizes(lengths: Sequence[float], worst: Sequence[ShownSize], at: int) -> Iterator[str]:
    """What shows in the least stretch, and in one of about a second."""
    short = next((k for k, length in enumerate(lengths) if length >= TOLD_S), 0)
    for k in sorted({short, min(at, len(lengths) - 1)}):
        size, lasts = worst[k].sizes[k], format_duration(rounded(lengths[k], 2))
        if math.isfinite(size):
            yield f"in {lasts} from {amount(size, worst[k].unit)} on"


def _found(s: Stands) -> str:
    """What is there, in words that its place follows."""
    if s.frozen:
        oldest = format_duration(rounded(s.values[0], 3))
        what = f"{s.label[1]} repeats one reading"
        if s.reading:
            what += f" of its {s.reading}, while its others go on"
        return f"{what}, in the end {oldest} old,"
    part = of_stretch(s)
    if s.ends is not None:
        unit = next(iter(part.parameters.values())).unit
        before, after = (amount(end, unit) for end in s.ends)
        how = "grows" if abs(s.ends[1]) > abs(s.ends[0]) else "falls"
        return f"{part.name} that {how} from {before} to {after} stands out"
    return f"{part.words} stands out"


def _in_its_place(s: Stands) -> list[OtherFit]:
    """What fits as well and can be so for a while, where what was named can."""
    goes = s.inside and registry()[s.label[0]].passing
    return [fit for fit in s.instead if registry()[fit.label[0]].passing or not goes]


def _noises(s: Stands) -> Iterator[OneWay]:
    """Slow noise that does there as well, of which nothing says that it is beyond the figure."""
    for role in s.noise_of:
        yield OneWay((Departing(factor_effect().name, (role,), s.stage, {}),))


def _built_in(s: Stands) -> str:
    """What fits there as well, and cannot be so for a while but by coming and going."""
    rivals = _in_its_place(s)
    names = [of_stretch(fit).name for fit in s.instead if fit not in rivals]
    return f" (or {' or '.join(names)}, if that came and went)" if names else ""


def _values(s: Stands | OtherFit) -> dict[str, float]:
    return dict(zip(s.parameters, s.values, strict=True))


def _placed(s: Stands) -> str:
    """Between which stamps."""
    single = f"in {len(s.stamps_s)} single rows " if s.stamps_s else ""
    if s.of_log is not None:
        single = f"in {percent(s.of_log, 2)} of the rows, here and there, "
    return f"{single}from {to_digits(s.from_s, 6)} s to {to_digits(s.to_s, 6)} s"
