"""An effect cut to a stretch of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, Signature
from syncline_design.effects.record import (
    NOTHING,
    ActsOn,
    Array,
    Departures,
    Effect,
    Rng,
    StageRows,
    Values,
)
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class StampSpan:
    """An effect at work from one stamp to another, both included [s]."""

    effect: Effect
    from_s: float
    to_s: float

    def mask(self, time_s: Array) -> Array:
        """1 inside, 0 outside (n,)."""
        return ((time_s >= self.from_s) & (time_s <= self.to_s)).astype(float)

    def depart(self, rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
        """What the effect does, inside; nothing outside."""
        inside = self.mask(rows.time_s)
        found = self.effect.depart(rows, values, sensor, rng)
        return Departures(
            **{
                name: part * (inside if part.ndim == 1 else inside[:, None])
                for name in Departures.__slots__
                if (part := getattr(found, name)) is not getattr(NOTHING, name) and np.any(part)
            }
        )

    def sensitivity(self, rows: StageRows, values: Values, sensor: ActsOn) -> Array:
        """Its slopes, zero outside."""
        assert self.effect.sensitivity is not None
        inside = self.mask(rows.time_s)[:, None, None]
        return np.asarray(self.effect.sensitivity(rows, values, sensor) * inside)

    @property
    def cut(self) -> Effect:
        """The effect cut to the stretch, under its own name."""
        return replace(self.effect, depart=self.depart, sensitivity=self.sensitivity)


def span_of(effect: Effect) -> StampSpan | None:
    """The stretch that an effect is cut to."""
    own = getattr(effect.depart, "__self__", None)
    return own if isinstance(own, StampSpan) else None


def acts_at(effect: Effect, time_s: Array) -> bool:
    """Whether an effect that may be cut to a stretch acts at any of these stamps."""
    span = span_of(effect)
    return span is None or bool(np.any(span.mask(time_s)))


def cut_to(span: StampSpan, found: Signature, time_s: Array) -> Signature:
    """Another effect's signature in the same stretch."""
    one = found.candidate
    effect = replace(span, effect=one.effect).cut
    mask = span.mask(time_s)[:, None, None]
    return Signature(Candidate(effect, one.sensor, one.stage), found.at, found.columns * mask)


def cuttable(effect: Effect) -> bool:
    """Whether it can be cut to a stretch: neither placed nor cut already, without memory."""
    placed = any(p.located for p in effect.parameters)
    known = effect.kind == "deterministic" and effect.sensitivity is not None
    return known and not placed and not effect.memory and span_of(effect) is None
