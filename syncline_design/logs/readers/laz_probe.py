"""The points of a packed cloud, unpacked in a process of its own: damaged ones may end it.

lazrs 0.8.2 reads outside its memory where the layers of a chunk are damaged; a segmentation fault
cannot be caught, so it must not happen here.  What unpacked there comes over as it is.
"""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from syncline_design.machine.deadline import in_force
from syncline_design.machine.processes import python_command

CRASH: Final = "the library that unpacks its points crashes there"
LENGTH: Final = struct.Struct("<I")  # of a piece, which follows [bytes]
_TOLD: Final = (
    "from pathlib import Path; from syncline_design.logs.readers.las import tell; "
    "tell(Path(sys.argv[1]))"
)


class Outside:
    """Pieces of unpacked points; died: whether the process that unpacked them crashed."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.died = False

    def pieces(self) -> Iterator[bytes]:
        """Records as they unpack, up to the last piece that came whole."""
        command = [*python_command(_TOLD), str(self._path)]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        ) as unpacking:
            try:
                assert unpacking.stdout is not None
                while piece := _piece(unpacking.stdout):
                    in_force().check()
                    yield piece
                self.died = unpacking.wait() < 0
            except BaseException:
                unpacking.kill()
                raise


def _piece(source: IO[bytes]) -> bytes:
    """The next piece; empty at the end."""
    head = source.read(LENGTH.size)
    if len(head) < LENGTH.size:
        return b""
    (length,) = LENGTH.unpack(head)
    found = source.read(length)
    return found if len(found) == length else b""
