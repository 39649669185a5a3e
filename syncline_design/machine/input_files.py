"""The files that a command reads: opened in one way, and every one of them noted.

Only plain files are opened: a pipe would wait for its writer for ever, a device has no end.  What
was read is noted where somebody asks for it: results are kept under the content of every file that
entered them, and no result may take the place of a file that the command reads.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import threading
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from dataclasses import field
from pathlib import Path

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record

Identity = tuple[int, int]  # device and inode: one file, whatever its names
MISSING = "missing"
PIECE_BYTES = 1 << 20  # that is held of a file while its digest is made


class UnsuitableError(Exception):
    """A file that is no plain file, or too large; the text says what it is."""


class ReplacedInputError(Exception):
    """A result would take the place of a file that the command reads."""


@dataclass(frozen=True, slots=True)
class FileRead(Record):
    """A file besides spec and shipped catalogs whose content entered a result.

    file: its name from the spec's folder.
    """

    file: str
    sha256: str


@dataclass(frozen=True, slots=True)
class FilePlace:
    """Where a name leads, all links followed: what is there, and its real path."""

    kind: str  # file, folder, other or `missing`
    real: Path | None = None

    def seen_from(self, folder: Path) -> str:
        """For comparison only: a link anywhere on the way that leads elsewhere shows in it.

        Relative to the real place of `folder`, so that a tree may move as a whole.
        """
        if self.real is None:
            return self.kind
        return f"{self.kind} {Path(os.path.relpath(self.real, folder.resolve())).as_posix()}"


@dataclass
class FilesRead:
    """What was looked for and read while this was asked for.

    contents: absolute path to the SHA-256 of what was read there.  places: absolute path as it was
    named, to where it led.  outputs: files that are to be written.
    """

    contents: dict[str, str] = field(default_factory=dict)
    places: dict[str, FilePlace] = field(default_factory=dict)
    identities: dict[Identity, str] = field(default_factory=dict)
    outputs: list[Path] = field(default_factory=list)

    def claim(self, outputs: Sequence[Path]) -> None:
        """Files that will be written; refused as soon as one of them is read, now or later."""
        self.outputs += outputs
        self.demand_apart()

    def add(self, path: Path, status: os.stat_result | None) -> None:
        """One more file that is read."""
        if status is not None and stat.S_ISREG(status.st_mode):
            self.identities.setdefault((status.st_dev, status.st_ino), str(path))
            self.demand_apart()

    def demand_apart(self) -> None:
        """Refuse when a file to be written is one that is read, by whatever name."""
        for output in self.outputs:
            identity = identity_of(output)
            read_as = self.identities.get(identity) if identity is not None else None
            if read_as is not None:
                shown = "" if Path(read_as) == output else f" (as {read_as})"
                raise ReplacedInputError(
                    f"{output}: is read by this command{shown}; write the result elsewhere"
                )


@dataclass(frozen=True, slots=True)
class FileContent:
    """A file as it was when it was read: whatever happens to it later, one run sees one content."""

    path: Path
    content: bytes = field(repr=False)

    def __str__(self) -> str:
        return str(self.path)


_ACTIVE: ContextVar[tuple[FilesRead, ...]] = ContextVar("files_read", default=())


@contextlib.contextmanager
def noting() -> Iterator[FilesRead]:
    """Note every file that this thread reads inside the block."""
    found = FilesRead()
    token = _ACTIVE.set((*_ACTIVE.get(), found))
    try:
        yield found
    finally:
        _ACTIVE.reset(token)


def claim_outputs(outputs: Sequence[Path]) -> None:
    """Say which files the running command will write; ReplacedInputError if it reads one."""
    for noted in _ACTIVE.get()[:1]:
        noted.claim(outputs)


def identity_of(path: Path) -> Identity | None:
    """Device and inode of a plain file, through symlinks; None where there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


def note_place(path: Path) -> None:
    """A file that was looked for under this name, whether it is there or not."""
    for noted in _ACTIVE.get():
        noted.places[str(path.absolute())] = place_of(path)
        with contextlib.suppress(OSError, ValueError):
            noted.add(path, path.stat())


def place_of(path: Path) -> FilePlace:
    """Where a name leads now."""
    try:
        real = path.resolve()
        mode = real.stat().st_mode
    except (OSError, RuntimeError, ValueError):
        return FilePlace(MISSING)
    kind = "file" if stat.S_ISREG(mode) else "folder" if stat.S_ISDIR(mode) else "other"
    return FilePlace(kind, real)


def note_content(path: Path, content: bytes, status: os.stat_result | None = None) -> None:
    """The bytes that were read from a file."""
    active = _ACTIVE.get()
    digest = hashlib.sha256(content).hexdigest() if active else ""
    for noted in active:
        noted.contents[str(path.absolute())] = digest
        noted.add(path, status)


def note_read(path: Path) -> None:
    """A file that another library reads."""
    with contextlib.suppress(OSError, ValueError):
        status = path.stat()
        for noted in _ACTIVE.get():
            noted.add(path, status)


def content_of(path: Path) -> str:
    """SHA-256 of a plain file, read in pieces; `missing` where there is none."""
    digest = hashlib.sha256()
    try:
        with _plain(path) as (descriptor, _):
            while piece := os.read(descriptor, PIECE_BYTES):
                digest.update(piece)
    except (OSError, UnsuitableError, ValueError):
        return MISSING
    return digest.hexdigest()


class ContentsBeside:
    """SHA-256 of files, made in a thread while the caller reads them for what they say."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = tuple(paths)
        self._digests: list[str] = []
        # a daemon: a call that ends early does not wait for it
        self._thread = threading.Thread(target=self._make, daemon=True)
        self._thread.start()

    def _make(self) -> None:
        for path in self._paths:
            self._digests.append(content_of(path))

    def reads(self) -> tuple[FileRead, ...]:
        """Every file by its content, in the order given."""
        self._thread.join()
        return tuple(
            FileRead(str(path), digest)
            for path, digest in zip(self._paths, self._digests, strict=True)
        )


def read_plain(path: Path, most: int | None = None) -> bytes:
    """Bytes of a plain file of at most `most` bytes; noted.

    Kind and size are looked at before anything is read: OSError, UnsuitableError.
    """
    content, status = _read(path, most)
    note_content(path, content, status)
    return content


def read_own(path: Path, most: int) -> bytes:
    """The same of a file that the program keeps for itself: not noted, as no user names it."""
    return _read(path, most)[0]


@contextlib.contextmanager
def _plain(path: Path) -> Iterator[tuple[int, os.stat_result]]:
    """A plain file as an open descriptor, and what it is."""
    # O_NONBLOCK: opening a FIFO would wait for its writer for ever.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    try:
        status = os.fstat(descriptor)
        demand_plain(status)
        yield descriptor, status
    finally:
        os.close(descriptor)


def _read(path: Path, most: int | None) -> tuple[bytes, os.stat_result]:
    with _plain(path) as (descriptor, status):
        if most is not None and status.st_size > most:
            raise UnsuitableError(f"{status.st_size} bytes; expected at most {most}")
        with os.fdopen(descriptor, "rb", closefd=False) as stream:
            content = stream.read() if most is None else stream.read(most + 1)
    if most is not None and len(content) > most:
        raise UnsuitableError(f"more than {most} bytes")
    return content, status


def demand_plain(status: os.stat_result) -> None:
    """UnsuitableError unless this is a plain file."""
    if stat.S_ISDIR(status.st_mode):
        raise UnsuitableError("a folder; expected a file")
    if not stat.S_ISREG(status.st_mode):
        raise UnsuitableError("not a regular file (a pipe, socket or device)")
