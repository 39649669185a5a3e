"""Trajectories of the visual and lidar odometry world: TUM, EuRoC and KITTI layouts.

TUM: `time x y z qx qy qz qw` in seconds, separated by blanks.  EuRoC: `time,x,y,z,qw,qx,qy,qz` in
nanoseconds, separated by commas, perhaps with velocity and biases behind, or rates and
accelerations of an IMU instead.  KITTI: twelve figures, the upper rows of a pose matrix, and no
time.  None of them says along which axes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts
from syncline_design.logs.readers.decimal_stamps import nanoseconds
from syncline_design.logs.readers.reader import BY_MAGIC, BY_SHAPE, NO, FileHead, Reader
from syncline_design.logs.readers.stream import UNSET, Recording, Timeline
from syncline_design.logs.readers.text_lines import (
    BadLineError,
    Damage,
    Line,
    demand_text,
    head_lines,
    line_blocks,
    usual_width,
)
from syncline_design.logs.readers.timelines import timeline_of
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

BY_HEADER = 2
PLACE = tuple(f"position_{a}_m" for a in "xyz")
XYZW = tuple(f"quaternion_{a}" for a in "xyzw")
WXYZ = tuple(f"quaternion_{a}" for a in "wxyz")
VELOCITY = tuple(f"velocity_{a}_mps" for a in "xyz")
RATE = tuple(f"rate_{a}_radps" for a in "xyz")
ACCELERATION = tuple(f"acceleration_{a}_mps2" for a in "xyz")
LENGTH_SLACK = 0.01  # of a quaternion; texts have at least four digits
EUROC_LEAST = 10**16  # stamps in nanoseconds; as seconds they would be 300 million years
NOT_SAID = "the file says neither its axes nor the body's: give log: {frame, body}"
HEADS = {  # names of EuRoC's headers, without unit, by what they begin with
    "p_": PLACE,
    "q_": WXYZ,
    "v_": VELOCITY,
    "w_": RATE,
    "a_": ACCELERATION,
}


@dataclass(frozen=True, slots=True)
class Layout:
    """What stands in a row, behind the time; a name that is empty is passed over."""

    kind: Literal["TUM", "EuRoC", "KITTI"]
    columns: tuple[str, ...]

    @property
    def cells(self) -> int:
        return len(self.columns) + (self.kind != "KITTI")


KITTI = Layout("KITTI", tuple(f"m{r}{c}" for r in range(3) for c in range(4)))
TUM = Layout("TUM", PLACE + XYZW)
BARE_EUROC = {  # by the number of cells, without a header
    8: PLACE + WXYZ,
    11: PLACE + WXYZ + VELOCITY,
    17: PLACE + WXYZ + VELOCITY + ("",) * 6,
    7: RATE + ACCELERATION,
    4: PLACE,
}


def cells_of(text: str) -> list[str]:
    """The cells of a row, separated by blanks or by commas."""
    return [c.strip() for c in text.split(",")] if "," in text else text.split()


def layout_of(lines: Sequence[str]) -> tuple[Layout, int] | None:
    """The layout of a trajectory and how sure it is; None where it is none."""
    comments = [line.lstrip("# \t") for line in lines if line.lstrip().startswith("#")]
    rows = [cells_of(line) for line in lines if not line.lstrip().startswith("#")][:50]
    width = usual_width([len(row) for row in rows])
    if 2 * sum(len(row) == width for row in rows) <= len(rows):  # some damaged rows are left out
        return None
    head = next((found for c in comments if (found := _euroc_head(c, width)) is not None), None)
    if head is not None:
        return head, BY_MAGIC
    known = [values for row in rows if len(row) == width and (values := _figures(row)) is not None]
    if 2 * len(known) <= len(rows):
        return None
    figures = np.array(known)
    bare = [line for line in lines if not line.lstrip().startswith("#")]
    commas = 2 * sum("," in line for line in bare) > len(bare)
    if commas and width in BARE_EUROC and np.median(figures[:, 0]) >= EUROC_LEAST:
        return _euroc_by_width(figures, width)
    if width == 12 and not commas and _are_rotations(figures):
        return KITTI, BY_SHAPE
    if width == 8 and not commas and _unit(figures[:, 4:]):
        order = _order(comments)
        return Layout("TUM", PLACE + order), BY_HEADER if comments else BY_SHAPE
    return None


def _figures(row: Sequence[str]) -> list[float] | None:
    """Finite figures of a row; None where a cell is none."""
    try:
        values = [float(cell) for cell in row]
    except ValueError:
        return None
    return values if all(math.isfinite(value) for value in values) else None


def _euroc_head(comment: str, width: int) -> Layout | None:
    """A header such as `#timestamp [ns],p_RS_R_x [m],...,q_RS_w [],...`."""
    names = [re.sub(r"\s*\[.*?\]\s*", "", cell).strip() for cell in comment.split(",")]
    if len(names) != width or not names[0].lower().startswith("timestamp") or width < 4:
        return None
    columns: list[str] = []
    for name in names[1:]:
        known = next((own for start, own in HEADS.items() if name.startswith(start)), ())
        ending = f"_{name[-1:]}"
        columns.append(next((own for own in known if _axis(own) == ending), ""))
    return Layout("EuRoC", tuple(columns)) if any(columns) else None


def _axis(name: str) -> str:
    """`_x` of position_x_m."""
    return f"_{name.split('_')[1]}"


def _euroc_by_width(figures: NDArray[np.float64], width: int) -> tuple[Layout, int] | None:
    columns = BARE_EUROC[width]
    if columns[3:7] == WXYZ and not _unit(figures[:, 4:8]):
        return None
    return Layout("EuRoC", columns), BY_HEADER


def _order(comments: Sequence[str]) -> tuple[str, ...]:
    """The order of a quaternion that a header names; xyzw where none does."""
    for comment in comments:
        last = [name.strip(",").lower() for name in comment.replace(",", " ").split()][-4:]
        axes = [name[-1:] for name in last]
        if sorted(axes) == ["w", "x", "y", "z"] and all(name.startswith("q") for name in last):
            return tuple(f"quaternion_{a}" for a in axes)
    return XYZW


def _unit(quaternions: NDArray[np.float64]) -> bool:
    """Whether they have length 1, rows of zeros (no attitude) and a few bad ones aside."""
    size = _sizes(quaternions)
    good = np.abs(size - 1) < LENGTH_SLACK
    none = size == 0
    most = 4 * np.count_nonzero(good | none) >= 3 * size.shape[0]
    return bool(most and 2 * np.count_nonzero(good) > size.shape[0])


def _sizes(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lengths; of figures that no quaternion has, some that are as wrong."""
    sizes: NDArray[np.float64] = np.linalg.norm(np.clip(quaternions, -1e9, 1e9), axis=1)
    return sizes


def _rotations(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of some 3 x 3 matrices turn, and neither mirror nor stretch."""
    turn = np.clip(matrices, -1e9, 1e9)
    product = turn @ np.swapaxes(turn, 1, 2)
    even = np.all(np.abs(product - np.eye(3)) < LENGTH_SLACK, axis=(1, 2))
    turns: NDArray[np.bool_] = even & (np.linalg.det(turn) > 0)
    return turns


def _are_rotations(rows: NDArray[np.float64]) -> bool:
    """Whether rows are the upper ones of pose matrices; a few may be damaged."""
    good = _rotations(rows.reshape(-1, 3, 4)[:, :, :3])
    return bool(4 * np.count_nonzero(good) >= 3 * good.shape[0])


def quaternions_of(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices (n, 3, 3) as quaternions (n, 4) wxyz, w >= 0.

    4 q q^T is linear in the matrix (Bar-Itzhack 2000); its largest column is q up to its length.
    """
    m = turn
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    outer = np.empty((m.shape[0], 4, 4))
    outer[:, 0] = np.stack(
        [
            1 + xx + yy + zz,
            m[:, 2, 1] - m[:, 1, 2],
            m[:, 0, 2] - m[:, 2, 0],
            m[:, 1, 0] - m[:, 0, 1],
        ],
        axis=1,
    )
    outer[:, 1] = np.stack(
        [outer[:, 0, 1], 1 + xx - yy - zz, m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0]], axis=1
    )
    outer[:, 2] = np.stack(
        [outer[:, 0, 2], outer[:, 1, 2], 1 - xx + yy - zz, m[:, 1, 2] + m[:, 2, 1]], axis=1
    )
    outer[:, 3] = np.stack(
        [outer[:, 0, 3], outer[:, 1, 3], outer[:, 2, 3], 1 - xx - yy + zz], axis=1
    )
    largest = np.argmax(np.diagonal(outer, axis1=1, axis2=2), axis=1)
    q = outer[np.arange(m.shape[0]), largest]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    signed: NDArray[np.float64] = np.where(q[:, :1] < 0, -q, q)
    return signed


class TrajectoryRecording(BatchRecording):
    """One trajectory, row by row."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            found = layout_of(head_lines(file.read(1 << 16)))
        if found is None:
            raise refuse(path, "no trajectory", expected="rows of a TUM, EuRoC or KITTI layout")
        self._layout = found[0]
        self.format = f"trajectory ({self._layout.kind} layout)"
        self._zeros = 0
        self._timeline: tuple[Timeline, tuple[str, ...]] = ("unknown", ())

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        rows, zeros, first, damage = 0, 0, None, Damage()
        timed = self._layout.kind != "KITTI"
        for block in line_blocks(self.path):
            read = list(self._rows(block, damage))
            if not read:
                continue
            rows += len(read)
            columns = self._columns(np.array([figures for _, figures in read]))
            zeros += int(np.count_nonzero(np.isnan(columns.get("quaternion_w", np.zeros(0)))))
            primary = np.array([stamp for stamp, _ in read], dtype=np.int64) if timed else None
            first = primary if first is None else first
            yield Batch(self.path.stem, len(read), primary, None, columns)
        if not rows:
            raise damage.refusal(self.path, "no row in the trajectory", "rows of figures")
        self._zeros = zeros
        if first is not None:
            self._timeline = timeline_of(first, "utc")
        if damage.said():
            self._cut(damage.said(), rows)

    def _rows(self, block: Sequence[Line], damage: Damage) -> Iterator[tuple[int, list[float]]]:
        """Time and figures of the rows of a block; what is none goes to the damage."""
        for line in block:
            if line.text.lstrip().startswith("#"):
                continue
            cells = cells_of(line.text)
            if not line.whole and len(cells) < self._layout.cells:
                damage.cut = line.text
                continue
            try:
                demand_text(line)
                yield self._row(cells)
            except BadLineError as error:
                damage.add(line, error)

    def _row(self, cells: Sequence[str]) -> tuple[int, list[float]]:
        kind, width = self._layout.kind, self._layout.cells
        if len(cells) != width:
            message = f"a row of {len(cells)} cells in a trajectory of {kind} layout"
            raise BadLineError(message, f"{width} cells")
        timed = kind != "KITTI"
        try:
            figures = [float(cell) for cell in cells[timed:]]
            return self._stamp(cells[0]) if timed else UNSET, figures
        except ValueError:
            raise BadLineError("text among numbers", "numbers only") from None

    def _stamp(self, text: str) -> int:
        return nanoseconds(text, "ns" if self._layout.kind == "EuRoC" else "s")

    def _columns(self, table: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        if self._layout.kind == "KITTI":
            poses = table.reshape(-1, 3, 4)
            turn = np.clip(poses[:, :, :3], -1e9, 1e9)
            q = np.where(_rotations(turn)[:, None], quaternions_of(turn), np.nan)
            columns = {name: poses[:, k, 3] for k, name in enumerate(PLACE)}
            return columns | {name: q[:, k] for k, name in enumerate(WXYZ)}
        columns = {name: table[:, k] for k, name in enumerate(self._layout.columns) if name}
        if set(WXYZ) <= set(columns):
            q = np.stack([columns[name] for name in WXYZ], axis=1)
            size = _sizes(q)
            lost = np.abs(size - 1) > 10 * LENGTH_SLACK
            with np.errstate(invalid="ignore", divide="ignore"):
                q = np.where(lost[:, None], np.nan, q / size[:, None])
            columns |= {name: q[:, k] for k, name in enumerate(WXYZ)}
        return columns

    def _facts(self, name: str) -> StreamFacts:
        columns = set(self._layout.columns) if self._layout.kind != "KITTI" else {*PLACE, *WXYZ}
        said = (
            ("position", PLACE),
            ("attitude", WXYZ),
            ("velocity", VELOCITY),
            ("rate", RATE),
            ("acceleration", ACCELERATION),
        )
        notes = [NOT_SAID]
        if "quaternion_w" in self._layout.columns:
            order = "".join(n[-1] for n in self._layout.columns if n.startswith("quaternion"))
            notes.append(f"quaternions were read in the order {order}")
        timeline, of_times = self._timeline
        kitti = self._layout.kind == "KITTI"
        if kitti:
            notes += ["the layout has no times: they are in another file, times.txt"]
            notes += ["pose matrices were made quaternions"]
        elif timeline == "utc":
            of_times = (*of_times, "stamps were taken to count from 1970-01-01 UTC")
        if self._zeros:
            what = "matrices that do not turn" if kitti else "quaternions without length"
            notes.append(f"{self._zeros} {what} were left out")
        return StreamFacts(
            quantity=tuple(what for what, names in said if set(names) <= columns),
            timeline=timeline,
            primary="timestamp",
            notes=tuple(notes),
            of_times=of_times,
            kind=f"{self._layout.kind} layout",
        )


def _recognises(head: FileHead) -> int:
    lines = head_lines(head.start)
    found = layout_of(lines) if lines else None
    return NO if found is None else found[1]


def _open(path: Path) -> Recording:
    return TrajectoryRecording(path)


READER = Reader("TUM, EuRoC or KITTI trajectory", _recognises, _open)
