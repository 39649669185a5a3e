"""ROS 2 databases that no recorder writes: odd tables, times as text, metadata that crash."""

from __future__ import annotations

import os
import re
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from syncline_design.logs.readers import open_recording, ros2_bag
from syncline_design.spec.load import BadInput

TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY,name,type,serialization_format,offered)"
USUAL = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"
BEGUN = 1_700_000_000_000_000_000
ROWS = 50


def message(k: int, behind: int = 0) -> bytes:
    """A header in CDR, 7 ns before it is logged."""
    stamp = BEGUN + k * 10_000_000 - 7
    own = struct.pack("<iI", stamp // 10**9, stamp % 10**9)
    return b"\x00\x01\x00\x00" + own + b"\x02\x00\x00\x00a\x00" + bytes(behind)


def database(
    path: Path,
    table: str = f"CREATE TABLE messages({USUAL})",
    row: Callable[[int], tuple[Any, ...]] = lambda k: (k, 1, BEGUN + k * 10_000_000, message(k)),
) -> Path:
    file = sqlite3.connect(path)
    file.execute(TOPICS)
    file.execute(table)
    file.execute("INSERT INTO topics VALUES (1, '/a', 'std_msgs/msg/Header', 'cdr', '')")
    file.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", [row(k) for k in range(ROWS)])
    file.commit()
    file.close()
    return path


def folder(path: Path, metadata: bytes) -> Path:
    path.mkdir()
    database(path / "bag_0.db3")
    (path / "metadata.yaml").write_bytes(metadata)
    return path


def whole(stamps: Any) -> bool:
    return bool(
        stamps.secondary_ns.tolist() == [BEGUN + k * 10_000_000 for k in range(ROWS)]
        and stamps.secondary_ns.shape == (ROWS,)
    )


@pytest.mark.parametrize(
    ("table", "row"),
    [
        (USUAL.replace("timestamp INTEGER", "timestamp TEXT"),
         lambda k: (k, 1, f" {BEGUN + k * 10_000_000}\n", message(k))),
        (f"{USUAL.replace('INTEGER PRIMARY KEY', 'INT')}",
         lambda k: (1000 + k, 1, BEGUN + k * 10_000_000, message(k, 20_000))),
        (USUAL, lambda k: (7 * k, 1, BEGUN + k * 10_000_000, message(k, 20_000))),
    ],
    ids=["times as text", "numbers that are no rows", "large messages with gaps in their numbers"],
)  # fmt: skip
def test_odd_tables_are_read_to_the_last_message(tmp_path: Path, table: str, row: Any) -> None:
    path = database(tmp_path / "a.db3", f"CREATE TABLE messages({table})", row)
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert recording.incomplete is None
    assert stream.stamps is not None
    assert whole(stream.stamps)


def test_a_table_without_rows_of_its_own_is_read(tmp_path: Path) -> None:
    path = database(
        tmp_path / "a.db3",
        f"CREATE TABLE messages({USUAL}) WITHOUT ROWID",
        lambda k: (k, 1, BEGUN + k * 10_000_000, message(k, 20_000)),
    )
    (stream,) = open_recording(path).streams()
    assert stream.stamps is not None
    assert whole(stream.stamps)


@pytest.mark.parametrize(
    ("kind", "time", "words"),
    [
        ("TEXT", "2023-01-01 00:00:00", "time '2023-01-01 00:00:00', no whole nanoseconds"),
        ("REAL", 1.7e18, "time '1.7e+18', no whole nanoseconds"),
        ("TEXT", "١٢٣", "no whole nanoseconds"),
        ("INTEGER", None, "time 'None', no whole nanoseconds"),
    ],
)
def test_times_that_are_none_are_named(tmp_path: Path, kind: str, time: Any, words: str) -> None:
    table = f"CREATE TABLE messages({USUAL.replace('timestamp INTEGER', f'timestamp {kind}')})"
    whole_one = database(tmp_path / "a.db3", table, lambda k: (k, 1, time, message(k)))
    with pytest.raises(BadInput, match=re.escape(words)):
        open_recording(whole_one).streams()

    def late(k: int) -> tuple[Any, ...]:
        return k, 1, time if k == 20 else str(BEGUN), message(k)

    if kind != "REAL":
        recording = open_recording(database(tmp_path / "b.db3", table, late))
        (stream,) = recording.streams()
        assert stream.messages == 20
        assert recording.incomplete is not None
        assert words in recording.incomplete.reason


@pytest.mark.parametrize("data", [None, "text"])
def test_messages_without_data_end_the_file_there(tmp_path: Path, data: Any) -> None:
    path = database(
        tmp_path / "a.db3",
        row=lambda k: (k, 1, BEGUN, data if k == 20 else message(k)),
    )
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert (stream.messages, stream.partial) == (20, True)
    assert recording.incomplete is not None
    assert "without its data" in recording.incomplete.reason


def test_a_message_longer_than_any_is_not_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros2_bag, "MOST_MESSAGE", 100_000)
    path = database(
        tmp_path / "a.db3",
        row=lambda k: (k, 1, BEGUN, message(k, 200_000 if k == 30 else 0)),
    )
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert stream.messages == 30
    assert recording.incomplete is not None


def test_metadata_that_nest_absurdly_do_not_crash(tmp_path: Path) -> None:
    """What builds a document of so many levels overflows the stack of the process."""
    with pytest.raises(BadInput, match="no metadata of a bag"):
        open_recording(folder(tmp_path / "bag", b"a: " + b"[" * 100_000))
    with pytest.raises(BadInput, match="at most 50 levels"):
        open_recording(folder(tmp_path / "other", b"[" * 60 + b"]" * 60))


def of_aliases(levels: int) -> bytes:
    """A list of ten lists of ten lists ..., each told once."""
    told = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    told += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, levels)]
    files = f"rosbag2_bagfile_information:\n  relative_file_paths: [*a{levels - 1}]"
    return "\n".join([*told, files]).encode()


@pytest.mark.parametrize(
    ("metadata", "words"),
    [
        (of_aliases(9), "the names of the bag's files as a list of text"),
        (b"- a\n- b\n", "no rosbag2_bagfile_information"),
        (b"rosbag2_bagfile_information: [a]\n", "no relative_file_paths"),
        (b"rosbag2_bagfile_information:\n  relative_file_paths: 5\n", "as a list of text"),
    ],
)
def test_metadata_of_another_kind_are_refused_in_words(
    tmp_path: Path, metadata: bytes, words: str
) -> None:
    """Nine levels of aliases stand for 1e9 names."""
    with pytest.raises(BadInput) as refused:
        open_recording(folder(tmp_path / "bag", metadata))
    assert words in str(refused.value)
    assert "indices" not in str(refused.value)


@pytest.mark.parametrize("which", ["metadata.yaml", "bag_1.db3"])
def test_a_pipe_in_a_bag_is_not_waited_for(tmp_path: Path, which: str) -> None:
    named = b"rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.db3, bag_1.db3]\n"
    bag = folder(tmp_path / "bag", named)
    (bag / which).unlink(missing_ok=True)
    os.mkfifo(bag / which)
    recording = open_recording(bag)
    (stream,) = recording.streams()
    assert stream.messages == ROWS
    if which == "bag_1.db3":
        assert recording.incomplete is not None
        assert "bag_1.db3: no regular file" in recording.incomplete.reason
