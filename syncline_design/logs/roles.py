"""Which stream plays which part in a diagnosis: as the spec says, else by what each measures.

A choice that nobody made is said with its reason and how sure it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

from syncline_design.logs.readers.stream import Recording, Stream
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.log_block import LogChoice

Role = Literal["position", "attitude", "velocity", "rate", "ranging", "target", "reference"]
Sureness = Literal["stated", "high", "medium", "low"]
ROLES: Final[tuple[Role, ...]] = (
    "position", "attitude", "velocity", "rate", "ranging", "target", "reference",
)  # fmt: skip
NEEDED: Final[Mapping[Role, str]] = {role: role for role in ROLES} | {"reference": "position"}
LEAST_MESSAGES: Final = 10


@dataclass(frozen=True, slots=True, eq=False)
class Offer:
    """A stream with the recording that it is of."""

    recording: Recording
    stream: Stream

    @property
    def path(self) -> Path:
        return self.recording.path

    @property
    def name(self) -> str:
        return self.stream.name

    def has(self, quantity: str) -> bool:
        return quantity in self.stream.quantity


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A stream in its part."""

    role: Role
    offer: Offer
    sure: Sureness
    why: str


def offers_of(recordings: Sequence[Recording]) -> list[Offer]:
    """Every stream of every recording."""
    return [Offer(one, stream) for one in recordings for stream in one.streams()]


def parts_of(
    offers: Sequence[Offer], choice: LogChoice | None = None, *, surveyed: bool = False
) -> dict[Role, Part]:
    """The parts as far as they can be given; what the spec names goes first.

    surveyed: whether a file beside tells the places of targets, as a survey among the offers does.
    """
    found = _stated(offers, choice)
    surveyed = surveyed or any(o.has("target") and o.stream.stamps is None for o in offers)
    usable = [one for one in offers if one.stream.messages >= LEAST_MESSAGES and one.stream.stamps]
    paths = list(dict.fromkeys(one.path for one in usable))
    cloud = _cloud(usable) if surveyed and "ranging" not in found else None
    if cloud is not None:
        found["ranging"] = cloud
    for role, choose in _CHOOSERS.items():
        if role not in found:
            part = choose(usable, found, paths)
            if part is not None:
                found[role] = part
    return found


def _stated(offers: Sequence[Offer], choice: LogChoice | None) -> dict[Role, Part]:
    named = {} if choice is None else choice.streams.model_dump()
    found: dict[Role, Part] = {}
    for role in ROLES:
        name = named.get(role)
        if name is not None:
            found[role] = Part(role, _named(offers, role, name), "stated", "the spec says so")
    return found


def _named(offers: Sequence[Offer], role: Role, name: str) -> Offer:
    """A stream by its own name, by its file's, or by `file:stream`."""
    quantity = NEEDED[role]
    same = [o for o in offers if name in (o.name, f"{o.path.name}:{o.name}")]
    same = same or [o for o in offers if name in (o.path.name, o.path.stem) and _plays(o, role)]
    known = sorted({o.name for o in offers} | {o.path.name for o in offers})
    first = offers[0].path
    if not same:
        raise refuse(
            first,
            f"no stream {name!r}",
            field=f"log.streams.{role}",
            expected=f"a stream with {quantity}: "
            + (
                ", ".join(sorted(o.name for o in offers if _plays(o, role))[:12]) or "there is none"
            ),
            hint=did_you_mean(name, known),
        )
    if len({o.path for o in same}) > 1:
        listed = ", ".join(f"{o.path.name}:{o.name}" for o in same)
        hint = "say which file: FILE:STREAM"
        raise refuse(first, f"{name!r} is in several files", found=listed[:300], hint=hint)
    if not any(_plays(o, role) for o in same):
        raise refuse(
            same[0].path,
            f"{name} holds no {quantity}",
            field=f"log.streams.{role}",
            found=", ".join(same[0].stream.quantity) or "nothing that is read",
            hint="`syncline-design log inspect` lists what each stream holds; its stamps alone are "
            "for `audit`, and for the row `timing` of `accept`",
        )
    return max((o for o in same if _plays(o, role)), key=lambda o: o.stream.messages)


def _plays(offer: Offer, role: Role) -> bool:
    """Whether a stream measures what a part needs; a cloud's points are as good as ranges, where
    they are read as places (of a scan in a bag the stamps alone are)."""
    return offer.has(NEEDED[role]) or (role == "ranging" and is_cloud(offer))


def is_cloud(offer: Offer) -> bool:
    """Whether a stream's points have places."""
    return offer.has("points") and "point_x_m" in offer.stream.columns


Chooser = Callable[[Sequence[Offer], Mapping[Role, Part], Sequence[Path]], Part | None]


def _position(
    offers: Sequence[Offer], found: Mapping[Role, Part], paths: Sequence[Path]
) -> Part | None:
    """What is tested: of several files the first's, else a receiver's own positions."""
    taken = found["reference"].offer if "reference" in found else None
    there = [o for o in offers if o.has("position") and o is not taken]
    if not there:
        return None
    if len(paths) > 1 and any(o.path == paths[0] for o in there):
        first = [o for o in there if o.path == paths[0]]
        best = max(first, key=_measured_first)
        return Part("position", best, "medium", "of several files the first is what is tested")
    best = max(there, key=_measured_first)
    if best.stream.frame == "wgs84" and best.stream.nature in ("measured", "unknown"):
        return Part("position", best, "high", "a receiver's own positions (WGS 84)")
    return Part(
        "position", best, "low", "the only positions that are left, no receiver's own fixes"
    )


def _measured_first(offer: Offer) -> tuple[int, int, int, int]:
    """A receiver's own before anything estimated; with more messages before fewer."""
    stream = offer.stream
    own = {"measured": 2, "unknown": 1, "fused": 0, "truth": -1}[stream.nature]
    alone = 0 if stream.has_attitude else 1
    return own, int(stream.frame == "wgs84"), alone, stream.messages


def _reference(
    offers: Sequence[Offer], found: Mapping[Role, Part], paths: Sequence[Path]
) -> Part | None:
    """What it is tested against: truth, another file's, another system's; an estimate last."""
    if "position" not in found or "ranging" in found:
        return None
    tested = found["position"].offer
    there = [o for o in offers if o.has("position") and o is not tested]
    other = [o for o in there if o.path != tested.path]
    if other:
        last = [o for o in other if o.path == other[-1].path]
        best = max(last, key=_reference_rank)
        return Part("reference", best, "medium", "of several files the last is the reference")
    if not there:
        return None
    globe = tested.stream.frame == "wgs84"
    best = max(
        there,
        key=lambda o: (
            not _same_kind(o, tested),
            *_reference_rank(o)[:2],
            o.has("velocity"),
            globe and o.stream.frame == "wgs84",
            o.stream.messages,
        ),
    )
    if _same_kind(best, tested):
        return Part("reference", best, "low", "a receiver's positions too, maybe of the same one: "
                    "what both share cannot show")  # fmt: skip
    if best.stream.nature == "truth":
        return Part("reference", best, "high", "the simulation's truth")
    if best.stream.nature == "fused":
        return Part("reference", best, "low", "estimated with the tested positions themselves: no "
                    "independent reference, but delays against other sensors show")  # fmt: skip
    return Part("reference", best, "medium", "positions of another system in the same file")


def _same_kind(one: Offer, tested: Offer) -> bool:
    """Whether both are plain fixes of a receiver in one file: often of one and the same."""
    plain = [o.stream.frame == "wgs84" and not o.stream.has_attitude
             and o.stream.nature in ("measured", "unknown") for o in (one, tested)]  # fmt: skip
    return all(plain)


def _reference_rank(offer: Offer) -> tuple[int, int, int]:
    nature = {"truth": 3, "measured": 2, "unknown": 2, "fused": 1}[offer.stream.nature]
    return nature, int(offer.stream.has_attitude), offer.stream.messages


def _attitude(
    offers: Sequence[Offer], found: Mapping[Role, Part], paths: Sequence[Path]
) -> Part | None:
    """The reference's own, since both stand in one frame; else the quickest of any."""
    reference = found.get("reference")
    there = [o for o in offers if o.has("attitude")]
    if reference is not None and reference.offer.has("attitude"):
        return Part("attitude", reference.offer, "high", "the reference's own, in its frame")
    near = [o for o in there if reference is None or o.path == reference.offer.path] or there
    if not near:
        return None
    best = max(near, key=lambda o: (o.stream.nature != "truth", o.stream.messages))
    if reference is not None and reference.offer.stream.nature == "truth":
        best = max(near, key=lambda o: (o.stream.nature == "truth", o.stream.messages))
    several = f", the quickest of {len(near)}" if len(near) > 1 else ""
    return Part("attitude", best, "medium", f"a stream with attitude{several}")


def _of_reference(role: Role) -> Chooser:
    def choose(
        offers: Sequence[Offer], found: Mapping[Role, Part], paths: Sequence[Path]
    ) -> Part | None:
        """Velocity or rates: those of the stream that tells the motion, else none (derived)."""
        for owner in ("reference", "attitude") if role == "velocity" else ("attitude",):
            part = found.get(owner)
            if part is not None and part.offer.has(role):
                return Part(role, part.offer, "high", f"the {owner}'s own")
        if role == "velocity":
            return None
        attitude = found.get("attitude")
        there = [o for o in offers if o.has(role) and attitude is not None]
        near = [o for o in there if attitude is not None and o.path == attitude.offer.path]
        flown = [o for o in near if o.stream.nature != "truth"]
        if attitude is None or not flown or attitude.offer.stream.body == "unknown":
            return None
        same = [o for o in flown if o.stream.body == attitude.offer.stream.body]
        if not same:
            return None
        best = max(same, key=lambda o: (not o.has("acceleration"), o.stream.messages))
        return Part(role, best, "medium", "body rates beside the attitude, same body axes")

    return choose


def _cloud(offers: Sequence[Offer]) -> Part | None:
    """Points as ranges, where a trajectory with attitudes lies beside."""
    clouds = [o for o in offers if is_cloud(o)]
    told = [o for o in offers if o.has("position") and o.has("attitude")]
    ranged = any(o.has("ranging") for o in offers)
    if ranged or not clouds or not told:
        return None
    best = max(clouds, key=lambda o: o.stream.messages)
    return Part("ranging", best, "medium", "points of a cloud: range and bearing from the "
                "trajectory beside it")  # fmt: skip


def _single(role: Role) -> Chooser:
    def choose(
        offers: Sequence[Offer], found: Mapping[Role, Part], paths: Sequence[Path]
    ) -> Part | None:
        there = [o for o in offers if o.has(role)]
        if not there or (role == "ranging" and not any(o.has("target") for o in offers)):
            return None
        best = max(there, key=lambda o: o.stream.messages)
        return Part(role, best, "medium", f"a stream with {role}")

    return choose


_CHOOSERS: Final[dict[Role, Chooser]] = {
    "ranging": _single("ranging"),
    "target": _single("target"),
    "position": _position,
    "reference": _reference,
    "attitude": _attitude,
    "velocity": _of_reference("velocity"),
    "rate": _of_reference("rate"),
}
