"""Whether two specs describe the same built system: what decides it, and where they differ."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, Final

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
    "baseline_m": "baseline", "type": "its type",
}  # fmt: skip


def description(system: System) -> dict[str, Any]:
    """What makes a system the one it is, as plain data.

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
        for role in ("position", "attitude", "ranging"):
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


_DISTRIBUTIONS: Final = ("Uniform", "Normal", "Constant", "Empirical")


def differences(kept: Any, own: Any) -> Iterator[str]:
    """`stages 1: the position sensor, its sigma: 0.012 there, 0.02 here`, one for each figure."""
    for path, there, here in _unlike(kept, own, ()):
        yield f"{_place(path)}: {_shown(there)} in the store, {_shown(here)} in the spec"


def _unlike(
    kept: Any, own: Any, path: tuple[str | int, ...]
) -> Iterator[tuple[tuple[str | int, ...], Any, Any]]:
    if isinstance(kept, dict) and isinstance(own, dict):
        for key in sorted({*kept, *own}):
            yield from _unlike(kept.get(key), own.get(key), (*path, key))
    elif isinstance(kept, list) and isinstance(own, list) and len(kept) == len(own):
        for k, (one, other) in enumerate(zip(kept, own, strict=True)):
            yield from _unlike(one, other, (*path, k))
    elif kept != own:
        yield path, kept, own


def _place(path: tuple[str | int, ...]) -> str:
    words = []
    for before, part in zip((None, *path), path, strict=False):
        if isinstance(part, int):
            words.append(f"stage {part + 1}" if before == "stages" else f"figure {part + 1}")
        elif part != "stages":
            words.append(_WORDS.get(part, part))
    return ", ".join(words) or "stages"


def _shown(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
