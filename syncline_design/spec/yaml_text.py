"""YAML text to plain data with line and column; strict.

The tree is built from PyYAML's events (C parser where there is one), with the scalars of the
YAML 1.2 core schema: `1e-3` is a number, `NO` and `1:20` are text.  Refused, each with its
position: duplicate keys, keys that are not text, aliases, anchors, tags, merge keys, directives,
nesting deeper than 64, more than one document, invisible control characters.
Sequences become tuples, decimals become `Number`, which keeps the digits as written.
"""

from __future__ import annotations

import hashlib
import importlib
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any

import yaml

from syncline_design.machine.input_files import UnsuitableError, read_plain
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.streams import harmless
from syncline_design.spec.yaml_scalars import Number as Number
from syncline_design.spec.yaml_scalars import plain_scalar as plain_scalar

MAX_DEPTH = 64
MAX_PROBLEMS = 500  # then reading stops
MAX_BYTES = 3 * 2**19  # 1.5 MiB: one MiB is honest work, two are not

KeyPath = tuple[str | int, ...]
TextPosition = tuple[int, int]

_CParser: Any = None  # stays so where PyYAML was built without libyaml
with suppress(ImportError):
    _CParser = importlib.import_module("yaml._yaml").CParser

_BIDI = "\u202a-\u202e\u2066-\u2069"
_SEPARATORS = "\x85\u2028\u2029"  # line breaks to YAML 1.1 only: positions would be off
_RAW_REFUSED = re.compile(f"[\x00-\x08\x0b-\x1f\x7f-\x84\x86-\x9f\ufffe\uffff{_BIDI}{_SEPARATORS}]")
_VALUE_REFUSED = re.compile(f"[\x00\ud800-\udfff\ufffe\uffff{_BIDI}]")


@dataclass(frozen=True, slots=True)
class Flaw:
    """One thing wrong with a file: where, what, what was expected and found, what to do."""

    file: str
    line: int
    column: int
    path: str
    message: str
    expected: str = ""
    found: str = ""
    hint: str = ""

    def __str__(self) -> str:
        """`file:line:col: path: message; expected X, found Y; hint`."""
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        parts = [
            f"{place}: {self.path}: {self.message}" if self.path else f"{place}: {self.message}"
        ]
        if self.expected:
            parts.append(f"expected {self.expected}")
            parts[-1] += f", found {self.found}" if self.found else ""
        elif self.found:
            parts.append(f"found {self.found}")
        if self.hint:
            parts.append(self.hint)
        return harmless("; ".join(parts), one_line=True)


@dataclass(frozen=True)
class ParsedFile:
    """One file as plain data.

    positions: key path to (line, column) of the value; key_positions: of the key.  Both from 1.
    problems: what was refused; where data is None nothing could be read, where sha256 is empty
    the file was not even opened.
    """

    file: str
    data: Any
    positions: dict[KeyPath, TextPosition]
    key_positions: dict[KeyPath, TextPosition]
    sha256: str
    text: str = field(repr=False)
    problems: tuple[Flaw, ...] = ()
    problem_paths: tuple[KeyPath, ...] = ()

    def position(self, path: KeyPath) -> TextPosition:
        """Where a key path is, or the nearest thing around it."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.positions:
                return self.positions[path[:length]]
        return (1, 1)


def show_path(path: KeyPath) -> str:
    """`stages[0].position.sensor`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else printable(part)
    return text


def printable(text: str, limit: int = 60) -> str:
    """Text for one line of a message: control characters escaped, length bounded."""
    short = text if len(text) <= limit else text[: limit - 3] + "..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in short)


class StopReadingError(Exception):
    """Reading cannot go on."""


def read(path: str | Path, shown_as: str | None = None) -> ParsedFile:
    """Read one YAML file; problems are in the document, never an exception."""
    file = str(shown_as or path)
    try:
        raw = read_bytes(Path(path))
    except OSError as error:
        reason = error.strerror or str(error)
        return _unreadable(Flaw(file, 1, 1, "", f"cannot read the file: {reason.lower()}"))
    except StopReadingError as refused:
        return _unreadable(Flaw(file, 1, 1, "", str(refused)))
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return _unreadable(_encoding_problem(file, raw, error), hashlib.sha256(raw).hexdigest())
    return parse(text, file)


def _unreadable(problem: Flaw, sha256: str = "") -> ParsedFile:
    return ParsedFile(problem.file, None, {}, {}, sha256, "", (problem,), ((),))


def read_bytes(path: Path) -> bytes:
    """Bytes of a regular file of acceptable size; size and kind are looked at before reading."""
    try:
        return read_plain(path, MAX_BYTES)
    except UnsuitableError as error:
        raise StopReadingError(str(error)) from None


def _encoding_problem(file: str, raw: bytes, error: UnicodeDecodeError) -> Flaw:
    before = raw[: error.start].decode("utf-8", "replace")
    line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
    byte = raw[error.start]
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        guess = "UTF-16"
    elif raw[error.start : error.start + 2] and byte == 0xED:
        guess = "surrogates encoded as UTF-8 (CESU-8)"
    else:
        guess = "Latin-1 (ISO 8859-1) or Windows-1252"
    return Flaw(
        file, line, column, "", "not UTF-8", "UTF-8", f"byte 0x{byte:02x}, probably {guess}",
        "save the file as UTF-8",
    )  # fmt: skip


def parse(text: str, file: str = "<text>") -> ParsedFile:
    """Parse YAML text; line ends and a byte-order mark do not change data or hash."""
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    builder = _Builder(file)
    try:
        _refuse_characters(text, builder)
        data = builder.build(_events(text))
    except StopReadingError:
        data = None
    except yaml.YAMLError as error:
        builder.refuse_syntax(error, text)
        data = None
    return ParsedFile(
        file,
        data,
        builder.positions,
        builder.key_positions,
        digest,
        text,
        tuple(builder.problems),
        tuple(builder.problem_paths),
    )


def _events(text: str) -> Iterator[Any]:
    """The events of a document.

    Nothing is tidied up at the end: it would run wherever a generator that was left is collected.
    """
    parser: Any = _CParser(text) if _CParser is not None else _PythonParser(text)
    while parser.check_event():
        yield parser.get_event()


class _PythonParser(yaml.reader.Reader, yaml.scanner.Scanner, yaml.parser.Parser):
    """The same events where PyYAML was built without libyaml."""

    def __init__(self, text: str) -> None:
        yaml.reader.Reader.__init__(self, text)
        yaml.scanner.Scanner.__init__(self)
        yaml.parser.Parser.__init__(self)


def _refuse_characters(text: str, builder: _Builder) -> None:
    found = False
    for match in _RAW_REFUSED.finditer(text):
        found = True
        start = match.start()
        line = text.count("\n", 0, start) + 1
        column = start - (text.rfind("\n", 0, start) + 1) + 1
        kind = "a bidirectional override" if re.match(f"[{_BIDI}]", match[0]) else "a character"
        builder.refuse(
            (), (line, column), f"{kind} that does not show (U+{ord(match[0]):04X})",
            hint="delete it"
            + ("" if _VALUE_REFUSED.match(match[0]) else ", or escape it in a quoted text"),
        )  # fmt: skip
        if len(builder.problems) >= 20:
            break
    if found:
        raise StopReadingError


def _place(mark: Any) -> TextPosition:
    return (mark.line + 1, mark.column + 1)


class _Builder:
    """Builds the tree of one document from its events, noting positions and problems."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.positions: dict[KeyPath, TextPosition] = {}
        self.key_positions: dict[KeyPath, TextPosition] = {}
        self.problems: list[Flaw] = []
        self.problem_paths: list[KeyPath] = []

    def refuse(
        self, path: KeyPath, place: TextPosition, message: str, *, expected: str = "",
        found: str = "", hint: str = "",
    ) -> None:  # fmt: skip
        self.problems.append(
            Flaw(self.file, *place, show_path(path), message, expected, found, hint)
        )
        self.problem_paths.append(path)
        if len(self.problems) >= MAX_PROBLEMS:
            raise StopReadingError

    def build(self, events: Iterator[Any]) -> Any:
        data, seen = None, 0
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                seen += 1
                self._check_document(event, seen)
            elif isinstance(event, yaml.NodeEvent):
                data = self._node(event, events, (), 0)
        if not seen or (data is None and not self.problems):
            self.refuse((), (1, 1), "an empty file", expected="a mapping of keys and values")
            raise StopReadingError
        return data

    def _check_document(self, event: Any, seen: int) -> None:
        place = _place(event.start_mark)
        if seen > 1:
            self.refuse((), place, "a second document", expected="one document per file")
            raise StopReadingError
        if event.tags:
            self.refuse((), place, "a %TAG directive", expected="plain YAML")
        if event.version not in (None, (1, 2)):
            self.refuse((), place, "a %YAML directive", expected="YAML 1.2 or no directive")

    def _node(self, event: Any, events: Iterator[Any], path: KeyPath, depth: int) -> Any:
        place = _place(event.start_mark)
        self.positions[path] = place
        if isinstance(event, yaml.CollectionStartEvent) and depth >= MAX_DEPTH:
            self.refuse(path[:4], place, f"nested deeper than {MAX_DEPTH} levels")
            raise StopReadingError
        if isinstance(event, yaml.AliasEvent):
            self.refuse(path, place, f"an alias (*{event.anchor})", hint="write the value out")
            return None
        self._check_properties(event, path, place)
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, path, place)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(events, path, depth)
        return self._mapping(events, path, depth)

    def _check_properties(self, event: Any, path: KeyPath, place: TextPosition) -> None:
        if event.anchor is not None:
            self.refuse(path, place, f"an anchor (&{event.anchor})", hint="delete it")
        if event.tag is not None:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            self.refuse(path, place, f"a tag ({printable(tag)})", hint="delete it")

    def _scalar(self, event: Any, path: KeyPath, place: TextPosition) -> Any:
        if _VALUE_REFUSED.search(event.value):
            bad = _VALUE_REFUSED.search(event.value)
            code = ord(bad[0]) if bad else 0
            self.refuse(path, place, f"a character that no text may hold (U+{code:04X})")
            return None
        return event.value if event.style else plain_scalar(event.value)  # style: none if plain

    def _sequence(self, events: Iterator[Any], path: KeyPath, depth: int) -> tuple[Any, ...]:
        items: list[Any] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            items.append(self._node(event, events, (*path, len(items)), depth + 1))
        return tuple(items)

    def _mapping(self, events: Iterator[Any], path: KeyPath, depth: int) -> dict[str, Any]:
        entries: dict[str, Any] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            key = self._key(event, events, path, depth)
            value_path = (*path, "?" if key is None else key)
            if key is not None and key in entries:
                self._refuse_duplicate(value_path, _place(event.start_mark))
                key = None
            elif key is not None:
                self.key_positions[value_path] = _place(event.start_mark)
            first = self.positions.get(value_path)
            value = self._node(next(events), events, value_path, depth + 1)
            if key is not None:
                entries[key] = value
            elif first is not None:
                self.positions[value_path] = first
        return entries

    def _refuse_duplicate(self, path: KeyPath, place: TextPosition) -> None:
        line, column = self.key_positions[path]
        self.refuse(
            path, place, f"duplicate key; the first one is at line {line}, column {column}",
            hint="keep one of them",
        )  # fmt: skip

    def _key(self, event: Any, events: Iterator[Any], path: KeyPath, depth: int) -> str | None:
        """The text of a key, or None when it was refused."""
        place = _place(event.start_mark)
        if not isinstance(event, yaml.ScalarEvent):
            kind = {yaml.SequenceStartEvent: "a list", yaml.AliasEvent: "an alias"}
            found = kind.get(type(event), "a mapping")
            self.refuse(path, place, "a key that is not text", expected="text", found=found)
            self._skip(event, events, path, depth + 1)
            return None
        before = len(self.problems)
        self._check_properties(event, path, place)
        key = self._scalar(event, path, place)
        if len(self.problems) > before:
            return None
        if key == "<<" and not event.style:
            self.refuse(path, place, "a merge key (<<)", hint="write the keys out")
            return None
        if not isinstance(key, str) or not key:
            found = "nothing" if key is None or key == "" else event.value
            self.refuse(
                path, place, "a key that is not text", expected="text", found=printable(found)
            )
            return None
        return key

    def _skip(self, event: Any, events: Iterator[Any], path: KeyPath, depth: int) -> None:
        """Read past a node that has been refused already."""
        if isinstance(event, yaml.CollectionStartEvent):
            if depth > MAX_DEPTH:
                self.refuse(
                    path, _place(event.start_mark), f"nested deeper than {MAX_DEPTH} levels"
                )
                raise StopReadingError
            for inner in events:
                if isinstance(inner, yaml.CollectionEndEvent):
                    break
                self._skip(inner, events, path, depth + 1)

    def refuse_syntax(self, error: yaml.YAMLError, text: str) -> None:
        """A syntax error of the parser, in the words of this project."""
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        place = _place(mark) if mark is not None else (1, 1)
        lines = text.split("\n")
        line = lines[place[0] - 1] if place[0] <= len(lines) else ""
        if re.match(r" *\t", line):
            column = line.index("\t") + 1
            self.refuse((), (place[0], column), "a tab in the indentation", hint="use spaces")
            return
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        context = getattr(error, "context", None)
        message = f"{context}: {problem}" if context else str(problem)
        self.refuse((), place, f"not YAML: {printable(message, 120)}")
