"""The contract of readers: found by content, refused in one line, stamps kept as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording, reader_of, registry
from syncline_design.logs.readers.reader import FileHead, library
from syncline_design.logs.readers.stream import UNSET, StampColumn
from syncline_design.spec.load import BadInput


def test_stamps_of_any_size_are_kept() -> None:
    column = StampColumn()
    for stamp in (-1, 0, 2**63 - 1, 2**63, 1_432_235_498_025_043_042):
        column.append(stamp)
    column.extend(np.arange(3, dtype=np.int32)[::2])
    values = column.values()
    assert values.dtype == np.int64
    assert values.tolist() == [-1, 0, 2**63 - 1, UNSET, 1_432_235_498_025_043_042, 0, 2]
    assert len(column) == 7


def test_a_file_of_no_kind_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "noise.bin"
    path.write_bytes(bytes(range(256)) * 8)
    with pytest.raises(BadInput) as caught:
        open_recording(path)
    (flaw,) = caught.value.problems
    assert flaw.file == str(path)
    assert flaw.message == "no log that can be read"


@pytest.mark.parametrize("what", ["missing", "empty", "nowhere/at all"])
def test_what_is_not_there_is_refused(tmp_path: Path, what: str) -> None:
    path = tmp_path / what
    if what == "empty":
        path.write_bytes(b"")
    with pytest.raises(BadInput):
        open_recording(path)


def test_a_missing_library_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        library("no_such_library.part", tmp_path / "a.bag", "ROS 1 bag")
    (flaw,) = caught.value.problems
    assert flaw.message == "reading a ROS 1 bag needs the library no-such-library"
    assert "pip install no-such-library (all formats: the extra `logs`)" in flaw.hint


def test_every_reader_says_what_it_reads() -> None:
    assert all(reader.format for reader in registry().values())


def test_nothing_of_others_is_imported_until_a_file_asks_for_it(tmp_path: Path) -> None:
    """Looking for the reader of a file loads no library of a format."""
    import subprocess
    import sys

    libraries = ("rosbags", "mcap", "pyulog", "pymavlink", "laspy", "lazrs", "pyubx2", "pynmeagps",
                 "dpkt", "lz4", "zstandard")  # fmt: skip
    path = tmp_path / "a.csv"
    path.write_text("time_s,x_m\n0,1\n", "utf-8")
    code = (
        "import sys; from pathlib import Path; from syncline_design.logs.readers import *;"
        "from syncline_design.logs.readers import registry, reader_of;"
        "from syncline_design.logs.readers.reader import head_of;"
        f"registry(); reader_of(head_of(Path({str(path)!r})));"
        f"print([n for n in {libraries!r} if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_packed_bytes_that_look_like_a_receivers_message_leave_a_bag_a_bag(tmp_path: Path) -> None:
    """Eight bytes of a chunk make an empty UBX message with a right checksum."""
    chance = b"\n$" + bytes([0xB5, 0x62, 0, 0, 0, 0, 0, 0])
    for magic, kind in ((b"\x89MCAP0\r\n", "MCAP"), (b"#ROSBAG V2.0\n", "ROS 1 bag")):
        head = FileHead(tmp_path / "x", magic + bytes(range(256)) * 8 + chance * 3, 2100)
        reader = reader_of(head)
        assert reader is not None
        assert kind in reader.format
