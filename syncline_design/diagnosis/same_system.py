"""Whether two specs describe the same built system: what decides it, and where they differ."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Json
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension, split_suffix, suffix_unit
from syncline_design.model.roles import ROLES
from syncline_design.model.system import UTC, System

# What a stage or a sensor is called does not decide what it is.
_NAMES: Final = ("name", "vehicle", "id")
_WORDS: Final = {
    "platform": "the platform", "position": "the position sensor",
    "attitude": "the attitude sensor", "ranging": "the ranging sensor",
    "lever_arm_m": "lever arm", "transponder_lever_arm_m": "the transponder's lever arm",
    "sigma": "its sigma", "timing": "its timing error", "timeline": "its timeline",
    "clock_offsets": "the host clock's offset", "effects": "the listed effects",
    "v_max_mps": "v_max", "omega_max_radps": "omega_max", "distance_m": "distance",
    "baseline_m": "baseline", "type": "its type", "kind": "kind", "parameters": "parameters",
    "low_s": "at least", "high_s": "at most", "std_s": "standard deviation", "value_s": "constant",
    "values_s": "measured values", "calibrated_s": "what is calibrated away",
    "drifted_s": "drift since", "bound_s": "bound", "nearest_m": "nearest distance",
    "acceleration_mps2": "acceleration", "angular_acceleration_radps2": "angular acceleration",
    "rate_hz": "its rate", "sound_mps": "speed of sound", "look": "where it looks",
}  # fmt: skip
_BODY: Final = ("forward", "right", "down")
_AXES: Final[Mapping[tuple[str | int | None, str | None], tuple[str, ...]]] = {
    ("sigma", "position"): ("north", "east", "down"),
    ("sigma", "attitude"): ("roll", "pitch", "yaw"),
    ("sigma", "ranging"): ("range", "azimuth", "elevation"),
    ("lever_arm_m", None): _BODY,
    ("transponder_lever_arm_m", None): _BODY,
    ("azimuth", None): ("from", "to"),
    ("elevation", None): ("from", "to"),
}
MOST_SHOWN: Final = 60
Path = tuple[str | int, ...]


def description(system: System) -> Json:
    """What makes a system the one it is, as the JSON that a store keeps.

    Platform, sensors, lever arms, timing and the effects that the spec lists (the statistics are
    taken at the spec, effects included); no names, no requirements, no horizon.
    """
    hosts = {UTC: UTC}
    for stage in system.stages:
        for sensor in stage.sensors():
            hosts.setdefault(sensor.timeline, f"host {len(hosts)}")
    stages = [s.name for s in system.stages]
    offsets = {
        hosts[timeline]: _plain(error)
        for timeline, error in system.clock_offsets
        if timeline in hosts
    }
    effects = [
        {**_plain(e), "stage": stages.index(e.stage) if e.stage in stages else e.stage}
        for e in system.effects
    ]
    parts = [{k: v for k, v in _plain(s).items() if k not in _NAMES} for s in system.stages]
    for part in parts:
        for role in ROLES:
            if part[role] is not None:
                own = {k: v for k, v in part[role].items() if k not in _NAMES}
                part[role] = own | {"timeline": hosts[own["timeline"]]}
    return {"stages": parts, "clock_offsets": offsets, "effects": effects}


def _plain(value: Any) -> Any:
    """Frozen dataclasses as mappings, a distribution with the name of its kind."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        kind = type(value).__name__
        return {"kind": kind, **found} if kind in _DISTRIBUTIONS else found
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    return value


# what decides how a system is driven and what is known of it, not how it measures
_DRIVEN: Final = ("platform", "look", "rate_hz", "effects")
_DISTRIBUTIONS: Final = ("Uniform", "Normal", "Constant", "Empirical")


@dataclass(frozen=True, slots=True)
class Difference:
    """Where two descriptions differ, what each has there, and whether it makes the measurements
    others: a sensor, a lever arm, a timing error; not a limit of the platform, a rate, what is
    listed as known."""

    place: str
    kept: str
    own: str
    measures: bool

    def words(self, where: str) -> str:
        """`stage 1, the position sensor, its sigma, north: 12 mm in the store, 20 mm in the
        spec`."""
        return f"{self.place}: {self.kept} in {where}, {self.own} in the spec"


def differences(kept: Any, own: Any) -> Iterator[Difference]:
    """What differs between a description that was kept and a system's own."""
    for path, there, here in _unlike(kept, own, ()):
        yield Difference(_place(path), *_shown_apart(there, here, path), _measures(path))


def _measures(path: Path) -> bool:
    """Whether measurements and their noise rest on what stands there."""
    return not any(part in _DRIVEN for part in path)


def _unlike(kept: Any, own: Any, path: Path) -> Iterator[tuple[Path, Any, Any]]:
    if isinstance(kept, dict) and isinstance(own, dict):
        for key in sorted({*kept, *own}):
            yield from _unlike(kept.get(key), own.get(key), (*path, key))
    elif isinstance(kept, list) and isinstance(own, list) and len(kept) == len(own):
        if path[-1:] == ("parameters",):  # pairs of a name and a figure
            kept, own = dict(kept), dict(own)
            for name in sorted({*kept, *own}):
                yield from _unlike(kept.get(name), own.get(name), (*path, name))
            return
        for k, (one, other) in enumerate(zip(kept, own, strict=True)):
            yield from _unlike(one, other, (*path, k))
    elif kept != own:
        yield path, kept, own


def _place(path: Path) -> str:
    words = []
    for k, part in enumerate(path):
        before = path[k - 1] if k else None
        if isinstance(part, int):
            words.append(_numbered(part, before, path[:k]))
        elif part not in ("stages", "parameters", "distribution"):
            words.append(_WORDS.get(part) or split_suffix(part)[0].replace("_", " "))
    return ", ".join(words) or "stages"


def _numbered(index: int, before: str | int | None, path: Path) -> str:
    """A place in a list: a stage, an effect, an axis."""
    axes = _AXES.get((before, _role(path))) or _AXES.get((before, None))
    if axes is not None:
        return axes[index]
    return f"{'stage' if before == 'stages' else 'number'} {index + 1}"


def _role(path: Path) -> str | None:
    return next((part for part in path if part in ROLES and isinstance(part, str)), None)


def _dimension(path: Path) -> Dimension:
    """What a figure of a description measures: what its name says, of a sigma its axis."""
    if "sigma" in path:
        if _role(path) == "position" or (_role(path) == "ranging" and path[-1] == 0):
            return Dimension.LENGTH
        return Dimension.ANGLE
    if "look" in path:
        return Dimension.ANGLE
    name = next((part for part in reversed(path) if isinstance(part, str)), "")
    return Dimension.FREQUENCY if name.endswith("_hz") else suffix_unit(name)[1]


def _shown_apart(there: Any, here: Any, path: Path) -> tuple[str, str]:
    """Both in units, with as many figures as it takes to tell them apart."""
    for digits in (4, 7, 12, 17):
        texts = _shown(there, path, digits), _shown(here, path, digits)
        if texts[0] != texts[1]:
            break
    return texts


def _shown(value: Any, path: Path, digits: int) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, float | int) and not isinstance(value, bool):
        return format_quantity(float(value), _dimension(path), digits)
    if isinstance(value, list):
        held = [_shown(one, (*path, k), digits) for k, one in enumerate(value)]
        return _short(f"({', '.join(held)})")
    if isinstance(value, dict):
        held = [f"{_place((key,))} {_shown(one, (*path, key), digits)}"
                for key, one in value.items() if one is not None]  # fmt: skip
        return _short(", ".join(held) or "nothing")
    return _short(str(value))


def _short(text: str) -> str:
    return text if len(text) <= MOST_SHOWN else text[: MOST_SHOWN - 3] + "..."
