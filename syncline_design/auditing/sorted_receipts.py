"""Messages that a file has elsewhere because it is sorted by receipts, some of which are wrong.

A bag that was written anew lists messages by their receipts, so that none falls.  Stamps tell where
a message with a wrong one was: they fill a hole in the rhythm to the message, which a wrong stamp
does by chance alone.  A receipt before its message was measured is wrong, and so is one later than
any message is held up while others pass.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.measured_order import DEEPEST_NS
from syncline_design.auditing.order import without_unset
from syncline_design.auditing.series import Array, Mask, Series
from syncline_design.auditing.wrong_receipts import FAR_NS, MOST_IN_ROW, rising
from syncline_design.logs.readers.stream import Nanoseconds

_LEAST: Final = 40  # messages
_FITS: Final = 0.2  # of an interval: how near to the rhythm of a hole they are
_AROUND: Final = 60  # messages that tell how late others are
_FEW: Final = 0.01  # of all: of more stamps some that are wrong land where others are missing
_MOST: Final = 0.5  # of those out of order


def put_where_measured(series: Series) -> Series:
    """Messages whose receipts cannot be true put where their stamps fill a hole."""
    places = without_unset(series).series.places()
    if series.receive is None or places.size < _LEAST:
        return series
    stamp, receive = series.stamp[places], series.receive[places]
    late = receive - stamp
    if np.any(np.diff(receive) < 0):
        return series  # not sorted
    out = np.ones(places.size, bool)
    out[rising(stamp)] = False
    if not 0 < int(out.sum()) <= _FEW * places.size:
        return series
    key = np.arange(series.stamp.size, dtype=np.float64)
    put = _moved(key, places, ~out, stamp, late)
    if put <= _MOST * int(out.sum()):
        return series  # stamps that are wrong leave holes, too, which others of them fill
    order = np.argsort(key, kind="stable")
    return replace(series, stamp=series.stamp[order], receive=series.receive[order],
                   good=series.good[order])  # fmt: skip


def _moved(
    key: Array, places: NDArray[np.intp], right: Mask, stamp: Nanoseconds, late: Nanoseconds
) -> int:
    """How many were put into a hole; key: the message's place in the file, changed for these."""
    kept, others = np.flatnonzero(right), np.flatnonzero(~right)
    holes = np.searchsorted(stamp[kept], stamp[others])
    put = 0
    for at in np.unique(holes):
        own = others[holes == at]
        own = own[np.argsort(stamp[own], kind="stable")]
        near = kept[max(0, at - _AROUND) : at + _AROUND]
        if _fill(stamp[own], stamp[kept], at, stamp[near]) and _cannot_be(late[own], late[near]):
            before = key[places[kept[at - 1]]]
            key[places[own]] = before + np.arange(1, own.size + 1) / (own.size + 1.0)
            put += own.size
    return put


def _fill(own: Nanoseconds, kept: Nanoseconds, at: int, near: Nanoseconds) -> bool:
    """Whether stamps keep the rhythm between two of the others, which is broken without them."""
    if own.size > MOST_IN_ROW or not 0 < at < kept.size:
        return False
    whole = np.diff(np.concatenate([kept[at - 1 : at], own, kept[at : at + 1]]))
    usual = float(np.median(np.diff(near)))
    return bool(np.all(np.abs(whole - usual) < _FITS * usual))


def _cannot_be(late: Nanoseconds, near: Nanoseconds) -> bool:
    away = late - np.median(near)
    return bool(np.all(away > DEEPEST_NS) or np.all(away < -FAR_NS))
