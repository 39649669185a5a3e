"""What a clock is held against: a server without UTC, its own pulse, several that disagree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.result import Timing
from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.spec.load import BadInput
from tests import clock_logs as made
from tests.clock_logs import START, write

ROWS = 60


def _times(k: int) -> np.ndarray:
    times: np.ndarray = START + 86400.0 * k + 64.0 * np.arange(ROWS)
    return times


def _late(k: int) -> np.ndarray:
    late: np.ndarray = np.random.default_rng(k).normal(0.0, 1e-5, ROWS)
    return late


def _tracked(folder: Path, *, stratum: int = 2, deep_rows: int = ROWS, **more: object) -> Timing:
    """Six sessions; the clock's own stratum in so many rows of each, 2 else."""
    paths = []
    for k in range(6):
        lines = [made.tracking_line(t, x, hard_s=6e-4, **more)  # type: ignore[arg-type]
                 for t, x in zip(_times(k), _late(k), strict=True)]  # fmt: skip
        for n in range(deep_rows):
            head, _, tail = lines[n].partition(" 2 -3.114")
            lines[n] = f"{head} {stratum:2d} -3.114{tail}"
        paths.append(write(folder / f"tracking_{k}.log", lines))
    return study_logs(paths, TimingSettings()).timing


@pytest.mark.parametrize(
    ("stratum", "rows", "reference", "doubted"),
    [
        (3, ROWS, "192.0.2.1", False),
        (9, ROWS, "192.0.2.1", False),
        (10, ROWS, "127.127.1.1", True),
        (11, ROWS, "192.0.2.1", True),
        (11, 10, "192.0.2.1", True),
    ],
)
def test_a_server_that_follows_nothing_gives_no_utc(
    stratum: int, rows: int, reference: str, doubted: bool, tmp_path: Path
) -> None:
    found = _tracked(tmp_path, stratum=stratum, deep_rows=rows, reference=reference)
    assert found.claim.made is not doubted
    assert any("follows no UTC" in said for said in found.doubts) is doubted


@pytest.mark.parametrize(("reference", "whole"), [("192.0.2.1", True), ("2001:db8::1", True),
                                                  ("PPS", False), ("GPS0", False)])  # fmt: skip
def test_a_clock_that_follows_a_pulse_does_not_show_it(
    reference: str, whole: bool, tmp_path: Path
) -> None:
    found = _tracked(tmp_path, reference=reference)
    assert found.source.whole_way is whole
    said = [note for note in found.notes if "its own reference" in note]
    assert len(said) == (not whole)
    assert all(reference in note for note in said)


def test_ntpd_s_own_clock_is_no_reference(tmp_path: Path) -> None:
    """peerstats of the local driver, LOCAL(0): always at 0."""
    paths = []
    for k in range(6):
        lines = [made.peerstats_line(t, x).replace("192.0.2.1", "127.127.1.0")
                 for t, x in zip(_times(k), _late(k), strict=True)]  # fmt: skip
        paths.append(write(tmp_path / f"peerstats_{k}", lines))
    found = study_logs(paths, TimingSettings()).timing
    assert any("ntpd's own clock" in said for said in found.doubts)


SERVER, OTHER = "192.0.2.1", "192.0.2.9"


def _beside(folder: Path, lines_of: str, off_s: float, *, combined: int = 1) -> Timing:
    """Tracking of a server within 0.6 ms, and another source that puts the clock `off_s` off."""
    paths = []
    for k in range(6):
        both = list(zip(_times(k), _late(k), strict=True))
        tracked = [made.tracking_line(t, x, hard_s=6e-4).replace(" N 1 ", f" N {combined} ")
                   for t, x in both]  # fmt: skip
        make = {
            "pulse": lambda t, x: "\n".join(made.refclock_lines(t, x)),
            "statistics": lambda t, x: made.statistics_line(t, x).replace(SERVER, OTHER),
            "measurements": lambda t, x: made.measurements_line(t, x).replace(SERVER, OTHER),
        }[lines_of]
        paths.append(write(folder / f"tracking_{k}.log", tracked))
        paths.append(write(folder / f"beside_{k}.log", [make(t, x + off_s) for t, x in both]))
    return study_logs(paths, TimingSettings()).timing


@pytest.mark.parametrize(("off_s", "doubted"), [(1e-4, False), (0.1, True)])
def test_a_pulse_that_the_path_excludes_is_in_doubt(
    off_s: float, doubted: bool, tmp_path: Path
) -> None:
    """0.1 s is beyond the 0.6 ms of the daemon's own bound: the pulse's edge, not the clock."""
    found = _beside(tmp_path, "pulse", off_s)
    assert found.source.name == "chrony refclock PPS2"
    assert any(said.startswith("chrony refclock PPS2 puts") for said in found.doubts) is doubted
    assert found.claim.made is not doubted


@pytest.mark.parametrize(
    ("log", "off_s", "reserved"),
    [
        ("statistics", 1e-4, False),
        ("statistics", 0.03, True),
        ("measurements", 7e-4, False),  # within half of its own round trip as well
        ("measurements", 0.03, True),
    ],
)
def test_a_server_that_contradicts_the_one_followed_is_said(
    log: str, off_s: float, reserved: bool, tmp_path: Path
) -> None:
    found = _beside(tmp_path, log, off_s)
    assert found.source.name == "chrony tracking"
    assert found.claim.made
    assert any(OTHER in said for said in found.reservations) is reserved
    assert set(found.reservations) <= set(found.notes)


@pytest.mark.parametrize(("combined", "steering"), [(1, "independent"), (2, "unknown")])
def test_a_pulse_that_may_be_combined_is_not_independent(
    combined: int, steering: str, tmp_path: Path
) -> None:
    found = _beside(tmp_path, "pulse", 0.0, combined=combined)
    (pulse,) = [one for one in found.sources if one.name == "chrony refclock PPS2"]
    assert pulse.steering == steering
    assert pulse.used is (combined == 1)


def test_another_master_is_said(tmp_path: Path) -> None:
    lines = []
    for n in range(200):
        at = START + float(n)
        if n in (0, 100):
            lines.append(f"ptp4l[{at:.3f}]: selected best master clock 00112{n // 100}.fffe.334455")
        lines.append(made.ptp4l_line(at + 0.5, 1e-8))
    log = write(tmp_path / "ptp4l.log", lines)
    (series,) = read_logs([log]).series
    assert series.references == {"001120.fffe.334455", "001121.fffe.334455"}
    notes = study_logs([log], TimingSettings()).timing.notes
    assert any("the master changes" in note for note in notes)
    half = write(tmp_path / "half.log", lines[:100])
    assert not any("the master" in n for n in study_logs([half], TimingSettings()).timing.notes)


@pytest.mark.parametrize(
    ("jump_ppm", "off_s", "said"),
    [(11.574, 1e-5, True), (11.574, 7e-4, False), (0.5, 1e-5, False)],
)
def test_a_rate_that_jumps_without_an_offset_is_the_reference_s(
    jump_ppm: float, off_s: float, said: bool, tmp_path: Path
) -> None:
    """11.574 ppm over a poll of 64 s is 741 us: a crystal would have been off by that."""
    paths = []
    for k in range(6):
        late = _late(k)
        late[40] = off_s
        lines = [
            made.tracking_line(t, x, hard_s=9e-4) for t, x in zip(_times(k), late, strict=True)
        ]
        lines[40:] = [x.replace(" -3.114 ", f" {-3.114 + jump_ppm:.3f} ") for x in lines[40:]]
        paths.append(write(tmp_path / f"tracking_{k}.log", lines))
    found = study_logs(paths, TimingSettings()).timing
    assert any("the reference changed its rate" in one for one in found.reservations) is said


def test_sessions_of_two_hosts_are_no_sessions_of_one_clock(tmp_path: Path) -> None:
    paths = []
    for k in range(6):
        times = START + 86400.0 * (k // 2) + 64.0 * np.arange(ROWS) + 7.0 * (k % 2)
        lines = [made.tracking_line(t, x, hard_s=6e-4)
                 for t, x in zip(times, _late(k), strict=True)]  # fmt: skip
        paths.append(write(tmp_path / f"tracking_{k}.log", lines))
    found = study_logs(paths, TimingSettings()).timing
    assert any("overlap in time" in said for said in found.reservations)


@pytest.mark.parametrize("sigma_steps", [0.6, 1.0, 3.0, 5.0])
def test_coarse_offsets_that_agree_by_chance_are_no_session_twice(
    sigma_steps: float, tmp_path: Path
) -> None:
    """Whole microseconds from each start: two rows agree in up to 45 % of cases, and by chance."""
    paths = []
    for k in range(3):
        source = np.random.default_rng(k)
        offsets = np.round(sigma_steps * source.normal(size=1500)).astype(int)
        rows = [f"{n},{x}" for n, x in enumerate(offsets)]
        paths.append(write(tmp_path / f"{k}.csv", ["time_s,offset_us", *rows]))
    assert study_logs(paths, TimingSettings()).timing.claim.sessions == 3
    half = paths[0].read_text("utf-8").splitlines()
    copy = write(tmp_path / "copy.csv", [half[0], *half[300:1200]])
    with pytest.raises(BadInput, match="the same session as in"):
        study_logs([*paths, copy], TimingSettings())


@pytest.mark.parametrize(("apart_ppm", "said"), [(5.0, False), (47.0, True)])
def test_crystals_that_stand_far_apart_are_said(
    apart_ppm: float, said: bool, tmp_path: Path
) -> None:
    """-12 and 35 ppm by turns: the logs of two hosts."""
    paths = []
    for k in range(6):
        lines = [made.tracking_line(t, x, hard_s=6e-4)
                 for t, x in zip(_times(k), _late(k), strict=True)]  # fmt: skip
        lines = [x.replace(" -3.114 ", f" {apart_ppm * (k % 2):.3f} ") for x in lines]
        paths.append(write(tmp_path / f"tracking_{k}.log", lines))
    notes = study_logs(paths, TimingSettings()).timing.notes
    assert any("are these several hosts" in note for note in notes) is said


def test_shuffled_sessions_are_one_doubt(tmp_path: Path) -> None:
    """The sessions of one table stand in no order: the first place is named, and how often."""
    lines = []
    for day in (5, 3, 4, 1, 0):
        lines += [made.tracking_line(t, x, hard_s=6e-4)
                  for t, x in zip(_times(day), _late(day), strict=True)]  # fmt: skip
    found = study_logs([write(tmp_path / "tracking.log", lines)], TimingSettings()).timing
    (doubt,) = [said for said in found.doubts if "go back" in said]
    assert "and 2 times more" in doubt
