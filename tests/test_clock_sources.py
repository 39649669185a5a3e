"""What one source takes from another, and what is no evidence of the host's clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.result import Timing
from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.spec.load import BadInput
from tests import clock_logs as made
from tests.clock_logs import START, Array, write

LATE_S = 1e-4


def _peers(times: Array, late_s: float, delay_s: float, status: str, name: str) -> list[str]:
    lines = [made.peerstats_line(t, late_s, status) for t in times]
    return [one.replace("0.000400000", f"{delay_s:.9f}").replace("192.0.2.1", name)
            for one in lines]  # fmt: skip


def _ntpd(
    folder: Path, *peers: tuple[float, str], until: float = 1.0, apart_s: float = 0.0
) -> Timing:
    """Four days of loopstats, and peers of these delays and states for a part of them.

    apart_s: by which the peers say more.
    """
    source, paths = np.random.default_rng(8), []
    for day in range(4):
        at = folder / f"day{day}"
        at.mkdir()
        times = START + 86400.0 * day + 64.0 * np.arange(60)
        late = source.normal(LATE_S, 1e-6, 60)
        lines = [made.loopstats_line(t, x) for t, x in zip(times, late, strict=True)]
        paths.append(write(at / "loopstats", lines))
        heard = times[: round(until * 60)]
        rows = [row for k, (delay_s, status) in enumerate(peers)
                for row in _peers(heard, LATE_S + apart_s, delay_s, status,
                                 f"192.0.2.{k + 1}")]  # fmt: skip
        if rows:
            paths.append(write(at / "peerstats", rows))
    return study_logs(paths, TimingSettings()).timing


def test_loopstats_take_the_bound_of_the_peer_that_steers(tmp_path: Path) -> None:
    """|offset| + delay / 2 + dispersion: 0.1 ms + 10 ms + 0.1 ms; the offsets alone say 0.1 ms.

    The peer that is not selected, 60 ms away, bounds nothing.
    """
    timing = _ntpd(tmp_path, (2e-2, "961a"), (0.12, "9014"))
    assert timing.source.name == "ntpd loopstats"
    assert timing.hard_bound_s == pytest.approx(LATE_S + 1e-2 + 1e-4, rel=1e-3)
    assert timing.bound_s == timing.hard_bound_s
    assert timing.statistical_bound_s is not None
    assert timing.statistical_bound_s < 1.2 * LATE_S
    assert not any("no hard bound" in note for note in timing.notes)


@pytest.mark.parametrize(
    ("apart_s", "status", "doubted"),
    [
        (1.5e-3, "961a", True),
        (-1.5e-3, "961a", True),
        (1.5e-4, "961a", False),
        (1.5e-3, "9014", False),
    ],
)
def test_a_loop_and_its_peer_that_disagree_are_in_doubt(
    apart_s: float, status: str, doubted: bool, tmp_path: Path
) -> None:
    """0.1 ms of half a round trip of 0.2 ms and 0.1 ms of dispersion: 0.2 ms are allowed."""
    timing = _ntpd(tmp_path, (2e-4, status), apart_s=apart_s)
    said = [one for one in timing.doubts if "from what loopstats say" in one]
    assert bool(said) is doubted
    assert timing.claim.made is not doubted
    if doubted:
        assert "1.5 ms" in said[0]
        assert "200 us" in said[0]


def test_of_two_selected_peers_the_larger_bound_counts(tmp_path: Path) -> None:
    timing = _ntpd(tmp_path, (4e-3, "961a"), (8e-3, "961a"))
    assert timing.hard_bound_s == pytest.approx(LATE_S + 4e-3 + 1e-4, rel=1e-3)


def test_a_peer_that_was_not_heard_for_long_bounds_nothing(tmp_path: Path) -> None:
    """Heard in the first half of each day: ten polls later its bound is no longer that of today."""
    timing = _ntpd(tmp_path, (4e-3, "961a"), until=0.5)
    assert timing.hard_bound_s == pytest.approx(LATE_S + 2e-3 + 1e-4, rel=1e-3)
    unselected = tmp_path / "unselected"
    unselected.mkdir()
    timing = _ntpd(unselected, (4e-3, "9014"))
    assert timing.hard_bound_s is None
    assert any(note.startswith("no hard bound: what is used") for note in timing.notes)


def _phc2sys(folder: Path, what: str) -> list[Path]:
    paths = []
    for day in range(4):
        times = START + 86400.0 * day + 1.0 * np.arange(120)
        lines = [made.phc2sys_line(t, LATE_S + 1e-9 * (k % 7)) for k, t in enumerate(times)]
        lines = [line.replace("CLOCK_REALTIME phc", what) for line in lines]
        paths.append(write(folder / f"day{day}.log", lines))
    return paths


@pytest.mark.parametrize("what", ["/dev/ptp0 sys", "eth1 sys", "sys"])
def test_a_card_that_follows_the_system_clock_is_no_evidence_of_it(
    what: str, tmp_path: Path
) -> None:
    """`NAME sys offset`: NAME minus the system clock, as where the host is the grandmaster."""
    paths = _phc2sys(tmp_path, what)
    with pytest.raises(BadInput, match="no evidence of the system clock itself"):
        study_logs(paths, TimingSettings())
    timing = study_logs(paths, TimingSettings(source="phc2sys")).timing
    assert timing.source.name.endswith("by the system clock")
    assert any("compared with the system clock" in note for note in timing.notes)
    assert study_logs(paths, TimingSettings(kind="timestamping")).timing.claim.made


def test_another_card_is_not_called_the_system_clock(tmp_path: Path) -> None:
    timing = study_logs(_phc2sys(tmp_path, "/dev/ptp1 phc"), TimingSettings()).timing
    assert timing.source.name == "phc2sys /dev/ptp1"
    (note,) = [one for one in timing.notes if one.startswith("phc2sys")]
    assert "a card that is compared with another clock" in note
