"""ROS 2 bags: a folder with metadata.yaml, or one of its SQLite files (MCAP has its own reader)."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from syncline_design.logs.readers.mcap_file import MAGIC as MCAP_MAGIC
from syncline_design.logs.readers.mcap_file import McapFile
from syncline_design.logs.readers.reader import BY_MAGIC, BY_SHAPE, NO, FileHead, Reader, library
from syncline_design.logs.readers.ros_recording import (
    Container,
    DamagedError,
    RawMessage,
    RosRecording,
    UnpackBudget,
)
from syncline_design.logs.readers.ros_types import BagChannel, Encoding, modern
from syncline_design.logs.refusals import refuse
from syncline_design.machine.deadline import in_force

MAGIC = b"SQLite format 3\x00"
FORMAT = "ROS 2 bag"
METADATA = "metadata.yaml"
_FILES_AT: Final = ("rosbag2_bagfile_information", "relative_file_paths")
MOST_METADATA = 1 << 24
MOST_MESSAGE = 1 << 28
MOST_FILES = 10_000
MOST_NESTED = 50  # levels of a metadata.yaml; a bag's own has six
SMALL = 8_192  # bytes; of longer messages that much is read where stamps are all that is wanted
WHOLE = 16  # messages of a topic that are read to their ends all the same: they say what it is
STEPS = 100_000  # of SQLite's machine between two looks at the clock
_DIGITS = re.compile(r"-?[0-9]{1,20}", re.ASCII)
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


class Ros2Bag(Container):
    """Files of one bag, one after the other."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, FORMAT)
        self._files = _files_of(path) if path.is_dir() else [path]

    def _read(self) -> Iterator[RawMessage]:
        """A file that is damaged does not hide the ones behind it."""
        faults = []
        for path in self._files:
            try:
                yield from self._of(path)
            except DamagedError as damage:
                faults.append(str(damage) if self.path == path else f"{path.name}: {damage}")
        if faults:
            raise DamagedError("; ".join(faults)[:400])

    def _of(self, path: Path) -> Iterator[RawMessage]:
        if not path.is_file():
            raise DamagedError("no regular file" if path.exists() else "is not there")
        try:
            with path.open("rb") as file:
                head = file.read(16)
        except OSError as error:
            raise DamagedError(f"cannot be read: {error.strerror}") from None
        if head.startswith(MCAP_MAGIC):
            inner = McapFile(path)
            inner.wanted, inner.brief = self.wanted, self.brief
            yield from inner._read()
        elif head == MAGIC:
            yield from _of_database(path, self.wanted, self.brief)
        elif head.startswith(ZSTD_MAGIC):
            hint = f"zstd -d {path.name}"
            raise refuse(path, "the bag's file is compressed as a whole", found="zstd", hint=hint)
        else:
            raise DamagedError("no SQLite and no MCAP file" if head else "an empty file")


def _files_of(folder: Path) -> list[Path]:
    """In the order of metadata.yaml, else by the numbers in their names; all within the folder."""
    named = _named(folder / METADATA)
    found = [one for one in folder.iterdir() if one.suffix in (".db3", ".mcap", ".zstd")]
    if not named:
        return sorted(found, key=_by_number)
    root = folder.resolve()
    files = []
    for name in named[:MOST_FILES]:
        path = folder / Path(name).name  # older bags name the folder too
        if not path.resolve().is_relative_to(root):
            raise refuse(folder / METADATA, "a file outside the bag's folder", found=name[:80])
        files.append(path)
    return files


def _by_number(path: Path) -> tuple[list[int], str]:
    return [int(digits) for digits in re.findall(r"\d{1,9}", path.stem)], path.name


def _named(path: Path) -> list[str]:
    import yaml

    if not path.is_file():  # a FIFO would never end
        return []
    try:
        text = path.read_bytes()[: MOST_METADATA + 1]
        if len(text) > MOST_METADATA or text.count(b"&") > 1000:
            raise refuse(path, "no metadata of a bag", expected=f"at most {MOST_METADATA} bytes")
        loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        if _depth_of(yaml.parse(text, loader)) > MOST_NESTED:
            raise refuse(path, "no metadata of a bag", expected=f"at most {MOST_NESTED} levels")
        return _files_told(path, yaml.load(text, loader))
    except (OSError, yaml.YAMLError, RecursionError) as error:
        short = (str(error).splitlines() or [type(error).__name__])[0][:160]
        raise refuse(path, "no metadata of a bag", found=short) from None


def _files_told(path: Path, data: Any) -> list[str]:
    """The names of a bag's files; one alias in another stands for a list without end, so that
    nothing but text is taken."""
    for depth, key in enumerate(_FILES_AT, 1):
        if not isinstance(data, dict) or key not in data:
            wanted = ": ".join(_FILES_AT[:depth])
            raise refuse(path, "no metadata of a bag", expected=wanted, found=f"no {key}")
        data = data[key]
    if isinstance(data, list) and all(isinstance(name, str) for name in data):
        return data
    wanted = "the names of the bag's files as a list of text"
    raise refuse(
        path, "no metadata of a bag", expected=wanted, found=f"{_FILES_AT[-1]} of another kind"
    )


def _depth_of(events: Iterable[Any]) -> int:
    """How deep a document is nested: what builds it would crash where that is absurd."""
    depth = deepest = 0
    for event in events:
        name = type(event).__name__
        depth += name.endswith(("MappingStartEvent", "SequenceStartEvent"))
        depth -= name.endswith(("MappingEndEvent", "SequenceEndEvent"))
        deepest = max(deepest, depth)
        if deepest > MOST_NESTED:
            break
    return deepest


def _of_database(path: Path, wanted: frozenset[str] | None, brief: bool) -> Iterator[RawMessage]:
    """Messages by their number, which is their order of arrival; only real tables are asked.

    brief: of large messages only their beginnings, behind the first of each topic.
    """
    try:
        file = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
    except sqlite3.Error as error:
        raise DamagedError(str(error)) from None
    try:
        file.text_factory = _decoded
        file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_MESSAGE)
        file.set_progress_handler(_checked, STEPS)
        if not _is_whole(path):  # else SQLite refuses a file shorter than its head says
            file.execute("PRAGMA writable_schema = ON")
        channels, packed = _channels(file, path)
        budget = UnpackBudget(path, path.stat().st_size)
        only = [n for n, c in channels.items() if wanted is not None and c.topic in wanted]
        part = brief and not packed and _is_whole(path) and _has_rowid(file)
        with closing(_rows(file, only, brief=part)) as rows:
            for topic, stamp, data in rows:
                channel = channels.get(topic)
                if channel is None or not isinstance(data, bytes):
                    raise DamagedError("a message of no known topic, or without its data")
                log_ns = stamp if isinstance(stamp, int) else _whole(stamp)
                whole = _plain(data, budget, path) if packed else data
                yield RawMessage(channel, log_ns, None, whole)
    except sqlite3.Error as error:
        in_force().check()
        raise DamagedError(str(error)[:160]) from None
    finally:
        file.close()


def _rows(
    file: sqlite3.Connection, only: Sequence[Any], *, brief: bool
) -> Generator[tuple[Any, Any, Any], None, None]:
    """(topic, time, data) of every message, or of some topics."""
    some = f"WHERE topic_id IN ({', '.join('?' * len(only))})" if only else ""
    if not brief:
        yield from file.execute(
            f"SELECT topic_id, timestamp, data FROM messages {some} ORDER BY id", only
        )
        return
    # neither the length nor the type of a value makes SQLite read it
    large = f"length(data) > {SMALL} AND typeof(data) = 'blob'"
    seen: dict[Any, int] = {}
    for topic, stamp, data, row in file.execute(
        f"SELECT topic_id, timestamp, CASE WHEN {large} THEN NULL ELSE data END, "
        f"CASE WHEN {large} THEN rowid END FROM messages {some} ORDER BY id",
        only,
    ):
        if row is None:
            yield topic, stamp, data
            continue
        seen[topic] = seen.get(topic, 0) + 1
        with file.blobopen("messages", "data", row, readonly=True) as blob:
            if len(blob) > MOST_MESSAGE:
                raise DamagedError(f"a message of {len(blob)} bytes")
            yield topic, stamp, blob.read() if seen[topic] <= WHOLE else blob.read(SMALL)


def _has_rowid(file: sqlite3.Connection) -> bool:
    """Whether a message can be opened by its row: not in a table `WITHOUT ROWID`, or of none."""
    try:
        file.execute("SELECT rowid FROM messages LIMIT 1").fetchone()
    except sqlite3.OperationalError:
        return False
    return True


def _whole(stamp: Any) -> int:
    """A time that a database holds as text: whole nanoseconds in digits, and nothing else."""
    text = stamp.strip() if isinstance(stamp, str) else ""
    if not _DIGITS.fullmatch(text):
        raise DamagedError(f"a message with the time {str(stamp)[:40]!r}, no whole nanoseconds")
    return int(text)


def _is_whole(path: Path) -> bool:
    """Whether a database is as long as its head says: of a cut one every message is read."""
    with path.open("rb") as file:
        head = file.read(32)
    page = int.from_bytes(head[16:18], "big")
    pages = int.from_bytes(head[28:32], "big")
    return 0 < pages * (65_536 if page == 1 else page) <= path.stat().st_size


def _decoded(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


def _checked() -> int:
    """What SQLite asks now and then: anything but 0 ends the query."""
    return int(in_force().is_over)


def _channels(file: sqlite3.Connection, path: Path) -> tuple[dict[Any, BagChannel], bool]:
    kinds = dict(file.execute("SELECT name, type FROM sqlite_master"))
    if kinds.get("messages") != "table" or kinds.get("topics") != "table":
        expected = "tables topics and messages"
        raise refuse(path, "a database, but no bag", expected=expected,
                     found=", ".join(map(str, sorted(kinds)))[:200])  # fmt: skip
    definitions: dict[str, str] = {}
    if kinds.get("message_definitions") == "table":
        rows = file.execute(
            "SELECT topic_type, encoded_message_definition FROM message_definitions"
        )
        definitions = {str(name): str(text) for name, text in rows}
    channels = {}
    for number, name, kind, written in file.execute(
        "SELECT id, name, type, serialization_format FROM topics"
    ):
        encoding: Encoding = "cdr" if written == "cdr" else "other"
        own = definitions.get(str(kind), "")
        channels[number] = BagChannel(str(name), modern(str(kind)), encoding, own, str(written))
    return channels, _is_packed(path)


def _is_packed(path: Path) -> bool:
    """Whether every message is compressed by itself, as metadata.yaml beside the file tells."""
    beside = path.parent / METADATA
    try:
        text = beside.read_bytes()[:MOST_METADATA] if beside.is_file() else b""
    except OSError:
        return False
    return bool(re.search(rb"compression_mode:\s*['\"]?message", text, re.IGNORECASE))


def _plain(data: bytes, budget: UnpackBudget, path: Path) -> bytes:
    zstandard = library("zstandard", path, FORMAT)
    try:
        size = zstandard.frame_content_size(data)
        most = size if size >= 0 else MOST_MESSAGE
        budget.spend(most if size >= 0 else len(data), MOST_MESSAGE)
        plain: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=most)
    except zstandard.ZstdError:
        raise DamagedError("a message does not unpack") from None
    return plain


def _recognises(head: FileHead) -> int:
    if head.folder:
        bag = any(name.endswith((".db3", ".mcap", ".db3.zstd")) for name in head.names)
        return BY_MAGIC if METADATA in head.names else (BY_SHAPE if bag else NO)
    return BY_MAGIC if head.start.startswith(MAGIC) else NO


READER = Reader(FORMAT, _recognises, lambda path: RosRecording(Ros2Bag(path)))
