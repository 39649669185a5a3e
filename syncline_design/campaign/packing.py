"""Arrays as text, bit by bit, so that what a store keeps is what was computed."""

from __future__ import annotations

import base64
import binascii
import zlib

import numpy as np

from syncline_design.effects.record import Array

MOST_BYTES = 2**26  # of one array unpacked: a store is a file that anybody may have written


class PackingError(ValueError):
    """A text that holds no such array."""


def packed(array: Array) -> str:
    """Little-endian doubles, deflated, in base 64."""
    content = np.ascontiguousarray(array, dtype="<f8").tobytes()
    return base64.b64encode(zlib.compress(content, 6)).decode("ascii")


def unpacked(text: str, shape: tuple[int, ...]) -> Array:
    """The array of this shape; PackingError where the text holds another, or none."""
    wanted = 8 * int(np.prod(shape, dtype=np.int64))
    if wanted > MOST_BYTES:
        raise PackingError(f"an array of {wanted} bytes")
    try:
        stream = zlib.decompressobj()
        content = stream.decompress(base64.b64decode(text, validate=True), wanted + 1)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise PackingError(str(error)) from None
    if len(content) != wanted or not stream.eof:
        raise PackingError(f"{len(content)} bytes instead of {wanted}")
    found = np.frombuffer(content, dtype="<f8").reshape(shape).astype(np.float64)
    if not np.all(np.isfinite(found)):
        raise PackingError("a figure that is not finite")
    return found


def lower(matrices: Array) -> Array:
    """Lower triangles (..., p (p + 1) / 2) of symmetric matrices (..., p, p)."""
    rows, columns = np.tril_indices(matrices.shape[-1])
    taken: Array = matrices[..., rows, columns]
    return taken


def whole(triangles: Array, size: int) -> Array:
    """Symmetric matrices (..., p, p) of lower triangles."""
    rows, columns = np.tril_indices(size)
    found = np.zeros((*triangles.shape[:-1], size, size))
    found[..., rows, columns] = triangles
    found[..., columns, rows] = triangles
    return found
