"""`accept` on rows that are late at random or in bursts, in any share of a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.late_at_random import late_at_random
from syncline_design.diagnosis.late_rows import Late
from syncline_design.diagnosis.scene import scene
from syncline_design.diagnosis.system import measured
from syncline_design.diagnosis.whiles import gained_in_whiles
from syncline_design.spec.load import load
from tests.test_accept_late_rows import (
    Mask,
    accepted,
    broken_alone,
    during,
    here_and_there,
    mixed,
)
from tests.test_accept_stretches import world
from tests.world import Hidden, hidden, make_log
from tests.world.trajectory import Array
from tests.world.worldlog import write_columns

RUN = ("multirotor_lines", 9, 80.0, 8.0)


def in_bursts(share: float, seed: int, lasts_s: float = 2.0) -> Mask:
    """Whiles of exponential lengths, by turns late and not."""

    def rows(time_s: Array) -> Array:
        random, at_s, late = np.random.default_rng(seed), float(time_s[0]), False
        inside = np.zeros(len(time_s), bool)
        while at_s < time_s[-1]:
            until_s = at_s + random.exponential(2.0 * lasts_s * (share if late else 1.0 - share))
            inside[(time_s >= at_s) & (time_s < until_s)] = late
            at_s, late = until_s, not late
        return inside

    return rows


def looked_at(spec: Path, log: Path) -> tuple[Late, ...]:
    inputs = measured(load(spec), [log])
    view = scene(inputs.system, inputs.log, inputs.known)
    return late_at_random(view, np.zeros(len(view), bool))


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.9])
@pytest.mark.parametrize(
    ("device", "delay_s"), [("position", 0.05), ("attitude", 0.08), ("ranging", 0.05)]
)
@pytest.mark.parametrize("bursts", [False, True])
def test_any_share_of_rows_is_told_with_its_delay(
    share: float, device: str, delay_s: float, bursts: bool, tmp_path: Path
) -> None:
    rows = in_bursts(share, 5) if bursts else here_and_there(share, 5)
    (found,) = looked_at(*mixed(tmp_path, device, delay_s, rows, rates=False))
    assert found.sensor == device
    assert abs(found.delay_s - delay_s) < 3.0 * found.spread_s < 0.3 * delay_s
    time_s = make_log(world(*RUN)).columns["time_s"]
    assert found.of_log == pytest.approx(np.mean(rows(time_s - time_s[0])), abs=0.06)


@pytest.mark.parametrize(
    "what",
    [
        (),
        (hidden("latency", "position", latency_s=0.05),),
        (hidden("timestamp_jitter", "position", std_s=0.03),),
        (hidden("timestamp_step", "position", step_s=0.05, time_s=40.0),),
        (hidden("noise_understated", "position", factor=3.0),),
        (hidden("heavy_tails", "position", dof=3.0),),
    ],
)
def test_what_is_of_one_delay_or_of_any_is_not_two(
    what: tuple[Hidden, ...], tmp_path: Path
) -> None:
    made = make_log(world(*RUN), what)
    spec = tmp_path / "spec.yaml"
    spec.write_text(made.spec_yaml(), "utf-8")
    assert looked_at(spec, write_columns(tmp_path / "log.csv", made.columns)) == ()


def test_what_changed_once_does_not_take_turns(tmp_path: Path) -> None:
    """A turn of the attitude from half of the log on looks like a delay there, by its motion."""
    before, after = (
        make_log(world(*RUN), (hidden("mounting", "attitude", x_rad=0.0, y_rad=0.0, z_rad=z_rad),))
        for z_rad in (0.0, 0.02)
    )
    columns, half = dict(before.columns), len(before.columns["time_s"]) // 2
    for name in ("roll_deg", "pitch_deg", "yaw_deg"):
        columns[name] = np.r_[before.columns[name][:half], after.columns[name][half:]]
    spec = tmp_path / "spec.yaml"
    spec.write_text(before.spec_yaml(), "utf-8")
    assert looked_at(spec, write_columns(tmp_path / "log.csv", columns)) == ()


@pytest.mark.parametrize("delay_s", [0.004, 0.015])
def test_one_while_is_left_to_those_that_look_for_whiles(delay_s: float, tmp_path: Path) -> None:
    """Delays that move a row by little more than noise are not told row by row."""
    assert looked_at(*mixed(tmp_path, "position", delay_s, during(30.0, 48.0))) == ()


def test_gains_in_whiles_are_those_of_plain_enumeration() -> None:
    gain = np.random.default_rng(7).normal(0.0, 6.0, 14)
    ends = 2.0 * np.log(14)
    sums = {(a, b): float(np.sum(gain[a:b])) - ends for a in range(14) for b in range(a + 1, 15)}
    one = max(0.0, *sums.values())
    two = max(x + y for (_, b), x in sums.items() for (a, _), y in sums.items() if a >= b)
    assert gained_in_whiles(gain, 1) == pytest.approx(one)
    assert gained_in_whiles(gain, 2) == pytest.approx(max(one, two))


@pytest.mark.parametrize(("device", "delay_s"), [("position", 0.06), ("attitude", 0.1)])
def test_four_rows_of_ten_break_the_delay_that_acted_and_no_mean(
    device: str, delay_s: float, tmp_path: Path
) -> None:
    """A mean of 24 ms it was, beside stamps that scatter."""
    told = accepted(*mixed(tmp_path, device, delay_s, here_and_there(0.4, 3), rates=False))
    broken_alone(told, device, delay_s)
    (text,) = [row.evidence for row in told.assumptions if row.status == "broken"]
    assert "of the rows, here and there" in text
