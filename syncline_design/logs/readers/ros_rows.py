"""Messages of one topic on their way into pieces of columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.ros_columns import MessageForm, UnevenError
from syncline_design.logs.readers.ros_meaning import TopicMeaning
from syncline_design.logs.readers.ros_types import MessageType, StampOf
from syncline_design.logs.readers.stream import Piece, StampColumn
from syncline_design.machine.deadline import NoVerdict

PIECE_ROWS: Final = 20_000
MOST_WAITING: Final = 1 << 20  # bytes of messages whose figures are then taken at once
MOST_SHAPES: Final = 8  # of a topic's messages; what is of another is unpacked one by one

Table = NDArray[np.float64]  # (columns, messages)


class TopicRows:
    """Messages of one topic: their figures together where they are alike; NaN where there are none.

    own_of: how a message's own stamp is read; None where only its arrival is known.
    """

    def __init__(
        self, own_of: StampOf | None, meaning: TopicMeaning | None, type_: MessageType | None
    ) -> None:
        self.held = 0
        self._own_of = own_of
        self._names = () if meaning is None else meaning.columns
        self._figures = None
        if meaning is not None and type_ is not None and meaning.columns:
            self._figures = FiguresOf(meaning, type_)
        self._begin()

    def _begin(self) -> None:
        self.held, self._bytes = 0, 0
        self._waiting: list[bytes] = []
        self._tables: list[Table] = []
        self._primary, self._secondary = StampColumn(), StampColumn()

    def add(self, log_ns: int, data: bytes) -> None:
        if self._figures is not None:
            self._waiting.append(data)
            self._bytes += len(data)
            if self._bytes > MOST_WAITING:
                self._settle(self._figures)
        self._primary.append(log_ns if self._own_of is None else self._own_of(data))
        self._secondary.append(log_ns)
        self.held += 1

    def _settle(self, figures: FiguresOf) -> None:
        self._tables.append(figures.table(self._waiting))
        self._waiting, self._bytes = [], 0

    def piece(self) -> Piece:
        """What is held, which is then begun anew."""
        columns: Mapping[str, Any] = {}
        if self._figures is not None:
            self._settle(self._figures)
            table = np.concatenate(self._tables, axis=1)
            columns = dict(zip(self._names, table, strict=True))
        secondary = None if self._own_of is None else self._secondary.values()
        made = Piece(self._primary.values(), secondary, columns)
        self._begin()
        return made


class FiguresOf:
    """The figures of messages of one type, by shapes that were met before."""

    def __init__(self, meaning: TopicMeaning, type_: MessageType) -> None:
        self._meaning, self._type = meaning, type_
        self._width = len(meaning.columns)
        self._shapes: list[MessageForm] = []
        self._tried = 0

    def table(self, messages: list[bytes]) -> Table:
        """One row a column."""
        found = np.full((self._width, len(messages)), np.nan)
        lengths = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
        left = np.ones(len(messages), dtype=bool)
        for shape in self._shapes:
            self._fill(found, messages, left & (lengths == shape.length), shape, left)
        for k, data in enumerate(messages):
            if not left[k]:
                continue
            shape_or_none = self._new_shape(data)
            if shape_or_none is None:
                found[:, k] = self._alone(data)
                left[k] = False
            else:
                alike = left & (lengths == len(data))
                self._fill(found, messages, alike, shape_or_none, left)
        return found

    def _fill(
        self, found: Table, messages: list[bytes], likely: NDArray[np.bool_], shape: MessageForm,
        left: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """The figures of all messages of a shape among the likely ones, which then are not left."""
        places = np.flatnonzero(likely)
        if not places.shape[0]:
            return
        joined = b"".join([messages[k] for k in places])
        block = np.frombuffer(joined, dtype=np.uint8).reshape(-1, shape.length)
        alike = shape.alike(block)
        if not alike.all():
            places, block = places[alike], block[alike]
        found[:, places] = self._of(shape, block)
        left[places] = False

    def _of(self, shape: MessageForm, block: NDArray[np.uint8]) -> Table:
        with np.errstate(all="ignore"):
            row = self._meaning.row(shape.figures(block))
        return np.array([np.broadcast_to(v, block.shape[:1]) for v in row], dtype=float)

    def _new_shape(self, data: bytes) -> MessageForm | None:
        """The shape of a message, if its figures are the same as those unpacked."""
        if self._tried >= MOST_SHAPES:
            return None
        self._tried += 1
        try:
            shape = MessageForm(data, self._type.definitions, self._type.kind, self._type.encoding)
            mine = self._of(shape, np.frombuffer(data, dtype=np.uint8)[None, :])[:, 0]
        except (UnevenError, AttributeError, TypeError, ValueError):
            return None
        unpacked = self._type.unpacked(data)
        if unpacked is None or mine.tobytes() != self._row(unpacked).tobytes():
            return None
        self._shapes.append(shape)
        return shape

    def _alone(self, data: bytes) -> NDArray[np.float64]:
        """The figures of one message by itself."""
        unpacked = self._type.unpacked(data)
        return np.full(self._width, np.nan) if unpacked is None else self._row(unpacked)

    def _row(self, unpacked: Any) -> NDArray[np.float64]:
        try:
            with np.errstate(all="ignore"):
                row = np.array(self._meaning.row(unpacked), dtype=float)
        except NoVerdict:
            raise
        except Exception:  # a definition of its own may call anything by these names
            return np.full(self._width, np.nan)
        return row if row.shape == (self._width,) else np.full(self._width, np.nan)
