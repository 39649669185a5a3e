"""Noise that an effect borrows from the columns of motion, against its closed form.

A delay tau adds tau times the velocity's noise to the error, so it costs n tau^2 s^2 / (2 g^2) a
component in noise of g; a height of the antenna that is taken away takes the noise of roll and
pitch along.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.axes import still_axes_apart, varying_axes
from syncline_design.diagnosis.borrowed import borrowed_nats, doubt_nats, noisier_scenes
from syncline_design.diagnosis.cancelling import cancelling
from syncline_design.diagnosis.charges import UNUSUAL_NATS, Charge
from syncline_design.diagnosis.episodes import Episode, with_episodes
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.fitting import data_of, fit
from syncline_design.diagnosis.noise import as_specified, first_guess, precision, spec_bounds
from syncline_design.diagnosis.noise_fit import fit_noise
from syncline_design.diagnosis.scatter import unforetold
from syncline_design.diagnosis.scene import Scene, acting, scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.test_diagnose_planar import normal, scanned
from tests.test_long_memories import POSITION_M, SPEC, SPEED_MPS, vectors

ROWS = 900


def moving(folder: Path) -> Scene:
    """Positions against a reference, with noisy velocity columns."""
    rng, t = np.random.default_rng(2), 0.1 * np.arange(ROWS)
    place = np.stack([40 * np.sin(0.1 * t), 30 * np.cos(0.13 * t), np.sin(0.2 * t)], axis=1)
    speed = np.stack([4 * np.cos(0.1 * t), -3.9 * np.sin(0.13 * t), 0.2 * np.cos(0.2 * t)], axis=1)
    columns = {
        "time_s": t,
        **vectors("position", place + POSITION_M * rng.standard_normal((ROWS, 3)), "m"),
        **vectors("reference", place, "m"),
        **vectors("velocity", speed + SPEED_MPS * rng.standard_normal((ROWS, 3)), "mps"),
        "roll_deg": 0 * t, "pitch_deg": 0 * t, "yaw_deg": 30.0 + 0 * t,
    }  # fmt: skip
    (folder / "spec.yaml").write_text(SPEC.replace("ARM", "0"))
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(folder / "log.csv", table, "%.7f", ",", header=",".join(columns), comments="")
    inputs = measured(load(folder / "spec.yaml"), [folder / "log.csv"])
    return scene(inputs.system, inputs.log)


def test_a_delay_borrows_the_noise_of_velocities(tmp_path: Path) -> None:
    view = moving(tmp_path)
    structure = structure_of(view)
    known = precision(structure, as_specified(structure))
    delay_s = 0.5
    late = (acting("latency", "position", 0, {"latency_s": delay_s}),)
    found = borrowed_nats(
        noisier_scenes(view, np.random.default_rng(1)), late, view.error(late), known
    )
    # the sum over half a second of noise that is new every 0.1 s, between splines: 5 steps
    variance = SPEED_MPS**2 * delay_s * 0.1
    assert found == pytest.approx(0.5 * 3 * ROWS * variance / POSITION_M**2, rel=0.12)
    assert borrowed_nats((), late, view.error(late), known) == 0.0


def test_what_is_borrowed_counts_less_where_the_log_is_louder(tmp_path: Path) -> None:
    """Three times the noise over a third of the rows: each of these weighs a ninth."""
    view = moving(tmp_path)
    draws = noisier_scenes(view, np.random.default_rng(1))
    quiet = replace(data_of(view, structure_of(view)), noisier=draws)
    own = quiet.structure.white[0].sensor
    stretch = Episode(
        own, from_s=0.0, to_s=0.1 * (ROWS // 3) - 0.05, factor=3.0, spread=0.1, gain=9.0
    )
    data = with_episodes(quiet, (stretch,))
    delay_s = 0.5
    late = (acting("latency", "position", 0, {"latency_s": delay_s}),)
    level = replace(as_specified(data.structure), episodes=True)
    found = borrowed_nats(data.noisier, late, view.error(late), precision(data.structure, level))
    variance = SPEED_MPS**2 * delay_s * 0.1
    rows = ROWS * (2.0 / 3.0 + 1.0 / 27.0)
    assert found == pytest.approx(0.5 * 3 * rows * variance / POSITION_M**2, rel=0.12)


def test_doubt_is_two_deviations_of_the_cross_term() -> None:
    rng = np.random.default_rng(0)
    added = 0.3 * rng.standard_normal(400)  # whitened
    nats = 0.5 * float(added @ added)
    cross = rng.standard_normal((4000, 400)) @ added
    assert doubt_nats(nats, 0.0) == pytest.approx(2.0 * float(np.std(cross)), rel=0.05)
    charged = Charge(1, 4.0, nats, UNUSUAL_NATS)
    assert charged.nats == 4.0 - nats
    assert charged.prior == UNUSUAL_NATS
    assert charged.doubt(Charge(1, 1.0, 0.0, 0.0)) == doubt_nats(nats, 0.0)


def test_an_axis_that_never_varies_says_nothing_of_the_others_noise(tmp_path: Path) -> None:
    """Its zeros would be taken for a quiet position sensor."""
    spec, log = scanned(tmp_path, normal, 4, height_m=0.8)
    inputs = measured(load(spec), [log])
    view = scene(inputs.system, inputs.log)
    whole = structure_of(view)
    axes = varying_axes(view.error(), whole)
    assert axes == (0, 1)
    apart = still_axes_apart(whole, axes)
    assert still_axes_apart(whole, (0, 1, 2)) is whole
    error = view.error() - np.array([0.0, 0.0, 0.8])
    factors = []
    for structure in (whole, apart):
        level, _ = fit_noise(structure, error, spec_bounds(structure), first_guess(structure))
        factors.append(level.factor[0])
    assert factors[1] == pytest.approx(1.0, abs=0.06)
    assert factors[0] < 0.9
    total = np.einsum("nii->ni", sum(w.covariance for w in whole.white) + whole.fixed)
    kept = np.einsum("nii->ni", sum(w.covariance for w in apart.white) + apart.fixed)
    np.testing.assert_allclose(kept, total, rtol=1e-9)
    rows = np.arange(50)
    part = replace(apart, survey=None).rows(rows)
    assert part.fixed.shape[0] == 50


@pytest.mark.parametrize(
    ("height_m", "spread_m", "undone"),
    [(5.02, 1.0, True), (5.02, 0.1, False), (3.0, 1.0, False), (0.02, 1.0, False)],
)
def test_two_heights_that_undo_each_other_are_no_causes(
    height_m: float, spread_m: float, undone: bool, tmp_path: Path
) -> None:
    """On a level vehicle an arm of 5 m down and a reference 5 m down leave nothing.

    Unless each is known for itself, or they leave as much as they are, or both are within noise.
    """
    view = moving(tmp_path)
    data = data_of(view, structure_of(view))
    arm_m = min(5.0, height_m)
    causes = (
        acting("lever_arm", "position", 0, {"x_m": 0.1, "y_m": 0.0, "z_m": arm_m}),
        acting("datum_offset", "target", 0, {"north_m": 0.0, "east_m": 0.0, "down_m": height_m}),
    )
    if not undone and height_m == 3.0:
        causes = (acting("lever_arm", "position", 0, {"x_m": 0, "y_m": 0, "z_m": 5.0}), causes[1])
    model = replace(fit(data), acting=causes)
    spreads = {one.label: np.full(3, spread_m) for one in causes}
    found = cancelling(data, model, spreads, POSITION_M * np.sqrt(3.0))
    first, second = (one.label for one in causes)
    assert found == ({first: second, second: first} if undone else {})


def test_the_noise_of_places_is_told_across_gaps_of_days() -> None:
    """Windows of a long log: three neighbours beyond a gap are in one place to all purposes."""
    rng = np.random.default_rng(2)
    time_s = np.concatenate([k * 1e6 + 0.1 * np.arange(500.0) for k in range(4)])
    place_m = np.sin(0.3 * time_s)[:, None] + 0.02 * rng.standard_normal((len(time_s), 1))
    assert unforetold(time_s, place_m) == pytest.approx(0.02, rel=0.1)
