"""The logs of the diagnosis study: which world, which hidden effects, what a right answer is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tests.world import CHAIN, Hidden, Noise, Scenario, hidden, scenario
from tests.world.bound import fitted_keys, information

PLATFORMS = ("multirotor_lines", "fixed_wing_circuits", "car_stops", "vessel_figure_eights")
DEGREE = np.pi / 180.0
Parameters = dict[str, float | str]
AS_SPECIFIED = Noise()


@dataclass(frozen=True)
class Case:
    """One log.

    group: row of the table.  times_bound: the effects' parameters are set to so many
    Cramer-Rao bounds of this very log; None keeps them as written.  exclude: effects taken out of
    the dictionary.
    """

    group: str
    label: str
    platform: str
    seed: int
    effects: tuple[Hidden, ...] = ()
    times_bound: float | None = None
    exclude: tuple[str, ...] = ()
    noise: Noise = AS_SPECIFIED
    duration_s: float = 300.0
    rate_hz: float = 10.0
    kind: str = "georeference"
    gaps: tuple[tuple[float, float], ...] = ()

    @property
    def id(self) -> str:
        return f"{self.group}/{self.label}/{self.platform}/{self.kind}/{self.seed}"

    def run(self) -> Scenario:
        made = scenario(self.platform, self.seed, self.duration_s, self.rate_hz, self.kind)
        return made.without(self.gaps) if self.gaps else made

    def sized_effects(self, run: Scenario) -> tuple[Hidden, ...]:
        """The effects with their parameters at `times_bound` bounds, each of its own sign."""
        if self.times_bound is None:
            return self.effects
        sized = []
        for effect in self.effects:
            fisher = information(run, (effect,), self.noise, fitted_keys((effect,)))
            bound = np.sqrt(np.diag(np.linalg.inv(fisher)))
            names = [name for _, name in fitted_keys((effect,))]
            signs = np.random.default_rng([self.seed, 53]).choice([-1.0, 1.0], len(names))
            if effect.effect in ONE_SIGN:
                signs = np.ones(len(names))
            sizes = signs * self.times_bound * bound
            values = {name: float(size) for name, size in zip(names, sizes, strict=True)}
            sized.append(effect.with_values(values))
        return tuple(sized)


ONE_SIGN = {"latency", "filter_lag", "scan_distortion", "turnaround_delay", "acceleration_tilt"}
ZERO_XYZ_M: Parameters = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}
ZERO_XYZ_RAD: Parameters = {"x_rad": 0.0, "y_rad": 0.0, "z_rad": 0.0}
Where = tuple[str, ...]
GEOREFERENCE: tuple[tuple[str, str, Parameters, Where], ...] = (
    ("latency", "position", {"latency_s": 0.0}, PLATFORMS),
    ("latency", "attitude", {"latency_s": 0.0}, PLATFORMS),
    ("latency", "ranging", {"latency_s": 0.0}, PLATFORMS),
    ("clock_drift", "position", {"rate": 0.0}, PLATFORMS),
    ("clock_drift", "attitude", {"rate": 0.0}, PLATFORMS),
    ("timestamp_step", "position", {"step_s": 0.0, "time_s": 140.0}, PLATFORMS),
    ("timestamp_step", "attitude", {"step_s": 0.0, "time_s": 140.0}, PLATFORMS),
    ("filter_lag", "position", {"time_constant_s": 0.0}, PLATFORMS),
    ("lever_arm", "position", ZERO_XYZ_M, PLATFORMS),
    ("lever_arm", "ranging", ZERO_XYZ_M, PLATFORMS),
    ("boresight", "ranging", ZERO_XYZ_RAD, PLATFORMS),
    ("mounting", "attitude", ZERO_XYZ_RAD, PLATFORMS),
    ("range_bias", "ranging", {"bias_m": 0.0}, PLATFORMS),
    ("range_scale", "ranging", {"scale": 0.0}, PLATFORMS),
    ("azimuth_bias", "ranging", {"bias_rad": 0.0}, PLATFORMS),
    ("elevation_bias", "ranging", {"bias_rad": 0.0}, PLATFORMS),
    ("heading_bias", "attitude", {"bias_rad": 0.0}, PLATFORMS),
    ("heading_hard_iron", "attitude", {"sin_rad": 0.0, "cos_rad": 0.0}, PLATFORMS),
    ("heading_drift", "attitude", {"rate_radps": 0.0}, PLATFORMS),
    ("acceleration_tilt", "attitude", {"gain": 0.0}, ("multirotor_lines", "car_stops")),
    ("flexure", "ranging", {"x": 0.0, "y": 0.0, "z": 0.0}, ("multirotor_lines", "car_stops")),
    ("datum_offset", "target", {"north_m": 0.0, "east_m": 0.0, "down_m": 0.0}, PLATFORMS),
    ("grid_scale", "target", {"scale": 0.0}, PLATFORMS),
    ("grid_convergence", "target", {"rotation_rad": 0.0}, PLATFORMS),
    ("scan_distortion", "ranging", {"period_s": 0.0}, PLATFORMS),
    ("sound_speed", "ranging", {"relative_error": 0.0}, ("vessel_figure_eights", CHAIN)),
    ("turnaround_delay", "ranging", {"delay_s": 0.0}, (CHAIN,)),
    ("induced_heave", "position", ZERO_XYZ_M, ("vessel_figure_eights",)),
)
POSITION: tuple[tuple[str, Parameters], ...] = (
    ("latency", {"latency_s": 0.0}),
    ("lever_arm", ZERO_XYZ_M),
    ("clock_drift", {"rate": 0.0}),
    ("filter_lag", {"time_constant_s": 0.0}),
)
DISCRETE: tuple[tuple[str, str, Parameters], ...] = (
    ("integer_second_slip", "position", {"seconds": 1.0}),
    ("integer_second_slip", "position", {"seconds": -18.0}),
    ("frame_convention", "position", {"convention": "enu"}),
    ("frame_convention", "attitude", {"convention": "yaw_sign"}),
    ("frame_convention", "attitude", {"convention": "yaw_180"}),
    ("frame_convention", "attitude", {"convention": "radians"}),
    ("frame_convention", "attitude", {"convention": "transposed"}),
    ("frame_convention", "ranging", {"convention": "azimuth_sign"}),
    ("frame_convention", "ranging", {"convention": "elevation_sign"}),
)
STOCHASTIC: tuple[tuple[str, str, Parameters, str], ...] = (
    ("timestamp_jitter", "position", {"std_s": 0.005}, "car_stops"),
    ("timestamp_jitter", "position", {"std_s": 0.003}, "fixed_wing_circuits"),
    ("timestamp_jitter", "attitude", {"std_s": 0.008}, "multirotor_lines"),
    ("packetised_timestamps", "position", {"interval_s": 0.012}, "car_stops"),
    ("packetised_timestamps", "attitude", {"interval_s": 0.02}, "multirotor_lines"),
    ("noise_understated", "position", {"factor": 2.5}, "car_stops"),
    ("noise_understated", "attitude", {"factor": 2.0}, "fixed_wing_circuits"),
    ("noise_understated", "ranging", {"factor": 2.5}, "vessel_figure_eights"),
    ("correlated_noise", "position", {"std_m": 0.04, "time_constant_s": 15.0}, "car_stops"),
    ("heavy_tails", "position", {"degrees_of_freedom": 2.5}, "car_stops"),
    ("heavy_tails", "position", {"outlier_rate": 0.02}, "car_stops"),
    ("height_drift", "position", {"std_m": 0.06, "time_constant_s": 60.0}, "car_stops"),
)
PAIRS: tuple[tuple[int, int], ...] = (  # rows of GEOREFERENCE
    (0, 8),  # latency and lever arm of the GNSS
    (0, 10),  # latency, boresight
    (1, 17),  # INS latency, hard iron
    (1, 12),
    (3, 11),  # clock drift, mounting
    (5, 16),  # step, heading bias
    (7, 13),  # lag, range scale
    (8, 15),
    (9, 18),  # scanner arm, heading drift
    (0, 21),  # latency, datum
    (2, 22),  # ranging latency, grid scale
    (10, 12),  # boresight, range bias
)


def _one(row: int) -> Hidden:
    effect, sensor, parameters, where = GEOREFERENCE[row]
    stage = "vessel" if where == (CHAIN,) else None
    return hidden(effect, sensor, stage, **parameters)


def clean(seed: int) -> Iterator[Case]:
    wander = Noise(wander_share=0.6, wander_time_s=float(5 * 3 ** (seed % 4)))
    for platform in PLATFORMS:
        yield Case("clean, white noise", "clean", platform, seed)
        yield Case("clean, correlated noise", "clean", platform, seed, noise=wander)
    for platform in ("car_stops", "vessel_figure_eights"):
        yield Case("clean, white noise", "clean", platform, seed, kind="position")
        yield Case(
            "clean, correlated noise", "clean", platform, seed, noise=wander, kind="position"
        )
    yield Case("clean, white noise", "clean", CHAIN, seed)


def singles(seed: int, times: float) -> Iterator[Case]:
    group = f"one effect at {times:g} times its bound"
    for row, (effect, sensor, _, where) in enumerate(GEOREFERENCE):
        platform = where[(seed + row) % len(where)]
        label = f"{effect} ({sensor})"
        yield Case(group, label, platform, seed, (_one(row),), times)
    for row, (effect, parameters) in enumerate(POSITION):
        platform = ("car_stops", "vessel_figure_eights")[(seed + row) % 2]
        fault = hidden(effect, "position", None, **parameters)
        label = f"{effect} (position)"
        yield Case(group, label, platform, seed, (fault,), times, kind="position")


def others(seed: int) -> Iterator[Case]:
    for index, (effect, sensor, parameters) in enumerate(DISCRETE):
        platform = PLATFORMS[(seed + index) % 4]
        label = f"{effect} ({sensor}) {next(iter(parameters.values()))}"
        yield Case(
            "conventions and slips",
            label,
            platform,
            seed,
            (hidden(effect, sensor, None, **parameters),),
        )
    for effect, sensor, parameters, platform in STOCHASTIC:
        label = f"{effect} ({sensor}) {next(iter(parameters))}"
        yield Case(
            "noise effects", label, platform, seed, (hidden(effect, sensor, None, **parameters),)
        )
    for index, (first, second) in enumerate(PAIRS):
        pair = (_one(first), _one(second))
        label = " + ".join(f"{e.effect} ({e.sensor})" for e in pair)
        platform = PLATFORMS[(seed + index) % 4]
        yield Case("two effects at 10 times their bounds", label, platform, seed, pair, 10.0)


def constant_speed(seed: int) -> Iterator[Case]:
    for platform in ("straight_constant_speed", "reciprocal_lines", "constant_speed_eights"):
        for row in (0, 8):
            fault = _one(row)
            if row == 8:
                fault = hidden("lever_arm", "position", x_m=0.15, y_m=0.0, z_m=0.0)
            else:
                fault = hidden("latency", "position", latency_s=0.03)
            label = f"{fault.effect} (position)"
            yield Case("constant speed: a class is right", label, platform, seed, (fault,))


DELETED: tuple[tuple[int, tuple[str, ...]], ...] = (
    (0, ("latency", "packetised_timestamps", "filter_lag")),
    (1, ("latency", "packetised_timestamps")),
    (5, ("timestamp_step",)),
    (3, ("clock_drift",)),
    (17, ("heading_hard_iron",)),
    (13, ("range_scale", "sound_speed")),
    (19, ("acceleration_tilt",)),
    (24, ("scan_distortion",)),
)


def deleted(seed: int) -> Iterator[Case]:
    for index, (row, names) in enumerate(DELETED):
        effect, sensor, _, where = GEOREFERENCE[row]
        platform = where[(seed + index) % len(where)]
        label = f"{effect} ({sensor})"
        times = 30.0 if (seed + index) % 2 else 150.0
        group = f"true effect, {times:g} times its bound, not in the dictionary"
        yield Case(group, label, platform, seed, (_one(row),), times, exclude=names)


def families(seed: int) -> Iterator[Case]:
    for index, family in enumerate(("student", "laplace", "uniform")):
        platform = PLATFORMS[(seed + index) % 4]
        noise = Noise(family=family)
        yield Case("clean, noise of another family", family, platform, seed, noise=noise)
    wander = Noise(attitude_wander_share=0.5)
    group = "clean, correlated attitude noise"
    yield Case(group, "attitude wander", PLATFORMS[seed % 4], seed, noise=wander)


def lengths(seed: int) -> Iterator[Case]:
    fault = (_one(0),)
    base = Case("", "latency (position)", PLATFORMS[seed % 4], seed, fault, 10.0)
    yield replace(base, group="60 s at 10 Hz", duration_s=60.0)
    yield replace(base, group="300 s at 1 Hz", rate_hz=1.0)
    yield replace(base, group="120 s at 50 Hz", duration_s=120.0, rate_hz=50.0)
    yield replace(base, group="with gaps", gaps=((40.0, 75.0), (150.0, 153.0), (200.0, 240.0)))
    if seed % 4 == 0:
        yield replace(base, group="1 h at 10 Hz", duration_s=3600.0)


def full(seeds: int, first: int = 100) -> list[Case]:
    """Every case, seed by seed, so that a part of the study is a fair sample of it."""
    cases: list[Case] = []
    for seed in range(first, first + seeds):
        for part in (clean, others, constant_speed, deleted, families, lengths):
            cases.extend(part(seed))
        for times in (10.0, 3.0):
            cases.extend(singles(seed, times))
    return cases


def quick() -> list[Case]:
    """A handful of every kind, for a first look."""
    wanted = [case for case in full(1) if case.group != "1 h at 10 Hz"]
    seen: dict[str, int] = {}
    chosen = []
    for case in wanted:
        seen[case.group] = seen.get(case.group, 0) + 1
        if seen[case.group] <= 4:
            chosen.append(case)
    return chosen
