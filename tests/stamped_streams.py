"""A stream of stamps and receipts as a sensor and a recorder left them, examined."""

from __future__ import annotations

import numpy as np

from syncline_design.auditing.series import Array
from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import Stamps, Stream

EPOCH_NS = 1_790_000_000 * 10**9


def of(stamp: Array, receive: Array) -> Examined:
    """Stamps and receipts (n,) [s] since EPOCH_NS, to the nanosecond."""
    stamps = (EPOCH_NS + np.rint(x * 1e9).astype(np.int64) for x in (stamp, receive))
    return examined(Stream("x", (), stamp.size, Stamps("header.stamp", "log time", *stamps)))
