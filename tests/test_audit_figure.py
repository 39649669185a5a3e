"""Names of faults in the figure of receipts: they hide no trace and stay in the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit
from syncline_design.report import charts_audit


def _slipped(folder: Path, first: int, last: int) -> StreamAudit:
    """40 s at 10 Hz; rows first to last are stamped a second ahead."""
    at = np.arange(400)
    stamps = 1_700_000_000.0 + 0.1 * at + ((at >= first) & (at < last))
    rows = [f"{s:.6f},{1_700_000_000.001 + 0.1 * k:.6f}" for k, s in zip(at, stamps, strict=True)]
    path = folder / "gnss.csv"
    path.write_text("stamp_s,receive_s\n" + "\n".join(rows) + "\n", "utf-8")
    return audit([path]).streams[0]


@pytest.mark.parametrize(("first", "last"), [(100, 180), (20, 100), (300, 380), (350, 395)])
def test_the_name_of_a_fault_hides_no_trace_and_stays_inside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: int, last: int
) -> None:
    monkeypatch.setattr(charts_audit, "tell", lambda *_: None)  # tooltips are of a page
    row = _slipped(tmp_path, first, last)
    assert [f.fault for f in row.faults] == ["whole_second_slip"]
    figure = Figure(figsize=(5.2, 1.2), dpi=100)
    renderer = FigureCanvasAgg(figure).get_renderer()
    axes = figure.add_subplot()
    charts_audit._trace(axes, row)
    axes.set_xlim(row.trace[0].time_s, row.trace[-1].time_s)
    charts_audit._faults(axes, row)
    (name,) = (text for text in axes.texts if text.get_text() == "whole_second_slip")
    place = name.get_window_extent(renderer)
    assert axes.get_window_extent(renderer).x1 >= place.x1
    drawn = [
        axes.transData.transform((p.time_s, v)) for p in row.trace for v in (p.low_s, p.high_s)
    ]
    assert not any(_within(place, x, y) for x, y in drawn)


def _within(box: Bbox, x: float, y: float) -> bool:
    return bool(box.x0 < x < box.x1 and box.y0 < y < box.y1)
