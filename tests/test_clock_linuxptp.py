"""linuxptp: which of several clocks is meant, and what summary lines do not tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.entry import values_text
from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.spec.load import BadInput
from tests import clock_logs as made
from tests.clock_logs import START, write

SYSTEM_S, CARD_S, SCATTER_S = 1.2e-6, -3.6e-6, 5e-8


def _phc2sys(folder: Path, clocks: dict[str, float]) -> list[Path]:
    """Sessions of a phc2sys that steers these clocks, each early by so much."""
    paths = []
    for day in range(4):
        source = np.random.default_rng(day)
        lines = []
        for second in range(200):
            for k, (name, early_s) in enumerate(clocks.items()):
                time_s = START + 86400.0 * day + second + 0.1 * k
                line = made.phc2sys_line(time_s, -early_s + source.normal(0.0, SCATTER_S))
                lines.append(line.replace("CLOCK_REALTIME", name))
        paths.append(write(folder / f"day{day}.log", lines))
    return paths


def _first(study: TimingStudy) -> tuple[str, np.ndarray]:
    """The head of an entry's values, and the values."""
    head, _, *values = values_text(study, "clock").splitlines()
    return head, np.array([float(one) for one in values])


def test_of_several_clocks_that_phc2sys_steers_the_hosts_is_taken(tmp_path: Path) -> None:
    """Not the one with the largest offsets: that is another clock, and late instead of early."""
    paths = _phc2sys(tmp_path, {"eth1": CARD_S, "CLOCK_REALTIME": SYSTEM_S, "eth2": 2 * CARD_S})
    study = study_logs(paths, TimingSettings())
    assert study.timing.source.name == "phc2sys CLOCK_REALTIME"
    head, values = _first(study)
    assert head.startswith("# host minus UTC")
    assert np.median(values) == pytest.approx(SYSTEM_S, rel=0.05)
    assert {one.name for one in study.timing.sources if not one.used} == {
        "phc2sys eth1", "phc2sys eth2"}  # fmt: skip


def test_of_several_cards_none_is_taken_for_the_host(tmp_path: Path) -> None:
    paths = _phc2sys(tmp_path, {"eth1": CARD_S, "eth2": 2 * CARD_S})
    with pytest.raises(BadInput, match="phc2sys steers several cards"):
        study_logs(paths, TimingSettings())
    study = study_logs(paths, TimingSettings(source="eth1"))
    head, values = _first(study)
    assert head.startswith("# phc2sys eth1 minus its reference")
    assert np.median(values) == pytest.approx(CARD_S, rel=0.05)


def _summaries(folder: Path, program: str = "ptp4l", seed: int = 0) -> list[Path]:
    """A clock about 1.2 us late, of which each second tells how far off it was at most."""
    paths = []
    for day in range(4):
        source = np.random.default_rng([seed, day])
        sizes = np.abs(source.normal(-SYSTEM_S, SCATTER_S, 200))
        lines = [f"{program}[{START + 86400.0 * day + k:.3f}]: rms {900.0 * size * 1e6:.0f} max "
                 f"{1e9 * size:.0f} freq -300 +/- 20 delay 1500 +/- 10"
                 for k, size in enumerate(sizes)]  # fmt: skip
        paths.append(write(folder / f"{program}{day}.log", lines))
    return paths


def test_summary_lines_tell_no_sign(tmp_path: Path) -> None:
    study = study_logs(_summaries(tmp_path), TimingSettings())
    found = study.timing
    assert [one.median_s for one in found.sessions] == [None] * 4
    assert all(one.quantile_s == pytest.approx(SYSTEM_S + 1.64 * SCATTER_S, rel=0.02)
               for one in found.sessions)  # fmt: skip
    assert found.stability == ()
    (said,) = [note for note in found.notes if "summary lines" in note]
    assert said.startswith("800 of 800 rows are")
    _, values = _first(study)
    assert -values[:499][::-1] == pytest.approx(values[500:], abs=2e-9)
    assert np.quantile(np.abs(values), 0.5) == pytest.approx(SYSTEM_S, rel=0.02)


def test_lines_with_a_sign_keep_it(tmp_path: Path) -> None:
    lines = [made.ptp4l_line(START + k, SYSTEM_S) for k in range(200)]
    found = study_logs([write(tmp_path / "ptp4l.log", lines)], TimingSettings()).timing
    assert found.sessions[0].median_s == pytest.approx(-SYSTEM_S)
    assert found.stability != ()
    assert not [note for note in found.notes if "summary lines" in note]


def test_sizes_of_two_clocks_add_up_where_no_sign_tells_better(tmp_path: Path) -> None:
    """The system clock 1.2 us late against a card that is 1.2 us off, by summaries: up to 2.4."""
    system = [made.phc2sys_line(START + k, SYSTEM_S) for k in range(200)]
    paths = [_summaries(tmp_path)[0], write(tmp_path / "system.log", system)]
    found = study_logs(paths, TimingSettings()).timing
    assert found.source.name == "CLOCK_REALTIME by phc2sys and ptp4l"
    (session,) = found.sessions
    assert session.median_s is None
    assert session.quantile_s == pytest.approx(2.0 * SYSTEM_S + 1.64 * SCATTER_S, rel=0.02)


def test_a_summary_keeps_its_frequency_and_delay(tmp_path: Path) -> None:
    (series,) = read_logs(_summaries(tmp_path)[:1]).series
    assert series.unsigned.all()
    assert series.rate == pytest.approx(-3e-7)
    assert series.hard_s - series.offset_s == pytest.approx(1.5e-6 + 0.5e-9)


@pytest.mark.parametrize(
    "before",
    ["Nov 29 10:15:03 host ", "2026-11-29T10:15:03+0100 host ", "Nov 29 10:15:03.123456 host ",
     "1796000103.123456 host ", "[ 4711.123456] host "],
    ids=["short", "short-iso", "short-precise", "short-unix", "short-monotonic"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["ptp4l[812]: [{:.3f}]: ", "ptp4l[812]: ptp4l[{:.3f}]: "])
def test_all_short_outputs_of_the_journal_are_read(before: str, name: str, tmp_path: Path) -> None:
    """The stamp is the program's own, by syslog or on standard output, whatever stands before."""
    lines = [before + name.format(START + k) + f"master offset {k} s2 freq -300 path delay 1500"
             for k in range(30)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "journal.log", lines)]).series
    assert series.time_s.tolist() == [START + k for k in range(30)]
    assert series.offset_s == pytest.approx(1e-9 * np.arange(30))
