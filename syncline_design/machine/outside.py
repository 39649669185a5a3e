"""Libraries that a damaged file may bring down, at work in a process of their own.

A segmentation fault, an abort for want of memory and a trace on the error stream cannot be caught,
so they must not happen here.  The process answers requests, each by pieces of bytes; what came
whole before it ended is good.  Memory and processor time of it are bounded (where the system knows
such bounds), and it is gone when the one that started it is.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from queue import SimpleQueue
from typing import IO, Final

from syncline_design.machine.deadline import in_force
from syncline_design.machine.processes import python_command

MOST_MEMORY: Final = 4 * 2**30  # bytes
MOST_PIECE_S: Final = 300  # processor time until the next piece
_LENGTH: Final = struct.Struct("<q")  # of a piece, which follows [bytes]
_END: Final = -1  # in its place: the answer is complete

Answer = Callable[[bytes], Iterable[bytes]]


class Outside:
    """A process that answers by a function, named as `package.module:function`.

    gone: it takes no more requests.  died: it crashed (anything else that ended it was an error
    that Python knows).
    """

    def __init__(self, function: str) -> None:
        module, name = function.split(":")
        code = f"from {__name__} import serve; from {module} import {name}; serve({name})"
        self.gone = self.died = False
        self._process = subprocess.Popen(
            python_command(code),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self._ending = weakref.finalize(self, _ended, self._process)

    def pieces(self, request: bytes) -> Iterator[bytes]:
        """The answer, up to the last piece that came whole."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            with contextlib.suppress(BrokenPipeError):  # told by the answer
                _put(process.stdin, request)
            while (piece := _got(process.stdout)) is not None:
                in_force().check()
                yield piece
        except EOFError:
            self.gone, self.died = True, process.wait() < 0
            self.close()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process, whatever it does."""
        self.gone = True
        self._ending()


def _ended(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()


def serve(answer: Answer) -> None:
    """Answer the requests of standard input on standard output, until the input ends."""
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # what a library prints is no piece
        while True:
            request = requests.get()
            _bound()
            for piece in answer(request):
                _put(out, piece)
                _bound()
            out.write(_LENGTH.pack(_END))
            out.flush()


def _listen(requests: SimpleQueue[bytes]) -> None:
    """Hand requests over; the end of the input is the end of this process, even at work."""
    source = io.FileIO(sys.stdin.fileno(), closefd=False)  # a buffered one holds a lock at exit
    with contextlib.suppress(EOFError, OSError):
        while (request := _got(source)) is not None:
            requests.put(request)
    os._exit(0)


def _bound() -> None:
    """Set the bounds of memory and of processor time until the next piece; leave no dump."""
    try:
        import resource
    except ImportError:  # a system without such bounds
        return
    seconds = int(time.process_time()) + 1 + MOST_PIECE_S
    bounds = {"RLIMIT_CPU": seconds, "RLIMIT_DATA": MOST_MEMORY, "RLIMIT_CORE": 0}
    for name, most in bounds.items():
        kind = getattr(resource, name)
        _, hard = resource.getrlimit(kind)
        with contextlib.suppress(ValueError, OSError):
            soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(kind, (soft, hard))


def _put(stream: IO[bytes], piece: bytes) -> None:
    stream.write(_LENGTH.pack(len(piece)))
    stream.write(piece)
    stream.flush()


def _got(stream: IO[bytes] | io.FileIO) -> bytes | None:
    """The next piece; None at the end of an answer; EOFError where it does not come whole."""
    (length,) = _LENGTH.unpack(_exactly(stream, _LENGTH.size))
    return None if length == _END else _exactly(stream, length)


def _exactly(stream: IO[bytes] | io.FileIO, size: int) -> bytes:
    found = bytearray()
    while len(found) < size:
        part = stream.read(min(size - len(found), 2**24))
        if not part:
            raise EOFError
        found += part
    return bytes(found)
