"""What `plan` says in sentences: whether it is reached, and what of it has to be known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from syncline_design.machine.sentences import sentence_list
from syncline_design.model.figure_text import format_duration, format_like, format_quantity
from syncline_design.model.quantity import si_name, split_suffix, suffix_unit
from syncline_design.model.unit_table import Dimension
from syncline_design.planning.result import (
    After,
    Flown,
    HeldEffect,
    Lacking,
    Plan,
    Separated,
    StandardPlan,
)
from syncline_design.planning.run import LONGEST_S
from syncline_design.report import numbers
from syncline_design.report.document import Inline, Outcome
from syncline_design.report.words import effect_words

UNITS: Final = {
    Dimension.TIME: "s", Dimension.LENGTH: "m", Dimension.ANGLE: "rad",
    Dimension.ANGULAR_RATE: "rad/s", Dimension.SPEED: "m/s",
}  # fmt: skip
FIRST_ORDER: Final = "as far as their effects of first order go"  # a large lag is no latency
ONE: Final = "on every leg that it can drive they make the same error"
AT_SIZE: Final = "at the size that is known, in these minutes"


def outcome(found: Plan) -> Outcome:
    legs = f"{len(found.legs)} leg{'s' if len(found.legs) != 1 else ''}"
    length = numbers.drive_time(found.duration_s / 60.0)
    if found.reached:
        rest = ", but for what no drive tells" if found.inseparable or found.held else ""
        if found.calm is not None and not found.calm.reached:
            rest = f"{rest}, in waves only"
        return Outcome("good", "\u2713", f"Reached by {legs} in {length}{rest}")
    if found.least_minutes is None and _larger(found) is not None:
        return Outcome("bad", "\u2717", _told_in_part(found))
    if found.least_minutes is None:
        why = "no drive of this platform tells it" if found.inseparable else _none_found(found)
        return Outcome("bad", "\u2717", f"Not reachable: {why}")
    return Outcome("bad", "\u2717", f"Not reached in {numbers.number(found.minutes, 6)} min")


def _told_in_part(found: Plan) -> str:
    """Which of an effect's parameters the drive tells apart, and of which only a large one."""
    one = _larger(found)
    assert one is not None
    told, later, never = _by_size(one)
    if not told:
        return "Told apart only where it is larger"
    names = [sentence_list([split_suffix(n)[0] for n in part]) for part in (told, later, never)]
    rest = f"in {names[1]} only where it is larger" if later else f"in {names[2]} not"
    return f"Told apart in {names[0]}, {rest}"


def _none_found(found: Plan) -> str:
    """What is asked is only a matter of time, and of more than any drive is looked at for."""
    most_s = max(LONGEST_S, 60.0 * found.minutes)
    return f"no drive of up to {format_duration(most_s)} was found that tells so much"


def sentences(found: Plan) -> Iterator[Inline]:
    if not found.reached and found.least_minutes is not None:
        least = _least(found.least_minutes)
        given = f"{numbers.number(found.minutes, 6)} min"
        below = f"Below is the best for {given}."
        if found.duration_s > 60.0 * found.minutes:
            length = numbers.drive_time(found.duration_s / 60.0)
            below = f"No drive as short as {given} was found: below is one of {length}."
        yield f"The least that is enough, of the drives looked at: {least}. {below}"
    if not found.reached and found.flown is not None and found.flown.reached:
        files, length = ", ".join(found.flown.files), numbers.time(found.flown.duration_s)
        yield f"What was flown ({files}) is enough: it reaches what is asked in {length}."
    for words in found.inseparable:
        larger = _larger(found)
        if larger is not None and words == f"{larger.first} and {larger.second}":
            yield from _told_where_larger(larger)
        elif words in (found.alike or ()):
            yield f"No drive of this platform can tell {words} apart: {ONE}."
        else:
            yield f"No drive of this platform tells {words} apart, {how_far(found)}."
    yield from map(_held, found.held or ())
    if found.reached:
        asked = "else that" if found.inseparable or found.held else "that"
        stays = "within twice what is asked" if found.tolerance else "told"
        yield (
            f"All {asked} is asked is reached, and stays {stays} when any one of the other effects "
            f"that a drive can tell apart is free as well{_steps(found)}."
        )
    if found.confused:
        yield would_take(found.confused)
    if found.untold:
        yield _known_otherwise(found)
    if found.calm is not None:
        yield from _in_calm_water(found)
    for one in found.dear or ():
        lasts, whole = (numbers.drive_time(s / 60.0) for s in (one.lasts_s, found.duration_s))
        yield f"Leg {one.leg} takes {lasts} of the {whole}. Without it {_lacking(one.without)}."
    yield from found.cautions or ()


def _in_calm_water(found: Plan) -> Iterator[Inline]:
    """Whether a ship's drive rests on the waves."""
    assert found.calm is not None
    if found.calm.lacking is None:
        yield "It is enough in calm water as well as in the waves that are taken."
    else:
        yield (
            "Only the waves make it enough, and no drive was found that is in calm water, too: "
            f"there {_lacking(found.calm.lacking)}."
        )


def _lacking(one: Lacking) -> str:
    """What fails, with its figure."""
    if " and " in one.what:
        own, rival = one.what.split(" and ")
        value, asked = numbers.number(one.value, 3), numbers.number(one.asked, 3)
        return f"{own} is not told from {rival}: noncentrality {value} of {asked} asked"
    value, asked = figure(one.what, one.value), figure(one.what, one.asked)
    if one.beside is None:
        return f"{parameter(one.what)} stays at {value}, where {asked} is asked"
    return (
        f"{effect_words(one.beside)}, left free, would take {parameter(one.what)}: {value}, where "
        f"{asked} is the most that it may make of it"
    )


def _steps(found: Plan) -> str:
    """Where a step of stamps is looked for, where a delay is asked for."""
    if not any(key.startswith("latency(") for key in found.after[-1].sigma):
        return ""
    return " (a step of the stamps in the middle of the drive: one before what tells is a delay)"


def would_take(confused: Sequence[str]) -> str:
    names = ", ".join(map(effect_words, confused))
    return f"Left free one at a time, these would take what is asked: {names}."


def _known_otherwise(found: Plan) -> str:
    """What no drive tells from what is asked, with what it leaves of that where it is free."""
    each = [
        f"{effect_words(one.effect)} (would leave {_left(one.sigma)})" for one in found.untold or ()
    ]
    return (
        "Taken as known, since nothing that can be driven tells them from what is asked, or only "
        f"what takes many times as long, the most harmful first: {'; '.join(each)}. Asked for as "
        "well, one is told, or said not to be."
    )


def _left(sigma: Mapping[str, float]) -> str:
    """`lever arm x and y (position) at 141 mm, lever arm z (position) at 143 mm`."""
    alike: dict[tuple[str, str], list[str]] = {}
    for key, value in sigma.items():
        place = key.rpartition(".")[0], figure(key, value)
        alike.setdefault(place, []).append(key)
    parts = []
    for (_, size), keys in alike.items():
        own = [split_suffix(key.rpartition(".")[2])[0] for key in keys]
        names = parameter(keys[0]).replace(f" {own[0]} (", f" {sentence_list(own)} (")
        parts.append(f"{names if len(own) > 1 else parameter(keys[0])} at {size}")
    return ", ".join(parts)


def _held(one: HeldEffect) -> str:
    """What is taken as known of what is asked, and why."""
    names = [effect_words(text) for text in (*one.beside, one.effect)]
    if not one.beside:
        own = sentence_list(list(map(parameter, one.parameters)))
        return f"No drive of this platform shows {own}: left out here."
    rest = "the other is" if len(one.beside) == 1 else "the others are"
    return (
        f"No drive of this platform tells {sentence_list(names)} from one another, {FIRST_ORDER}: "
        f"changed together they make no error. {names[-1][0].upper()}{names[-1][1:]} is taken as "
        f"known, as the reference beside which {rest} told."
    )


def _larger(found: Plan) -> Separated | None:
    """The pair that this drive tells apart where the first effect is larger."""
    return next((one for one in found.pairs if one.told_from), None)


def _told_where_larger(one: Separated) -> Iterator[Inline]:
    """A pair of which only the size decides whether it can be told, parameter by parameter."""
    told, later, never = _by_size(one)
    sizes, several = one.told_from or {}, len(one.sizes) > 1
    least = " or ".join(_sized(n, sizes) if several else figure(n, sizes[n]) for n in later)
    rest = "".join(f", and {split_suffix(n)[0]} from {figure(n, sizes[n])} on" for n in later)
    lost = sentence_list([split_suffix(name)[0] for name in never])
    alike = f"look nearly alike on every drive (correlation {correlation_words(one.correlation)})"
    if told:
        small = sentence_list([split_suffix(name)[0] for name in (*later, *never)])
        at = sentence_list([_sized(name, one.sizes) for name in told])
        begins = f"{alike} in {small} alone: the drive below tells {at} of the first apart{rest}"
    else:
        begins = f"{alike}, so that a small effect is not told"
        begins += f". From {least} of the first on, the drive below tells them apart"
    begins += f"; {lost} at no plausible size" if never else ""
    yield (
        f"{one.first} and {one.second} {begins}. Where its size is known, --separate with "
        f"{one.first}=SIZE plans for it."
    )


def _by_size(one: Separated) -> tuple[list[str], list[str], list[str]]:
    """The parameters of the first effect that are told at the size that matters, those from a
    larger one on, and those at none that is plausible."""
    from_size = one.told_from or {}
    told = [name for name, size in one.sizes.items() if from_size.get(name, math.inf) <= size]
    later = [name for name in one.sizes if name in from_size and name not in told]
    return told, later, [name for name in one.sizes if name not in from_size]


def _sized(name: str, sizes: Mapping[str, float]) -> str:
    return f"{split_suffix(name)[0]} {figure(name, sizes[name])}"


def pair_head(found: Plan) -> str:
    """What of the first pair decides whether it is told: its noncentrality where its size is known,
    so that what its slopes have in common decides nothing."""
    return "Correlation" if found.after[-1].noncentrality is None else "Noncentrality"


def pair_figure(one: After | StandardPlan | Flown) -> str:
    """The figure under that head; empty without a pair."""
    if one.noncentrality is not None:
        return numbers.number(one.noncentrality, 3)
    return "" if one.correlation is None else correlation_words(one.correlation)


def correlation_words(value: float) -> str:
    """To two figures, and to more where two would make one of it."""
    return numbers.number(value, 2 if value < 0.995 else 4)


def how_far(found: Plan) -> str:
    """In which sense effects are not told apart."""
    return AT_SIZE if found.sized else FIRST_ORDER


def _least(minutes: float) -> str:
    """Minutes to three figures, never too few: `36.9 min`, `11.3 h`."""
    value, unit = (minutes / 60.0, "h") if minutes >= 600.0 else (minutes, "min")
    scale = 10.0 ** (math.floor(math.log10(max(value, 1e-9))) - 2)
    return numbers.typeset(f"{numbers.number(math.ceil(value / scale - 1e-9) * scale, 3)} {unit}")


def facts(found: Plan) -> Iterator[tuple[str, str]]:
    last = found.after[-1]
    for key, value in last.sigma.items():
        asked = found.tolerance.get(key)
        words = figure(key, value, asked)
        asks = "" if asked is None else f" (asked: {figure(key, asked, asked)})"
        yield parameter(key), words + asks
    words = pair_figure(last)
    if last.noncentrality is not None:
        words = f"{words} (asked: {numbers.number(found.pairs[0].wanted, 3)})"
    if words:
        yield f"{pair_head(found)} of the pair", words


def figure(key: str, value: float | None, like: float | None = None) -> str:
    """A figure of a parameter in its unit; what no row depends on is not seen.

    like: a figure of the same column, in whose unit it stands.
    """
    if value is None or not math.isfinite(value):
        return "not seen"
    dimension = suffix_unit(si_name(key.rpartition(".")[2]))[1]
    if like is None or dimension not in UNITS:
        return numbers.si_quantity(value, UNITS.get(dimension, ""), 3)
    return numbers.typeset(format_like(format_quantity(like, dimension), value, 3))


def parameter(key: str) -> str:
    """`lever_arm(position).x_m` as `lever arm x (position)`."""
    effect, _, name = key.rpartition(".")
    kind, _, place = effect.partition("(")
    own = split_suffix(name)[0]
    words = kind if kind.endswith(own) else f"{kind} {own}"
    return f"{words} ({place}".replace("_", " ") if place else key
