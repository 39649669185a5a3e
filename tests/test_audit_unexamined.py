"""What audit could not look at is said, and never ends as sound: files of other libraries."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from mcap.writer import Writer
from typer.testing import CliRunner, Result

from syncline_design.cli.app import app

START = 1_790_000_000_000_000_000
FIELDS = "std_msgs/Header header\nfloat64 x\n" + "=" * 80 + "\nMSG: std_msgs/Header\n" + (
    "builtin_interfaces/Time stamp\nstring frame_id\n"
)  # fmt: skip


def run(path: Path) -> tuple[Result, dict[str, Any]]:
    found = CliRunner().invoke(app, ["audit", str(path), "-o", "json:-", "-q"])
    return found, json.loads(found.stdout)


def written(path: Path, topics: dict[str, tuple[str, bytes | None]]) -> Path:
    """Topics of 100 messages at 10 Hz by their definition; payload None: header and a figure."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        made = {}
        for topic, (text, _) in topics.items():
            kind = f"own_msgs/msg/{topic.strip('/').capitalize()}"
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            made[topic] = writer.register_channel(topic, "cdr", schema)
        for k in range(100):
            at = START + k * 100_000_000
            for topic, (_, payload) in topics.items():
                stamp = struct.pack("<iI", at // 10**9, at % 10**9)
                whole = b"\0\1\0\0" + stamp + struct.pack("<I2s2xd", 2, b"a\0", 1.0)
                data = whole if payload is None else payload
                came = at + 2_000_000
                writer.add_message(made[topic], log_time=came, publish_time=came, data=data)
        writer.finish()
    return path


BROKEN = "float64[99999999999] x\nnowhere/Nothing y\n"


def test_a_sound_topic_alone_is_sound(tmp_path: Path) -> None:
    found, data = run(written(tmp_path / "a.mcap", {"/a": (FIELDS, None)}))
    assert (found.exit_code, data["unexamined"]) == (0, [])


@pytest.mark.parametrize(
    ("text", "payload", "why"),
    [(BROKEN, None, "definition"), (FIELDS, b"\0\1\0\0", "long enough")],
)  # fmt: skip
def test_a_topic_that_cannot_be_read_is_said_and_not_sound(
    tmp_path: Path, text: str, payload: bytes | None, why: str
) -> None:
    """Alone, and beside one that is sound."""
    for topics in ({"/b": (text, payload)}, {"/a": (FIELDS, None), "/b": (text, payload)}):
        found, data = run(written(tmp_path / f"{len(topics)}.mcap", topics))
        assert found.exit_code == 2
        (said,) = data["unexamined"]
        assert said["reason"].startswith("/b was not examined")
        assert why in said["reason"]
        examined = {row["name"]: row["examined"] for row in data["streams"]}
        assert examined == {name: name == "/a" for name in topics}


def test_topics_without_stamps_are_no_fault_beside_others_and_no_audit_alone(
    tmp_path: Path,
) -> None:
    bare = ("float64 x\n", struct.pack("<4xd", 1.0))
    found, data = run(written(tmp_path / "both.mcap", {"/a": (FIELDS, None), "/c": bare}))
    assert (found.exit_code, data["unexamined"]) == (0, [])
    text = CliRunner().invoke(app, ["audit", str(written(tmp_path / "one.mcap", {"/c": bare}))])
    assert text.exit_code == 2
    assert "Nothing examined" in text.stdout
    assert "Sound" not in text.stdout


def test_a_cloud_says_nothing_of_its_stamps(tmp_path: Path) -> None:
    cloud = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    cloud.x = cloud.y = cloud.z = np.arange(500.0)
    cloud.gps_time = 200_000.0 + 0.01 * np.arange(500)
    cloud.write(tmp_path / "cloud.las")
    found, data = run(tmp_path / "cloud.las")
    assert found.exit_code == 2
    assert "order of space" in data["unexamined"][0]["reason"]
    text = CliRunner().invoke(app, ["audit", str(tmp_path / "cloud.las")])
    assert "What was not examined" in text.stdout
    assert "damaged" not in text.stdout


def test_a_file_that_was_cut_is_not_plainly_sound(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.mcap", {"/a": (FIELDS, None)}).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 9 // 10])
    found = CliRunner().invoke(app, ["audit", str(cut)])
    assert found.exit_code == 0  # by its faults, of which what is left has none
    assert "Sound as far as it was read" in found.stdout
