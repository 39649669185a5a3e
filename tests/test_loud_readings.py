"""Which readings of which sensor are too loud: bearings are not taken for an attitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from syncline_design.diagnosis.loud_readings import ReadingsNoise, _swept, fitted, loud_readings
from syncline_design.diagnosis.noise_split import factors
from syncline_design.diagnosis.unlike_readings import unlike_readings
from tests.test_accept_stretches import settled, world
from tests.world import make_log

Array = NDArray[np.float64]
ATTITUDE, RANGING, POSITION = (("boat", role) for role in ("attitude", "ranging", "position"))
ROWS = 500
FIXED = 1e-8 * np.eye(3)


def slopes(rows: int, seed: int) -> dict[tuple[str, str], Array]:
    """A level vehicle that looks about at 10 to 30 m: what a deviation of each reading does [m]."""
    rng = np.random.default_rng(seed)
    az, r = rng.uniform(-np.pi, np.pi, rows), rng.uniform(10.0, 30.0, rows)
    zero, along = np.zeros(rows), np.stack([np.cos(az), np.sin(az)])
    across = np.stack([-np.sin(az), np.cos(az), zero], axis=1) * r[:, None]
    up = np.stack([zero, zero, -r], axis=1)
    roll, pitch = (np.stack([zero, zero, r * part], axis=1) for part in (along[1], -along[0]))
    out = np.stack([*along, zero], axis=1)
    return {
        POSITION: 0.02 * np.broadcast_to(np.eye(3), (rows, 3, 3)),
        ATTITUDE: np.stack([0.001 * roll, 0.001 * pitch, 0.002 * across], axis=-1),
        RANGING: np.stack([0.03 * out, 0.002 * across, 0.002 * up], axis=-1),
    }


def drawn(
    own: dict[tuple[str, str], Array], times: dict[tuple[str, str], Array], seed: int
) -> Array:
    rng = np.random.default_rng(seed)
    made = [
        np.einsum("nik,nk->ni", s, times.get(key, np.ones(3)) * rng.standard_normal(s.shape[::2]))
        for key, s in own.items()
    ]
    return np.asarray(np.sum(made, axis=0))


@pytest.mark.parametrize(
    ("sensor", "times"),
    [(RANGING, (1.0, 2.5, 2.5)), (RANGING, (3.0, 1.0, 1.0)), (ATTITUDE, (1.0, 1.0, 3.0))],
)
def test_readings_that_are_loud_are_found_in_their_sensor(
    sensor: tuple[str, str], times: tuple[float, float, float]
) -> None:
    """Yaw and azimuth, roll or pitch and elevation move a point alike; sizes tell them apart."""
    own = slopes(ROWS, 3)
    error = drawn(own, {sensor: np.array(times)}, 4)
    (one,) = loud_readings(error, own, np.broadcast_to(FIXED, (ROWS, 3, 3)))
    assert one.sensor == sensor
    loud = [k for k in range(3) if times[k] > 1.0]
    assert [one.times[k] for k in loud] == pytest.approx([times[k] for k in loud], rel=0.12)
    assert all(one.times[k] < 1.2 for k in range(3) if k not in loud)
    least = 1.0 / np.sqrt(2.0 * ROWS * len(loud))  # of a sample that nothing else scatters
    assert least < one.spread < 3.0 * least


@pytest.mark.parametrize("times", [2.5])
def test_sensors_as_specified_or_loud_as_a_whole_have_no_unlike_readings(times: float) -> None:
    own = slopes(ROWS, 5)
    error = drawn(own, {RANGING: np.full(3, times)}, 6)
    assert loud_readings(error, own, np.broadcast_to(FIXED, (ROWS, 3, 3))) == ()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_blocks_of_unlike_sizes_are_inverted_as_by_a_library(size: int) -> None:
    """Axes of a millimetre beside those of a kilometre: what they have in common is what counts."""
    rng = np.random.default_rng(11)
    turned = np.linalg.qr(rng.standard_normal((200, size, size)))[0]
    alike = (turned * rng.uniform(0.1, 1.0, (200, 1, size))) @ np.swapaxes(turned, 1, 2)
    scale = 10.0 ** rng.uniform(-3.0, 3.0, (200, size, 1))
    blocks = scale * alike * np.swapaxes(scale, 1, 2)
    inverse, logs = _swept(np.ascontiguousarray(np.moveaxis(blocks, 0, 2)))
    found = scale * np.moveaxis(inverse, 2, 0) * np.swapaxes(scale, 1, 2)
    assert found == pytest.approx(np.linalg.inv(alike), abs=1e-11)
    sizes = np.linalg.slogdet(alike)[1] + 2.0 * np.sum(np.log(scale), axis=(1, 2))
    assert logs == pytest.approx(sizes, abs=1e-11)


def test_the_fit_is_the_one_of_largest_likelihood() -> None:
    """By the density of a library, minimised without slopes."""
    own = slopes(40, 7)
    error = drawn(own, {RANGING: np.array((1.0, 2.0, 2.0))}, 8)
    parts = [
        ReadingsNoise(key, (0, 1, 2), s @ np.swapaxes(s, 1, 2), True) for key, s in own.items()
    ]
    found = fitted(error, parts, np.broadcast_to(FIXED, (40, 3, 3)))

    def cost(logs: Array) -> float:
        sizes = np.exp(2.0 * logs)
        each = FIXED + sum(v * one.squares for v, one in zip(sizes, parts, strict=True))
        return -sum(
            float(multivariate_normal.logpdf(e, cov=c)) for e, c in zip(error, each, strict=True)
        )

    plain = minimize(cost, np.log(found.times) + 0.02, method="Nelder-Mead",
                     options={"maxiter": 60})  # fmt: skip
    assert cost(np.log(found.times)) <= float(plain.fun) + 1e-3
    constant = 0.5 * 120 * np.log(2.0 * np.pi)
    assert found.cost == pytest.approx(cost(np.log(found.times)) - constant, rel=1e-6)


def test_a_log_with_noisy_bearings_has_them_in_the_ranging_sensor(tmp_path: Path) -> None:
    """A flight whose azimuths and elevations are scattered anew, to 5 times what the spec says."""
    run = world("multirotor_lines", 31, 60.0, 4.0)
    log, rng = make_log(run), np.random.default_rng(9)
    sigma = np.degrees(np.array(run.carriers[-1].sensors.ranging)[1])
    for name in ("azimuth_deg", "elevation_deg"):
        column = log.columns[name]
        log.columns[name] = column + np.sqrt(24.0) * sigma * rng.standard_normal(column.shape)
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), "utf-8")
    data, model, _ = settled(spec, log.to_csv(tmp_path / "log.csv"))
    (one,) = unlike_readings(data, model)
    assert one.sensor[1] == "ranging"
    assert one.of_each["range"] == 1.0
    split = factors(data, model, (one,))
    by_role = {name.split("/")[1]: own for name, own in split.items()}
    loudest = by_role["ranging"].loudest
    assert loudest.readings == ("azimuth", "elevation")
    assert loudest.low < 5.0 < loudest.high
    assert by_role["attitude"].loudest.low < 1.0
