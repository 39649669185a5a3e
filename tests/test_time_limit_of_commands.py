"""`--time-limit` ends every command that can take long, within a second and with an exit code."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.comparison.diff import diff
from syncline_design.machine.deadline import (
    OVERDUE_S,
    Deadline,
    OutOfTime,
    heard_again,
    in_force,
    overdue,
    within_s,
)
from syncline_design.studies import (
    Progress,
    StudySettings,
    StudyStoppedError,
    load_study,
    run_study,
)

ROOT = Path(__file__).parent.parent
SPEC, OTHER = ROOT / "specs" / "uav_corridor.yaml", ROOT / "specs" / "usv_mapping.yaml"
LOGGED = [str(ROOT / "examples" / f"hidden_latency.{end}") for end in ("yaml", "csv")]
LONG = {
    "simulate": ("simulate", str(SPEC), "--samples", "200000000"),
    "diagnose": ("diagnose", *LOGGED),
    "diff": ("diff", str(SPEC), str(OTHER)),
    "reproduce": ("reproduce",),
    "timing": ("timing", LOGGED[1]),
}


@pytest.mark.parametrize("words", LONG.values(), ids=LONG)
def test_no_time_at_all_is_said_and_is_no_verdict(words: tuple[str, ...]) -> None:
    done = CliRunner().invoke(app, [*words, "--time-limit", "0"])
    assert done.exit_code == 3
    assert done.stdout == ""
    assert "the time limit of 0 s was reached" in done.stderr
    assert done.stderr.endswith("; nothing can be concluded\n")


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_long_simulation_ends_with_its_processes(workers: str) -> None:
    """Minutes of work under a limit of 3 s; the processor time can only be less than what passes.

    A busy machine may need the three seconds for its start alone.
    """
    started = time.monotonic()
    command = (sys.executable, "-m", "syncline_design.cli", *LONG["simulate"])
    done = subprocess.run(
        [*command, "--workers", workers, "--time-limit", "3"],
        check=False, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 3
    assert "the time limit of 3 s was reached while" in done.stderr
    assert time.monotonic() - started < 15.0


@pytest.mark.parametrize("command", ["check", "diagnose", "diff", "study"])
def test_reading_counts_too(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that takes long to read: no step of that looks at the clock by itself."""
    monkeypatch.setattr("syncline_design.machine.deadline.OVERDUE_S", 0.01)  # quick machines too
    monkeypatch.setattr("syncline_design.machine.deadline.AGAIN_S", 60.0)  # once has to do
    large = tmp_path / "large.yaml"
    entries = "".join(f"  k{i}: {{a: {i}, b: [1, 2, 3]}}\n" for i in range(44_000))
    large.write_text(f"{SPEC.read_text('utf-8')}more:\n{entries}", "utf-8")
    more = [str(OTHER)] if command == "diff" else []
    done = CliRunner().invoke(app, [command, str(large), *more, "--time-limit", "0.1"])
    assert done.exit_code == 3, done.stderr
    assert "the time limit of 0.1 s was reached while reading" in done.stderr


def test_a_diagnosis_stands_without_what_it_means_for_the_design(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from syncline_design.comparison import meaning as module

    def too_long(*_: object) -> None:
        raise OutOfTime

    monkeypatch.setattr(module, "meaning", too_long)
    spec, log = tmp_path / "with_findings.yaml", tmp_path / "first_90_s.csv"
    rows = Path(LOGGED[1]).read_text("utf-8").splitlines(keepends=True)
    log.write_text("".join(rows[:901]), "utf-8")
    given = ["diagnose", LOGGED[0], str(log), "--time-limit", "300", "--write-spec", str(spec)]
    done = CliRunner().invoke(app, given)
    assert done.exit_code == 1
    assert "latency" in done.stdout
    assert "What it means for the design" not in done.stdout
    assert "while checking the design with the findings" in done.stderr
    assert "the time was over: no spec written" in done.stderr
    assert not spec.exists()


def _study(folder: Path) -> Path:
    """Ten cases: more than are worked off without worker processes."""
    (folder / "base.yaml").write_bytes(SPEC.read_bytes())
    path = folder / "study.yaml"
    path.write_text(
        "study: 1\nname: distances\nbase: [base.yaml]\ncheck: {monte_carlo: false}\n"
        'grid: {"stages[uav].distance": [40 m, 60 m, 80 m, 100 m, 120 m],\n'
        '  "requirements[ACC-1].limit": [0.2 m, 0.3 m]}\n',
        "utf-8",
    )
    return path


def test_a_study_keeps_what_was_done_and_goes_on(tmp_path: Path) -> None:
    """It stops between two cases: here after the third."""
    study = _study(tmp_path)
    total = len(load_study(study))

    def end_after_three(progress: Progress) -> None:
        if progress.done == 3:
            raise OutOfTime

    settings = StudySettings(workers=1)
    with within_s(1e6), pytest.raises(StudyStoppedError, match=f"3 of {total} cases are done"):
        run_study(study, settings, end_after_three)
    assert run_study(study, settings).reused == 3


@pytest.mark.parametrize("workers", ["1", "2"])
def test_the_study_command_says_how_far_it_came(tmp_path: Path, workers: str) -> None:
    study = _study(tmp_path)
    done = CliRunner().invoke(app, ["study", str(study), "--time-limit", "0", "--workers", workers])
    assert done.exit_code == 3
    assert "the time limit of 0 s was reached" in done.stderr
    assert "run the study again to go on" in done.stderr


def test_a_case_does_not_know_the_limit_of_the_command(tmp_path: Path) -> None:
    """Its record is kept under a key without that limit: it must be the same with it."""
    study = _study(tmp_path)
    plain = run_study(study, StudySettings(workers=1, store=tmp_path / "plain"))
    with within_s(1e6):
        limited = run_study(study, StudySettings(workers=1, store=tmp_path / "limited"))
    assert [c.verdict for c in plain.cases()] == [c.verdict for c in limited.cases()]
    files = [sorted(p.name for p in (tmp_path / s).rglob("*.json")) for s in ("plain", "limited")]
    assert files[0] == files[1] != []
    for name in files[0]:
        (one,), (other,) = (list((tmp_path / s).rglob(name)) for s in ("plain", "limited"))
        assert one.read_bytes() == other.read_bytes()


def test_a_difference_of_verdicts_that_were_cut_short_is_none() -> None:
    with within_s(0.0), pytest.raises(OutOfTime):
        diff(SPEC, OTHER)


def test_an_inner_limit_ends_no_later_than_the_outer_one() -> None:
    with within_s(5.0) as outer:
        with within_s(None) as same:
            assert same is outer
        with within_s(50.0) as longer:
            assert longer is outer
        with within_s(1.0) as shorter:
            assert (shorter.left_s() or 0.0) <= 1.0
        assert in_force() is outer
    assert in_force().limit_s is None


def test_the_alarm_ends_what_does_not_ask() -> None:
    started = time.monotonic()
    with overdue(Deadline(0.0, doing="sleeping")), pytest.raises(OutOfTime, match="while sleeping"):
        time.sleep(30.0)
    assert OVERDUE_S <= time.monotonic() - started < 15.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


class _Dying:
    """Something whose finalizer is struck by an interrupt."""

    def __init__(self, struck: Callable[[], object]) -> None:
        self.struck = struck

    def __del__(self) -> None:
        self.struck()


def _sleeps_on(struck: Callable[[], object]) -> None:
    """Python prints what a finalizer raises and goes on: 20 s would be slept."""
    one = _Dying(struck)
    del one
    time.sleep(20.0)


def test_an_alarm_that_strikes_in_a_finalizer_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("syncline_design.machine.deadline.AGAIN_S", 60.0)
    started = time.monotonic()
    with heard_again(), overdue(Deadline(0.0)), pytest.raises(OutOfTime):
        _sleeps_on(lambda: time.sleep(5.0))
    assert OVERDUE_S <= time.monotonic() - started < 15.0


@pytest.fixture
def interruptible() -> Iterator[None]:
    """What a shell starts in the background ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_that_strikes_in_a_finalizer_comes_again() -> None:
    started = time.monotonic()
    with heard_again(), pytest.raises(KeyboardInterrupt):
        _sleeps_on(lambda: signal.raise_signal(signal.SIGINT))
    assert time.monotonic() - started < 15.0


def test_what_else_a_finalizer_raises_goes_where_it_went(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: seen.append(str(lost.exc_value)))

    def fails() -> None:
        raise ValueError("of its own")

    with heard_again():
        one = _Dying(fails)
        del one
    assert seen == ["of its own"]


def test_no_alarm_without_a_limit_or_outside_the_main_thread() -> None:
    seen: list[tuple[float, float]] = []

    def look(deadline: Deadline) -> None:
        with overdue(deadline):
            seen.append(signal.getitimer(signal.ITIMER_REAL))

    look(Deadline())
    thread = threading.Thread(target=look, args=(Deadline(1.0),))
    thread.start()
    thread.join()
    assert seen == [(0.0, 0.0), (0.0, 0.0)]
