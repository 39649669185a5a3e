"""One contract over all effects, whatever they are."""

from __future__ import annotations

import ast
import dataclasses
import re
import string
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import syncline_design.effects as effects_package
from syncline_design.comparison.meaning import meaning
from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.effects import NOT_EFFECTS, registry
from syncline_design.effects.kinematics import euler_to_rotation, rotation_to_euler
from syncline_design.effects.record import (
    SELDOM,
    ActsOn,
    Basis,
    Departures,
    Effect,
    StageRows,
)
from syncline_design.model.system import Platform, Sensor, Stage
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.chain import ConstantTwist, stage_error
from syncline_design.spec.edit import with_effects_text
from syncline_design.spec.load import load
from tests.simulation_systems import no_noise
from tests.world import hidden, make_log, scenario

Array = NDArray[np.float64]
PAIRS = [(e, s) for e in registry().values() for s in e.sensors]
IDS = [f"{effect.name}-{sensor}" for effect, sensor in PAIRS]
OWN = ("factor", "tails", "episode")  # they change a sensor's own noise
ROWS = 60
MARGIN = 2e-3  # of the largest slope: what second-order terms leave at the small step taken


def rows() -> StageRows:
    rng = np.random.default_rng(7)
    euler = rng.uniform([-0.6, -0.6, -3.0], [0.6, 0.6, 3.0], (ROWS, 3))
    rotation = euler_to_rotation(euler)
    azimuth, elevation = rng.uniform(-3, 3, ROWS), rng.uniform(-1.2, 1.2, ROWS)
    distance = rng.uniform(5.0, 60.0, ROWS)
    cos_el = np.cos(elevation)
    pointing = np.stack([np.cos(azimuth) * cos_el, np.sin(azimuth) * cos_el, -np.sin(elevation)], 1)
    position = rng.uniform(-300, 300, (ROWS, 3))
    arm = np.array([-0.4, 0.1, 0.6])
    body = arm + distance[:, None] * pointing
    return StageRows(
        time_s=np.arange(ROWS) * 0.1,
        position_m=position,
        rotation=rotation,
        euler_rad=rotation_to_euler(rotation),
        velocity_mps=rng.uniform(-10, 10, (ROWS, 3)),
        acceleration_mps2=rng.uniform(-3, 3, (ROWS, 3)),
        rate_radps=rng.uniform(-1, 1, (ROWS, 3)),
        range_m=distance,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        antenna_m=np.array([0.3, -0.2, -1.0]),
        ranging_m=arm,
        target_m=position + np.einsum("nij,nj->ni", rotation, body),
    )


def stage(ranging_type: str = "usbl") -> Stage:
    return Stage(
        name="vessel",
        vehicle="vessel",
        platform=Platform(5.0, 0.5, 40.0, 1.0),
        position=Sensor("gnss", "position", (0.01, 0.01, 0.02), NO_ERROR),
        attitude=Sensor("ins", "attitude", (1e-3, 1e-3, 2e-3), NO_ERROR),
        ranging=Sensor("r", "ranging", (0.02, 1e-3, 1e-3), NO_ERROR, type=ranging_type),
    )


def values_of(effect: Effect, sensor: ActsOn, size: float = 0.0) -> dict[str, float]:
    """Every continuous parameter `size` of its plausible least, located ones in the middle."""
    values: dict[str, float] = {}
    for p in effect.parameters:
        if p.choices:
            values[p.name] = p.choices[sensor][0]  # type: ignore[assignment]
        else:
            values[p.name] = 3.0 if p.located else size * max(p.low, 1e-6)
    return values


def error_of(state: StageRows, departures: Departures) -> Array:
    motion = ConstantTwist(state.rotation, state.velocity_mps, state.rate_radps)
    return stage_error(state, motion, no_noise(len(state)), departures)


def test_every_file_of_the_folder_is_one_effect_of_its_name() -> None:
    folder = Path(next(iter(effects_package.__path__)))
    files = {p.stem for p in folder.glob("*.py")} - NOT_EFFECTS - {"__init__"}
    assert files == set(registry())
    assert len(files) == 36  # the rows of the dictionary, a name per row or more


def test_the_dictionary_has_a_row_for_every_effect() -> None:
    """Its name, what it acts on and its parameters, read from the page and from the folder."""
    root = Path(__file__).parent.parent
    page = (root / "docs" / "effects.md").read_text("utf-8").partition("## The dictionary")[2]
    rows = re.findall(r"^\| `(\w+)` \|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|$", page, re.M)
    assert [name for name, *_ in rows] == sorted(registry()), "python docs/make_effects.py"
    for name, acts_on, parameters, says, apart in rows:
        effect = registry()[name]
        assert re.findall(r"\w+", acts_on) == list(effect.sensors)
        assert re.findall(r"`(\w+)`", parameters) == [one.name for one in effect.parameters]
        assert says.strip(), name
        assert apart.strip() == effect.separated_by.strip()


def test_what_a_first_drive_is_asked_for_acts_there() -> None:
    asked = {one.name: one.commissioned for one in registry().values() if one.commissioned}
    assert asked == {  # what a surveyor checks first: clocks, antenna, mount, zero of the range
        "latency": ("position", "attitude"),
        "lever_arm": ("position",),
        "boresight": ("ranging",),
        "range_bias": ("ranging",),
    }
    assert all(set(asked[name]) <= set(registry()[name].sensors) for name in asked)


SUFFIXES = {"_mps2": "m/s^2", "_radps": "rad/s", "_mps": "m/s", "_rad": "rad", "_m": "m", "_s": "s"}
WORDED = {"integer_second_slip.seconds"}  # a count, read without a unit


@pytest.mark.parametrize("effect", registry().values(), ids=registry())
def test_the_name_of_a_parameter_says_its_unit(effect: Effect) -> None:
    """A spec's text is read by the name, a sentence printed by the unit: they must be one."""
    for one in effect.parameters:
        said = next((unit for end, unit in SUFFIXES.items() if one.name.endswith(end)), "")
        if f"{effect.name}.{one.name}" not in WORDED and (said or one.unit in SUFFIXES.values()):
            assert one.unit == said, one.name


@pytest.mark.parametrize(("effect", "sensor"), PAIRS, ids=IDS)
def test_sensitivity_is_the_slope_of_the_exact_term(effect: Effect, sensor: ActsOn) -> None:
    if effect.sensitivity is None:
        assert effect.kind != "deterministic"
        return
    state, base = rows(), values_of(effect, sensor)
    analytic = effect.sensitivity(state, base, sensor)
    assert analytic.shape == (ROWS, 3, len(effect.slopes()))
    scale = np.abs(analytic).max()
    assert scale > 0
    for k, parameter in enumerate(effect.slopes()):
        step = 1e-6
        ends = []
        for sign in (1.0, -1.0):
            values = {**base, parameter.name: base[parameter.name] + sign * step}
            ends.append(error_of(state, effect.depart(state, values, sensor, None)))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(slope - analytic[:, :, k]).max() <= MARGIN * scale


@pytest.mark.parametrize(("effect", "sensor"), PAIRS, ids=IDS)
def test_nothing_departs_at_zero(effect: Effect, sensor: ActsOn) -> None:
    if effect.kind == "discrete" or effect.opens in OWN:
        return  # a convention has no zero; a factor's neutral value is 1, tails' is infinity
    state = rows()
    values = dict(values_of(effect, sensor))
    if effect.kind == "stochastic":
        values["time_constant_s"] = 1.0
    departed = effect.depart(state, values, sensor, np.random.default_rng(1))
    assert np.abs(error_of(state, departed)).max() < 1e-9


@pytest.mark.parametrize(("effect", "sensor"), PAIRS, ids=IDS)
def test_it_says_what_people_need(effect: Effect, sensor: ActsOn) -> None:
    for text in (effect.sentence, effect.confused_with, effect.separated_by, effect.source):
        assert text.strip()
    named = {field for _, field, _, _ in string.Formatter().parse(effect.sentence) if field}
    assert named - {"sensor"} <= {p.name for p in effect.parameters}
    for p in effect.parameters:
        assert p.low <= p.high


@pytest.mark.parametrize(("effect", "sensor"), PAIRS, ids=IDS)
def test_it_adds_to_the_budget(effect: Effect, sensor: ActsOn) -> None:
    basis = Basis(distance_m=50.0, arm_m=3.0)
    small, large = (
        effect.contribute(
            stage(), values_of(effect, sensor, size) | neutral(effect, size), sensor, basis
        )
        for size in (2.0, 4.0)
    )
    assert large.tau_s >= small.tau_s >= 0
    assert large.total_m(basis) >= small.total_m(basis) >= 0
    assert (small.tau_s > 0) != (small.total_m(basis) > 0)


def neutral(effect: Effect, size: float) -> dict[str, float]:
    if effect.name == "heavy_tails":
        return {"degrees_of_freedom": 12.0 / size, "outlier_rate": 0.01 * size}
    return {}


STOCHASTIC = [(e, s) for e, s in PAIRS if e.kind == "stochastic" and e.opens not in OWN]


@pytest.mark.parametrize(("effect", "sensor"), STOCHASTIC, ids=lambda x: getattr(x, "name", x))
def test_what_is_drawn_has_the_stated_variance(effect: Effect, sensor: ActsOn) -> None:
    """400 draws: every diagonal entry within 5 of its standard errors (2/400)^0.5 = 7 %.

    180 entries at 5 sigma: a true covariance fails one run in 10 000 (chi-square's skew included).
    """
    state, rng, draws = rows(), np.random.default_rng(3), 400
    values = {"std_s": 1e-4, "interval_s": 1e-4, "std_m": 0.1, "time_constant_s": 2.0}
    kept = {p.name: values[p.name] for p in effect.parameters}
    sample = np.stack(
        [error_of(state, effect.depart(state, kept, sensor, rng)) for _ in range(draws)]
    )
    if effect.spread is not None:
        expected = (effect.spread(state, kept, sensor) ** 2).sum(axis=2)
    else:  # a process of std_m on each axis
        axes = {"slow": (1.0, 1.0, 1.0), "down": (0.0, 0.0, 1.0)}
        expected = np.broadcast_to(np.square(axes[effect.opens]) * kept["std_m"] ** 2, (ROWS, 3))
    measured = sample.var(axis=0)
    assert np.all(np.abs(measured - expected) <= 5 * (2 / draws) ** 0.5 * expected + 1e-15)


def test_understated_noise_scales_the_draw() -> None:
    state = rows()
    rng = np.random.default_rng(5)
    noise = dataclasses.replace(no_noise(ROWS), position_m=rng.standard_normal((ROWS, 3)))
    motion = ConstantTwist(state.rotation, state.velocity_mps, state.rate_radps)
    depart = registry()["noise_understated"].depart(state, {"factor": 3.0}, "position", rng)
    once, scaled = (stage_error(state, motion, noise, d) for d in (Departures(), depart))
    assert scaled == pytest.approx(3.0 * once, abs=1e-9)


def test_gross_conventions_are_their_own_inverse_where_they_should_be() -> None:
    """A transposed attitude read as a rotation is the transpose, exactly."""
    state = rows()
    effect = registry()["frame_convention"]
    depart = effect.depart(state, {"convention": "transposed"}, "attitude", None)  # type: ignore[dict-item]
    held = euler_to_rotation(state.euler_rad + depart.attitude_euler_rad)
    assert held == pytest.approx(np.swapaxes(state.rotation, 1, 2), abs=1e-12)


def test_acoustic_effects_ask_for_acoustic_sensors() -> None:
    applies = {name: registry()[name].applies for name in ("sound_speed", "turnaround_delay")}
    assert all(a(stage("usbl"), "ranging") for a in applies.values())
    assert applies["sound_speed"](stage("mbes"), "ranging")
    assert not applies["turnaround_delay"](stage("mbes"), "ranging")
    assert not any(a(stage("lidar"), "ranging") for a in applies.values())


# Figures that each opening fits.
OPENED = {"factor": 1, "slow": 2, "down": 2, "size": 1, "tails": 2, "episode": 3}


@pytest.mark.parametrize("effect", registry().values(), ids=registry())
def test_the_record_holds_what_a_diagnosis_needs(effect: Effect) -> None:
    """What a stochastic effect sets free is what its covariance is; a discrete one is undone."""
    assert (effect.opens != "") == (effect.kind == "stochastic")
    assert (effect.undoing is not None) == (effect.kind == "discrete")
    assert 0 < effect.rarity <= SELDOM
    if effect.opens:
        assert len(effect.parameters) == OPENED[effect.opens]
    assert (effect.spread is not None) == (effect.opens == "size")


def test_no_two_effects_are_equally_common() -> None:
    known = [e.rarity for e in registry().values() if e.rarity != SELDOM]
    assert len(known) == len(set(known)) >= 14


DISCRETE = [e for e in registry().values() if e.undoing is not None]


@pytest.mark.parametrize("effect", DISCRETE, ids=lambda e: e.name)
def test_what_is_undone_is_what_departed(effect: Effect) -> None:
    """Columns that depart by the effect are the true ones again; angles but for whole turns."""
    assert effect.undoing is not None
    (parameter,) = effect.parameters
    assert set(effect.undoing.tried) == set(effect.sensors)
    assert effect.undoing.instead_of in {"", *registry()}
    if effect.undoing.mend is None:
        assert effect.sensors == ("position",)  # stamps of other sensors are not paired anew
        assert all(abs(float(v)) <= parameter.high for v in effect.undoing.tried["position"])
        return
    state = rows()
    antenna = np.einsum("nij,j->ni", state.rotation, state.antenna_m)
    true = {
        "position": state.position_m + antenna,
        "attitude": state.euler_rad,
        "ranging": np.stack([state.azimuth_rad, state.elevation_rad], axis=-1),
    }
    for sensor, values in effect.undoing.tried.items():
        assert values == parameter.choices[sensor]
        for value in values:
            gone = effect.depart(state, {parameter.name: value}, sensor, None)  # type: ignore[dict-item]
            bearing = np.stack(np.broadcast_arrays(gone.azimuth_rad, gone.elevation_rad), axis=-1)
            shifts = {
                "position": gone.position_m, "attitude": gone.attitude_euler_rad,
                "ranging": bearing,
            }  # fmt: skip
            found = effect.undoing.mend(true[sensor] + shifts[sensor], sensor, str(value))
            off = found - true[sensor]
            if sensor != "position":
                off = np.angle(np.exp(1j * off))
            assert np.abs(off).max() < 1e-9, (sensor, value)


# Words of the model, of the paper and of the spec that are an effect's name as well.
OTHER_MEANING = {"lever_arm", "sound_speed"}
# Names of assumptions on a built system, which effects break.
ASSUMPTIONS = {"latency", "mounting"}
SPEAK_OF_ASSUMPTIONS = {
    "acceptance.py", "assumptions.py", "by_log.py", "by_scatter.py", "by_shift.py", "instead.py",
    "knocks.py", "log_evidence.py", "mean_turn.py", "sarif.py", "stretches.py", "suspects.py",
    "undone.py", "whole_delay.py",
}  # fmt: skip


def test_no_other_file_names_an_effect() -> None:
    """What others need of an effect is in its record: adding one touches its file alone."""
    package = Path(next(iter(effects_package.__path__))).parent
    named = []
    for path in sorted(package.rglob("*.py")):
        if path.parent.name == "effects":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            said = node.value if isinstance(node, ast.Constant) else None
            spelt = re.fullmatch(r"(\w+)\([\w.]*\)", said) if isinstance(said, str) else None
            word = said if spelt is None else spelt[1]  # `latency(position)` names it too
            if word in registry():
                named.append((path.name, node.lineno, word))
            module = node.module if isinstance(node, ast.ImportFrom) else None
            if module and module.rpartition(".")[2] in registry():
                named.append((path.name, node.lineno, module))
    other = [
        entry
        for entry in named
        if entry[2] not in OTHER_MEANING
        and not (entry[0] in SPEAK_OF_ASSUMPTIONS and entry[2] in ASSUMPTIONS)
    ]
    assert other == []


@pytest.fixture
def twin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """One more effect: a file beside the others, and nothing else."""
    name = "late_report"
    own = Path(next(iter(effects_package.__path__))) / "latency.py"
    text = own.read_text(encoding="utf-8").replace('name="latency"', f'name="{name}"')
    (tmp_path / f"{name}.py").write_text(text.replace("latency_s", "age_s"), encoding="utf-8")
    monkeypatch.setattr(effects_package, "__path__", [*effects_package.__path__, str(tmp_path)])
    registry.cache_clear()
    yield name
    monkeypatch.undo()
    sys.modules.pop(f"{effects_package.__name__}.{name}", None)
    registry.cache_clear()


def test_a_new_effect_is_a_new_file(twin: str, tmp_path: Path) -> None:
    """It is read in a spec, charged, simulated, found in a log and written back."""
    log = make_log(
        scenario("multirotor_lines", 31, 60.0, 5.0), (hidden("latency", "position", latency_s=0.1),)
    )
    spec, data = tmp_path / "spec.yaml", log.to_csv(tmp_path / "log.csv")
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    others = tuple(name for name in registry() if name not in (twin, "lever_arm"))
    found = diagnose(spec, [data], DiagnosisSettings(exclude_effects=others))
    assert [f.effect for f in found.findings] == [twin]
    assert found.findings[0].parameters["age_s"].value == pytest.approx(0.1, abs=0.01)
    case, entries = load(spec), found.effects_entries()
    means = meaning(case, entries, seed=0)
    assert means is not None
    for figure in means.figures:
        assert (figure.after_m or 0.0) > 2.0 * (figure.before_m or 0.0), figure
    assert f"effect: {twin}" in with_effects_text(case, entries)


@pytest.mark.parametrize(
    ("value", "said"),
    [("30.05 ± 0.13 ms", "30.05 ± 0.13 ms older"), ("-30.05 ± 0.13 ms", "30.05 ± 0.13 ms younger")],
)
def test_data_are_older_or_younger_than_their_stamps_and_never_less_than_nothing(
    value: str, said: str
) -> None:
    words = registry()["latency"].in_words("position", {"latency_s": value})
    assert words == f"position data are {said} than their stamps"
