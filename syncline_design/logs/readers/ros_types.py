"""Definitions of ROS messages: where a type keeps its own stamp, and how it is unpacked."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from syncline_design.logs.readers.reader import library
from syncline_design.logs.readers.stream import UNSET
from syncline_design.machine.deadline import NoVerdict
from syncline_design.machine.quick_dataclass import dataclass

Encoding = Literal["ros1", "cdr", "other"]
StampOf = Callable[[bytes], int]

LONGEST_DEFINITION = 1 << 20  # characters; the longest of ROS itself has some thousand
HEADERS = ("Header", "std_msgs/Header", "std_msgs/msg/Header", "std_msgs::msg::Header")
TIMES = (
    "time",
    "builtin_interfaces/Time",
    "builtin_interfaces/msg/Time",
    "builtin_interfaces::msg::Time",
)
_FIELD = re.compile(r"^\s*([\w/:]+(?:<=\d+)?(?:\[[^\]]*\])?)\s+(\w+)\s*(?:#.*)?$")
_SECOND = 1_000_000_000
_SEQ_BYTES, _ENCAPSULATION_BYTES = 4, 4


@dataclass(frozen=True, slots=True)
class BagChannel:
    """A topic of a bag: its type as `package/msg/Name`, how it is written, and its definition."""

    topic: str
    kind: str
    encoding: Encoding
    definition: str = ""
    encoded: str = ""  # as the file names the encoding, where it is none that is read


def modern(kind: str) -> str:
    """`sensor_msgs/Imu` and `sensor_msgs::msg::Imu` as `sensor_msgs/msg/Imu`."""
    parts = [part for part in re.split(r"::|/", kind) if part]
    if len(parts) == 2:
        parts.insert(1, "msg")
    return "/".join(parts)


def stamp_of(channel: BagChannel, path: Path) -> tuple[str, StampOf] | None:
    """The name of the message's own stamp and how it is read; None where the type has none.

    Only a stamp at the very beginning counts, a header's or a time's: it is read without unpacking
    what follows.
    """
    if channel.encoding == "other":
        return None
    kind, name = _first_field(channel, path)
    if kind in HEADERS:
        at = _SEQ_BYTES if channel.encoding == "ros1" else 0
        return f"{name}.stamp", _reader(channel.encoding, at)
    if kind in TIMES and name in ("stamp", "timestamp"):
        return name, _reader(channel.encoding, 0)
    return None


def unread_of(channel: BagChannel, path: Path) -> str:
    """Why nobody can say whether messages of a channel carry a stamp; empty where it is known.

    A header at the beginning is read whatever a definition says of the rest.
    """
    if channel.encoding == "other" or not channel.definition.strip() or stamp_of(channel, path):
        return ""
    own = _own_store(channel, library("rosbags.typesys", path, "ROS bag"))
    return "" if own is not None else f"the definition of {channel.kind} cannot be read"


def _reader(encoding: Encoding, at: int) -> StampOf:
    """ROS 1: two unsigned numbers; CDR: four bytes of encapsulation, whose second is the order."""
    ros1 = struct.Struct("<II")
    orders = (struct.Struct(">iI"), struct.Struct("<iI"))
    shift = at + _ENCAPSULATION_BYTES

    def of_ros1(data: bytes) -> int:
        if len(data) < at + 8:
            return UNSET
        seconds, rest = ros1.unpack_from(data, at)
        return int(seconds) * _SECOND + int(rest)

    def of_cdr(data: bytes) -> int:
        if len(data) < shift + 8:
            return UNSET
        seconds, rest = orders[data[1] & 1].unpack_from(data, shift)
        return int(seconds) * _SECOND + int(rest)

    return of_ros1 if encoding == "ros1" else of_cdr


def _first_field(channel: BagChannel, path: Path) -> tuple[str, str]:
    if channel.definition:
        text = channel.definition[:LONGEST_DEFINITION]
        if "struct " in text and "module " in text:
            return _first_of_idl(text, channel.kind.rpartition("/")[2])
        return _first_of_msg(text)
    defs = _standard(channel.encoding, path).fielddefs.get(channel.kind)
    if not defs or not defs[1]:
        return "", ""
    name, (_, kind) = defs[1][0]
    return (kind, name) if isinstance(kind, str) else ("", name)


def _first_of_msg(text: str) -> tuple[str, str]:
    for line in text.splitlines():
        if line.startswith("==="):
            break
        if "=" in line.partition("#")[0]:  # a constant
            continue
        field = _FIELD.match(line)
        if field:
            return field.group(1), field.group(2)
    return "", ""


def _first_of_idl(text: str, name: str) -> tuple[str, str]:
    body = re.search(rf"struct\s+{re.escape(name)}\s*\{{([^}}]*)\}}", text)
    for line in (body.group(1) if body else "").split(";"):
        bare = re.sub(r"@\w+\s*(?:\([^)]*\))?", "", line).split()
        if len(bare) == 2:
            return bare[0], bare[1]
    return "", ""


def _standard(encoding: Encoding, path: Path) -> Any:
    return _standard_store(encoding, library("rosbags.typesys", path, "ROS bag"))


@lru_cache(maxsize=4)
def _standard_store(encoding: Encoding, typesys: Any) -> Any:
    """The types that ROS itself brings along, for bags that define none."""
    stores = typesys.Stores
    store = stores.ROS1_NOETIC if encoding == "ros1" else stores.ROS2_HUMBLE
    return typesys.get_typestore(store)


@dataclass(frozen=True, slots=True, eq=False)
class MessageType:
    """A type of messages with its definition; definitions: of it and of all that it names."""

    kind: str
    encoding: Encoding
    definitions: Mapping[str, Any]
    unpack: Callable[[bytes], Any]

    def unpacked(self, data: bytes) -> Any:
        """The message, or None where its bytes are not of its type."""
        try:
            return self.unpack(data)
        except NoVerdict:  # the time is over, wherever the signal struck
            raise
        except Exception:  # the generated code raises whatever foreign bytes lead it to
            return None


def type_of(channel: BagChannel, path: Path) -> MessageType | None:
    """How a channel's messages are unpacked; None where the type is not known.

    The bag's own definition goes before that of ROS: a type may have changed since.
    """
    if channel.encoding == "other":
        return None
    typesys = library("rosbags.typesys", path, "ROS bag")
    store = _own_store(channel, typesys) or _standard(channel.encoding, path)
    kind = channel.kind
    if kind not in store.fielddefs:
        return None
    whole = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
    return MessageType(kind, channel.encoding, store.fielddefs, lambda data: whole(data, kind))


def _own_store(channel: BagChannel, typesys: Any) -> Any:
    return _store_of(channel.kind, channel.encoding, channel.definition, typesys)


@lru_cache(maxsize=64)  # making one compiles code
def _store_of(kind: str, encoding: Encoding, text: str, typesys: Any) -> Any:
    """A store of a bag's own definition alone; None where it has none that can be read."""
    if not text or len(text) > LONGEST_DEFINITION:
        return None
    try:
        if "struct " in text and "module " in text:
            found = typesys.get_types_from_idl(text)
        else:
            found = typesys.get_types_from_msg(text, kind)
        store = typesys.get_typestore(typesys.Stores.EMPTY)
        store.register(_with_headers(found, encoding, typesys))
        store.get_msgdef(kind)
    except NoVerdict:
        raise
    except Exception:  # whatever the parser of definitions says of a foreign text
        return None
    return store


def _with_headers(found: dict[str, Any], encoding: Encoding, typesys: Any) -> dict[str, Any]:
    """With the standard types that a definition names without giving them."""
    standard = _standard_store(encoding, typesys).fielddefs
    whole = dict(found)
    while True:
        missing = {name for _, fields in whole.values() for name in _names_of(fields)} - set(whole)
        known = missing & set(standard)
        if not known:
            return whole
        whole |= {name: standard[name] for name in known}


def _names_of(fields: Any) -> set[str]:
    """Types that fields name, within arrays too."""
    names = set()
    for _, (_, kind) in fields:
        inner = kind
        while isinstance(inner, tuple):  # (node, name) within (node, ((node, name), count))
            inner = inner[0] if isinstance(inner[0], tuple) else inner[1]
        if isinstance(inner, str) and "/" in inner:
            names.add(inner)
    return names
