"""The figures of the residuals: their data against plain sums, their sentences against the data."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.diagnosis import remainder_plots
from syncline_design.diagnosis.plotted import (
    Arrow,
    AxisResiduals,
    NormalPlot,
    Plots,
    PlottedTrack,
    Residuals,
    Spectrum,
)
from syncline_design.diagnosis.remainder_plots import _powers, normal_of, spectrum_of, track_of
from syncline_design.report import charts_residuals as drawings
from syncline_design.report.document import Chart
from syncline_design.report.on_residuals import residual_nodes

Array = NDArray[np.float64]
RATE_HZ, ROWS = 10.0, 1200


def log_of(time_s: Array, place: Array | None = None) -> Any:
    rows = (SimpleNamespace(position_m=place),)
    return SimpleNamespace(view=SimpleNamespace(log=SimpleNamespace(time_s=time_s), rows=rows))


@pytest.fixture
def whitened(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Puts a series in the place of the whitened remainder."""

    def put(series: Array) -> None:
        monkeypatch.setattr(remainder_plots, "_white", lambda *_: series)

    return put


def test_the_spectrum_of_even_stamps_is_the_periodogram(whitened: Any) -> None:
    rng = np.random.default_rng(1)
    series = rng.standard_normal((ROWS, 3))
    time_s = np.arange(ROWS) * (ROWS / (ROWS - 1)) / RATE_HZ  # so that its waves are the FFT's
    whitened(series)
    found = spectrum_of(log_of(time_s), None)  # type: ignore[arg-type]
    assert found is not None
    first = np.exp(-2j * np.pi * np.arange(ROWS) / (ROWS - 1))  # one cycle between the ends
    centred = series - series.mean(axis=0)
    assert found.power[0] == pytest.approx(np.mean(np.abs(first @ centred) ** 2) / ROWS, rel=1e-5)
    assert np.mean(found.power[-10:]) == pytest.approx(1.0, abs=0.05)
    assert all(p < m for p, m in zip(found.power, found.most, strict=True))


def test_a_wave_stands_out_at_its_period_and_the_caption_says_so(whitened: Any) -> None:
    rng = np.random.default_rng(2)
    time_s = np.arange(ROWS) / RATE_HZ
    wave = np.sin(2.0 * np.pi * 0.5 * time_s)[:, None]
    whitened(rng.standard_normal((ROWS, 3)) + wave)
    found = spectrum_of(log_of(time_s), None)  # type: ignore[arg-type]
    assert found is not None
    over = [f for f, p, m in zip(found.frequency_hz, found.power, found.most, strict=True) if p > m]
    assert over
    assert min(abs(f - 0.5) for f in over) < 0.04
    caption = next(c for c in charts(spectrum=found) if c.name == "spectrum").caption
    period_s = float(caption.split("a period of ")[1].split("\N{NO-BREAK SPACE}")[0].split(" ")[0])
    assert period_s == pytest.approx(2.0, rel=0.1)


def test_tails_show_in_the_normal_plot(whitened: Any) -> None:
    rng = np.random.default_rng(3)
    captions = []
    for series in (rng.standard_normal((40_000, 3)), rng.standard_t(4, (40_000, 3))):
        whitened(series)
        found = normal_of(None, None)  # type: ignore[arg-type]
        middle = len(found.normal) // 2
        assert found.normal[middle] == 0.0
        assert found.remainder[middle] == pytest.approx(np.median(series), abs=1e-4)
        captions.append(next(c for c in charts(normal=found) if c.name == "normal").caption)
    assert captions[0].endswith("It keeps to it out to its ends.")
    assert captions[1].endswith("tails, or outliers.")


def test_an_arrow_is_the_mean_of_its_stretch() -> None:
    rng = np.random.default_rng(4)
    place, before = rng.standard_normal((2, 600, 3))
    after = 0.1 * before
    index = np.arange(0, 600, 3).astype(float)
    found = track_of(log_of(np.arange(600.0), place), before, after, index)
    one = found.arrows[7]  # rows 70 to 79
    assert one.north_m == pytest.approx(np.mean(place[70:80, 0]), rel=1e-5)
    assert one.before_east_m == pytest.approx(np.mean(before[70:80, 1]), rel=1e-5)
    assert one.after_north_m == pytest.approx(0.1 * one.before_north_m, rel=1e-5)
    assert found.north_m == pytest.approx(tuple(place[::3, 0]), rel=1e-5)
    longest = max(np.hypot(a.before_north_m, a.before_east_m) for a in found.arrows)
    assert drawings.longest_m(found) == pytest.approx((longest, 0.1 * longest), rel=1e-4)


def charts(**parts: Any) -> list[Chart]:
    none = Plots(Residuals((), {}), (), ())
    fields = {name: getattr(none, name) for name in Plots.__slots__} | parts
    return [node for node in residual_nodes(Plots(**fields)) if isinstance(node, Chart)]


def test_the_caption_names_what_the_residuals_changed_with_and_every_figure_draws() -> None:
    time_s = np.linspace(0.0, 100.0, 240)
    speed = 5.0 + 4.0 * np.sin(time_s)
    still, even = tuple(0.0 * speed), tuple(0.0 * speed + 0.02)
    axes = {
        "north": AxisResiduals(tuple(0.1 * speed), even, still, even),
        "east": AxisResiduals(still, still, still, even),
    }
    arrows = tuple(Arrow(k, 2.0 * k, 0.3, 0.1, 0.01, 0.0) for k in range(8))
    found = charts(
        residuals=Residuals(tuple(time_s), axes),
        motion={"speed": tuple(speed), "range": tuple(0.0 * speed + 30.0)},
        track=PlottedTrack((0.0, 7.0), (0.0, 14.0), arrows),
        spectrum=Spectrum((0.1, 1.0), (1.0, 1.1), (2.0, 1.5)),
        normal=NormalPlot((-2.0, 0.0, 2.0), (-2.0, 0.0, 2.0)),
    )
    assert [c.name for c in found] == ["residuals", "track", "spectrum", "against", "normal"]
    captions = {c.name: c.caption for c in found}
    assert "changes most with the speed" in captions["against"]
    assert "it is even" in captions["against"]
    assert "at most 316 mm before and 10 mm after" in captions["track"].replace("\xa0", " ")
    for one in found:
        drawn = one.draw()
        assert "<svg" in drawn.svg
    middles = drawings.binned(tuple(speed), tuple(0.1 * speed))
    assert all(size == pytest.approx(0.1 * middle, rel=0.02) for middle, size in middles)


def test_the_powers_of_a_spectrum_are_those_of_every_frequency_by_itself() -> None:
    """At uneven stamps, 300 frequencies: more than are taken at once."""
    rng = np.random.default_rng(6)
    share, series = np.sort(rng.uniform(0.0, 1.0, 700)), rng.standard_normal((700, 2))
    wanted = [
        np.mean(np.abs(np.sum(np.exp(2j * np.pi * k * share)[:, None] * series, axis=0)) ** 2) / 700
        for k in range(1, 301)
    ]
    np.testing.assert_allclose(_powers(share, series, 300), wanted, rtol=1e-9)
