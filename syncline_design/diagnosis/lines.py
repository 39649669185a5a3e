"""Waves that no effect of the dictionary makes: in time, in range, in heading.

What is left, weighed by the noise, is taken apart into waves along every sensor's readings.  A wave
counts where its power stands out of the neighbouring frequencies' (Lomb 1976 for uneven stamps) and
out of the model's noise, each by more than chance among all of them (of the few harmonics of the
heading, out of the noise alone); and where it is large enough to matter and stands up in noise of
another kind.  It is no cause: it goes into the model as what it is, a wave in one reading, so that
no noise and no other name takes its shape.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, Signature, slopes
from syncline_design.diagnosis.consequence import expected_rms_m, rms_m
from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data, Model, inner, scored, solve_scaled, thinned
from syncline_design.diagnosis.followed import heading_is_noise
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import (
    ActsOn,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Values,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage

LINE = "spectral_line"
MOST_ROWS = 3000
MOST_WAVES = 3000  # frequencies tried
LEAST_CYCLES = 8  # along the log: slower is slow noise
LEAST_IN_RANGE = 3  # along the ranges
NEAR = 40  # frequencies to either side that a wave is held against
LEAST_SHARE = 0.1  # of what the spec's noise expects: a wave that is smaller does not matter
FINER = 41  # frequencies about the strongest
CHANCE = 0.002  # that noise alone shows one
HARMONICS = 4
NAMES: dict[str, tuple[str, str, str]] = {
    "position": ("north", "east", "down"),
    "attitude": ("roll", "pitch", "yaw"),
    "ranging": ("range", "azimuth", "elevation"),
}
OVER = {
    "time": ("period_s", "s", "every {period_s}"),
    "range": ("wavelength_m", "m", "every {wavelength_m} of range"),
    "heading": ("harmonic", "", "{harmonic} times a turn"),
}


@dataclass(frozen=True, slots=True)
class Wave:
    """A wave in one reading, over time, range or heading: `cycles` a second, metre or turn."""

    over: str
    cycles: float
    sensor: ActsOn
    stage: int
    reading: int

    def phase(self, rows: StageRows) -> Array:
        """Angle [rad] at every row, (n,)."""
        along = {"time": rows.time_s, "range": rows.range_m,
                 "heading": rows.euler_rad[:, 2] / (2.0 * math.pi)}[self.over]  # fmt: skip
        turned: Array = 2.0 * math.pi * self.cycles * along
        return turned

    def depart(self, rows: StageRows, values: Values, _: ActsOn, __: Rng) -> Departures:
        """reading = true + cosine cos(phase) + sine sin(phase)."""
        cosine, sine = values.values()
        angle = self.phase(rows)
        added = float(cosine) * np.cos(angle) + float(sine) * np.sin(angle)
        three = added[:, None] * np.eye(3)[self.reading]
        if self.sensor == "position":
            return Departures(position_m=three)
        if self.sensor == "attitude":
            return Departures(attitude_euler_rad=three)
        names = ("range_m", "azimuth_rad", "elevation_rad")
        return Departures(**{names[self.reading]: added})

    @property
    def unit(self) -> str:
        """Of its amplitude."""
        length = self.sensor == "position" or (self.sensor, self.reading) == ("ranging", 0)
        return "m" if length else "rad"

    @property
    def effect(self) -> Effect:
        """The wave as an effect of its own, in no registry."""
        reading, unit = NAMES[self.sensor][self.reading], self.unit
        swings = f"{reading} swings by {{amplitude_{unit}}} {OVER[self.over][2]}"
        return Effect(
            name=LINE,
            sensors=(self.sensor,),
            kind="deterministic",
            parameters=tuple(Parameter(f"{w}_{unit}", 1e-4, 1e3, unit) for w in ("cos", "sin")),
            sentence=f"{swings}: a wave without a known cause",
            confused_with="anything that turns or swings at this pace",
            separated_by="look for what turns at this pace: a mount, a scanner, the swell",
            source="Lomb, Astrophysics and Space Science 39 (1976)",
            depart=self.depart,
            sensitivity=None,
            contribute=_contribute,
        )

    def shown(self, values: Values) -> dict[str, tuple[float | str, str]]:
        """What is said of it: name to (value, unit)."""
        name, unit, _ = OVER[self.over]
        size = math.hypot(*(float(v) for v in values.values()))
        along = self.cycles if self.over == "heading" else 1.0 / self.cycles
        return {name: (along, unit), f"amplitude_{self.unit}": (size, self.unit),
                "channel": (NAMES[self.sensor][self.reading], "")}  # fmt: skip


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """Nothing: a wave without a cause is not written into a spec."""
    return Contribution()


def wave_of(effect: Effect) -> Wave | None:
    """The wave that an effect of this kind is."""
    own = getattr(effect.depart, "__self__", None)
    return own if isinstance(own, Wave) else None


def best_wave(data: Data, model: Model) -> Signature | None:
    """The wave that stands out most of what a model leaves, where it is large enough to matter."""
    few, part = thinned(data, model, MOST_ROWS)
    taken = {a.label for a in model.acting}
    left = part.precision.solve(part.error[:, :, None])[:, :, 0]
    found = [
        one
        for one in (*_in_series(few, left), *_in_heading(few, part, left))
        if (LINE, one[1].sensor, one[1].stage) not in taken
    ]
    if not found:
        return None
    _, wave, limit = max(found, key=lambda one: one[0])
    candidate = Candidate(wave.effect, wave.sensor, wave.stage)
    columns = _columns(data, candidate)
    normal, score = scored(model.precision, columns, model.error)
    values = solve_scaled(normal, score)
    if 0.5 * float(score @ values) < limit:  # neighbours may be still by chance, too
        return None
    if rms_m(data, columns @ values) < LEAST_SHARE * expected_rms_m(data):
        return None
    return Signature(candidate, {}, columns)


def _columns(data: Data, candidate: Candidate) -> Array:
    names = [p.name for p in candidate.effect.parameters]
    one = Acting(candidate.effect, candidate.sensor, candidate.stage, dict.fromkeys(names, 0.0))
    return np.nan_to_num(slopes(data.view, (one,)))


def _readings(data: Data) -> Iterator[tuple[ActsOn, int, int, Array]]:
    """(sensor, stage, reading, what one sigma of it does to the error (n, 3)) of all that count."""
    stages = [stage.name for stage in data.view.system.stages]
    for (stage, sensor), loading in channels(data.view):
        for k in range(loading.shape[2]):
            if np.any(loading[:, list(data.axes), k]):
                yield sensor, stages.index(stage), k, loading[:, :, k]  # type: ignore[misc]


def _in_series(data: Data, left: Array) -> Iterator[tuple[float, Wave, float]]:
    """Waves over time and over range: (how far they stand out, the wave, nat it has to save)."""
    time_s = data.view.log.time_s
    whole_s = max(float(time_s[-1] - time_s[0]), 1e-9)
    count = min(len(np.unique(time_s)), MOST_WAVES)
    cycles = np.arange(2 * LEAST_CYCLES, count) / (2.0 * whole_s)
    readings = list(_readings(data))
    scores = [np.sum(loading * left, axis=1) for *_, loading in readings]
    if readings and cycles.size > 2 * NEAR:
        yield from _outstanding("time", cycles, time_s, readings, np.array(scores))
    for reading, score in zip(readings, scores, strict=True):
        sensor, stage, k, _ = reading
        distance = data.view.rows[stage].range_m
        span = float(np.ptp(np.quantile(distance, [0.02, 0.98])))
        if sensor == "ranging" and k == 0 and span > 0.0:
            along = np.arange(2 * LEAST_IN_RANGE, MOST_WAVES // 2) / (2.0 * span)
            yield from _outstanding("range", along, distance, [reading], score[None])


def _outstanding(
    over: str,
    cycles: Array,
    along: Array,
    readings: list[tuple[ActsOn, int, int, Array]],
    scores: Array,
) -> Iterator[tuple[float, Wave, float]]:
    """The strongest wave of every reading, where its power is none that neighbours have."""
    power = _power(cycles, along, scores)
    limit = math.log(power.size / CHANCE)

    for own, score, (sensor, stage, k, _) in zip(power, scores, readings, strict=True):
        best = int(np.argmax(own))
        near = np.r_[own[max(best - NEAR, 0) : max(best - 2, 0)], own[best + 3 : best + NEAR + 1]]
        usual = float(np.median(near)) / math.log(2.0)
        if own[best] > limit * usual > 0.0:
            near_it = cycles[best] + (cycles[1] - cycles[0]) * np.linspace(-1.0, 1.0, FINER)
            turned = np.exp(2j * math.pi * along[:, None] * near_it)
            peak = float(near_it[int(np.argmax(np.abs(score @ turned)))])
            yield own[best] / usual, Wave(over, peak, sensor, stage, k), limit


def _power(cycles: Array, along: Array, scores: Array) -> Array:
    """|sum of scores (r, n) times exp(2 pi i c x)|^2 over evenly spaced c, (r, c).

    exp(i (a + b)) = exp(i a) exp(i b): the frequencies of a run differ by the same small ones.
    """
    angle = 2j * math.pi * along[:, None]
    run = max(math.isqrt(cycles.size), 1)
    fine = np.exp(angle * (cycles[:run] - cycles[0]))
    sums = [(scores * np.exp(angle[:, 0] * first)) @ fine for first in cycles[::run]]
    power: Array = np.abs(np.concatenate(sums, axis=1)[:, : cycles.size]) ** 2
    return power


def _in_heading(data: Data, model: Model, left: Array) -> Iterator[tuple[float, Wave, float]]:
    """Harmonics of the heading in the yaw, by their energy in the model's own noise."""
    limit = math.log(HARMONICS / CHANCE)
    for sensor, stage, k, _ in _readings(data):
        if (sensor, k) != ("attitude", 2) or heading_is_noise(data.view, stage):
            continue
        for harmonic in range(2, HARMONICS + 1):  # once a turn is hard iron
            wave = Wave("heading", float(harmonic), sensor, stage, k)
            columns = _columns(data, Candidate(wave.effect, sensor, stage))
            score = inner(columns, left[:, :, None])[:, 0]
            normal = model.precision.information(columns)
            energy = 0.5 * float(score @ solve_scaled(normal, score))
            if energy > limit:
                yield energy, wave, limit
