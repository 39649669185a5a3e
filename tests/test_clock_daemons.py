"""Logs of real daemons: chronyd and ptp4l, in a network namespace of their own.

Neither may touch this machine's clock: chronyd runs with -x, ptp4l without the right to set a
clock.  Both ends read the same clock, so the true offset is zero.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.series import ClockSeries
from syncline_design.clocks.sessions import sessions_of

PATHS = os.environ.get("PATH", "") + os.pathsep + "/usr/sbin:/sbin"
CHRONYD, PTP4L = shutil.which("chronyd", path=PATHS), shutil.which("ptp4l", path=PATHS)
TOOLS = all(shutil.which(tool, path=PATHS) for tool in ("unshare", "nsenter", "setpriv", "ip"))
NEAR_S = 2e-3  # what a busy machine may add between two stamps of one clock

CHRONY = """\
ip link set lo up
"$CHRONYD" -x -d -U -u root -f server.conf > server.out 2>&1 & A=$!
"$CHRONYD" -x -d -U -u root -f client.conf > client.out 2>&1 & B=$!
sleep 6
kill $A $B; wait
"""
RESTARTS = """\
ip link set lo up
"$CHRONYD" -x -d -U -u root -f server.conf > server.out 2>&1 & A=$!
for run in 1 2 3; do
    "$CHRONYD" -x -d -U -u root -f client.conf > client.out 2>&1 & B=$!
    sleep 3.5
    kill $B; wait $B
    sleep 1.5
done
kill $A; wait
"""
PTP = """\
ip link add va type veth peer name vb
unshare -n sleep 20 & H=$!
sleep 0.3
ip link set vb netns $H
ip addr add 10.9.0.1/24 dev va; ip link set va up
nsenter -t $H -n ip addr add 10.9.0.2/24 dev vb; nsenter -t $H -n ip link set vb up
tame="setpriv --bounding-set=-sys_time --inh-caps=-sys_time"
$tame "$PTP4L" -f master.cfg -i va -m > master.out 2>&1 & A=$!
nsenter -t $H -n $tame "$PTP4L" -f slave.cfg -i vb -m > slave.out 2>&1 & B=$!
sleep 8
kill $A $B $H; wait
"""


def _run(script: str, folder: Path, **names: str | None) -> None:
    """The script in a network namespace of its own; skipped where there can be none."""
    if not TOOLS:
        pytest.skip("unshare, nsenter, setpriv or ip is not installed")
    if subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False).returncode:
        pytest.skip("no right to make a network namespace")
    known = {name: value for name, value in names.items() if value is not None}
    subprocess.run(
        ["unshare", "-n", "bash", "-c", script], cwd=folder, check=False, capture_output=True,
        timeout=40, env={**os.environ, "PATH": PATHS, **known},
    )  # fmt: skip


def _only(paths: list[Path], name: str) -> ClockSeries:
    (found,) = [one for one in read_logs(paths).series if one.kind.name.startswith(name)]
    return found


def _chrony_logs(folder: Path, script: str, shift_s: float = 0.0) -> list[Path]:
    """tracking, measurements and statistics of a client of a server of its own."""
    (folder / "server.conf").write_text(
        f"local stratum 3\nallow 127.0.0.1\nport 11123\ncmdport 0\nbindcmdaddress /\n"
        f"pidfile {folder}/server.pid\n"
    )
    (folder / "client.conf").write_text(
        f"server 127.0.0.1 port 11123 minpoll -4 maxpoll -4 offset {shift_s}\nport 0\ncmdport 0\n"
        f"logdir {folder}\nlog tracking measurements statistics\nbindcmdaddress /\n"
        f"pidfile {folder}/client.pid\ndriftfile {folder}/client.drift\n"
    )
    _run(script, folder, CHRONYD=CHRONYD)
    logs = [folder / f"{name}.log" for name in ("tracking", "measurements", "statistics")]
    if not all(log.exists() for log in logs):
        pytest.skip("chronyd did not start here")
    return logs


@pytest.mark.skipif(CHRONYD is None, reason="chronyd is not installed")
def test_each_start_of_a_real_chronyd_begins_a_session(tmp_path: Path) -> None:
    """Into the same logs, away for 1.5 s: the second and third start know their drift."""
    series = read_logs(_chrony_logs(tmp_path, RESTARTS)).series
    assert len(series) == 3
    for one in series:
        starts = [cut.series.time_s[0] for cut in sessions_of(one, 3600.0)]
        assert len(starts) == 3, one.kind.name
        assert np.diff(starts) == pytest.approx([5.0, 5.0], abs=2.0)


@pytest.mark.skipif(CHRONYD is None, reason="chronyd is not installed")
@pytest.mark.parametrize("shift_s", [0.0, 0.02])
def test_the_three_logs_of_a_real_chronyd_agree_in_sign(tmp_path: Path, shift_s: float) -> None:
    """`offset 0.02` makes the server seem 20 ms ahead: the client's clock is 20 ms late."""
    logs = _chrony_logs(tmp_path, CHRONY, shift_s)
    tracking, measurements, statistics = (_only([log], f"chrony {log.stem}") for log in logs)
    assert len(measurements) > 20
    # with -x a clock of chronyd's own is steered: only the first figures show the shift
    first = np.flatnonzero(tracking.locked)[0]
    for offset_s in (tracking.offset_s[first], measurements.offset_s[0], statistics.offset_s[0]):
        assert offset_s == pytest.approx(-shift_s, abs=NEAR_S)
    assert bool(tracking.restart[0])
    assert not bool(tracking.locked[0])
    assert abs(np.median(tracking.offset_s[first + 3 :])) < NEAR_S
    good = np.isfinite(measurements.hard_s)
    assert np.all(measurements.hard_s[good] >= np.abs(measurements.offset_s[good]))


@pytest.mark.skipif(PTP4L is None, reason="ptp4l is not installed")
def test_lines_of_a_real_ptp4l_are_read(tmp_path: Path) -> None:
    for name, more in (("master", ""), ("slave", "slaveOnly 1\n")):
        (tmp_path / f"{name}.cfg").write_text(
            f"[global]\ntime_stamping software\nuds_address {tmp_path}/{name}.sock\n"
            "logSyncInterval -4\nlogMinDelayReqInterval -4\nlogAnnounceInterval -2\n"
            f"summary_interval -4\nfirst_step_threshold 0\n{more}"
        )
    _run(PTP, tmp_path, PTP4L=PTP4L)
    log = tmp_path / "slave.out"
    text = log.read_text("utf-8", "replace") if log.exists() else ""
    if "master offset" not in text:
        pytest.skip(f"ptp4l measured nothing here: {text.splitlines()[-1:]}")
    series = _only([log], "ptp4l")
    wanted = [int(line.split("master offset")[1].split()[0]) * 1e-9
              for line in text.splitlines() if "master offset" in line]  # fmt: skip
    known = np.isfinite(series.offset_s)
    assert series.offset_s[known].tolist() == pytest.approx(wanted)
    assert abs(float(np.median(series.offset_s[known]))) < NEAR_S
    assert np.all(series.hard_s[known] >= np.abs(series.offset_s[known]))
    assert np.all(np.diff(series.time_s) >= 0.0)
