"""Known effects on a later stage: what the simulation shows is charged, or the effect is refused.

Oracle: a chain without clocks, noise or arms worth a millimetre is exact, so that whatever its
simulated error exceeds a centimetre by is the effect's, and the Syncline must have charged it.
A transponder that stands off by dl is found off by |dl|: the next stage starts from its place.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from syncline_design.effects import registry
from syncline_design.spec.load import BadInput
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

STAGE = """\
  - name: {name}
    platform: {{v_max: 4 m/s, omega_max: 0.3 rad/s, distance: 40 m, baseline: 1 mm}}
{position}    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.1 urad, primitives: []}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}, timeline: utc}}
    ranging:
      sensor: {{modality: ranging, type: usbl, sigma_range: 0.1 mm, sigma_bearing: 0.1 urad,
               primitives: []}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}, timeline: utc}}
"""
POSITION = """\
    position:
      sensor: {modality: position, sigma_position: 0.1 mm, primitives: []}
      timestamping: {error: {distribution: constant, value: 0 s}, timeline: utc}
      lever_arm: [0 m, 0 m, 0 m]
"""
TRANSPONDER = "    position: {lever_arm: [0 m, 0 m, 0 m]}\n"
VALUES = {
    "latency": "latency_s: 0.1",
    "clock_drift": "rate: 4.0e-5",
    "timestamp_step": "step_s: 0.2, time_s: 600",
    "integer_second_slip": "seconds: 2",
    "timestamp_jitter": "std_s: 0.1",
    "packetised_timestamps": "interval_s: 0.2",
    "filter_lag": "time_constant_s: 0.3",
    "lever_arm": "x_m: 1, y_m: -2, z_m: 0.5",
    "noise_understated": "factor: 5000",
    "noise_episode": "factor: 5000, from_s: 10, to_s: 20",
    "squat": "sinkage_m: 0.1",
    "tide": "rate_mps: 0.001",
    "correlated_noise": "std_m: 0.5, time_constant_s: 60",
    "height_drift": "std_m: 0.5, time_constant_s: 60",
    "heavy_tails": "degrees_of_freedom: 3, outlier_rate: 0.1",
    "induced_heave": "x_m: 3, y_m: -2, z_m: 1",
    "frame_convention": "convention: enu",
}


def chain(folder: Path, transponder: str, effect: str) -> Path:
    path = folder / "chain.yaml"
    path.write_text(
        "syncline: 1\nname: chain\n"
        "requirements:\n"
        "  - {id: A, kind: accuracy, limit: 10 km}\n  - {id: S, kind: sync, limit: 1.0e+12}\n"
        "monte_carlo: {samples: 2000}\nstages:\n"
        + STAGE.format(name="boat", position=POSITION)
        + STAGE.format(name="fish", position=transponder)
        + f"effects:\n  - {{effect: {effect}, sensor: position, stage: fish, "
        f"parameters: {{{VALUES[effect]}}}}}\n"
    )
    return path


def test_every_effect_of_a_position_is_tried() -> None:
    assert set(VALUES) == {n for n, one in registry().items() if "position" in one.sensors}


@pytest.mark.parametrize("transponder", [TRANSPONDER, ""])
@pytest.mark.parametrize("effect", sorted(set(VALUES) - {"lever_arm"}))
def test_a_transponder_has_neither_stamps_nor_noise_that_an_effect_could_change(
    tmp_path: Path, effect: str, transponder: str
) -> None:
    """A latency of 0.1 s was simulated as 0.4 m and charged with nothing: MEETS at 6 mm."""
    with pytest.raises(BadInput, match="stage fish has no position sensor") as refused:
        check_file(chain(tmp_path, transponder, effect), CheckSettings(monte_carlo=False))
    (problem,) = refused.value.problems
    assert "lever_arm (of the transponder), sensor: ranging with stage: boat" in problem.expected


@pytest.mark.parametrize("transponder", [TRANSPONDER, ""])
def test_a_transponder_that_stands_off_is_charged_and_simulated(
    tmp_path: Path, transponder: str
) -> None:
    """It was refused where the spec gave the transponder no arm."""
    verdict = check_file(chain(tmp_path, transponder, "lever_arm"), CheckSettings()).to_json()
    off = math.sqrt(1.0 + 4.0 + 0.25)
    assert verdict["monte_carlo"]["quantiles"]["0.5"]["value_m"] == pytest.approx(off, abs=2e-3)
    assert verdict["syncline"]["total_m"] == pytest.approx(off, abs=2e-3)
