"""The channel busy ratio: the share of the time that a station finds the channel taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.stations import Bool, Int64

Int32 = npt.NDArray[np.int32]

WINDOW_NS = 100_000_000
"""The measuring window (ETSI TS 102 687, T_CBR); windows begin at whole tenths of a second."""


@dataclass(frozen=True)
class ChannelLoad:
    """stations: (S,), ids. busy_ratio: (S,), over the window that ends at `end_ns`."""

    end_ns: int
    stations: Int64
    busy_ratio: Float64


def window_ends(first_ns: int, until_ns: int) -> range:
    """The ends of whole windows after `first_ns`, up to and including `until_ns`."""
    return range(first_ns - first_ns % WINDOW_NS + WINDOW_NS, until_ns + 1, WINDOW_NS)


def busy_ratio(frames: Sequence[RadioFrame], stations: int, end_ns: int) -> Float64:
    """The channel busy ratio (S,) over the window that ends at `end_ns`.

    frames: those sent before `end_ns` and on the air in the window, by start. A station counts what it
    receives at or above the carrier-sense threshold, -85 dBm in TS 102 687, and what it sends; overlaps count
    once.
    """
    if not frames:
        return np.zeros(stations)
    window_ns = end_ns - WINDOW_NS
    bounds_ns = [frame.start_ns for frame in frames], [frame.end_ns for frame in frames]
    within_ns = np.minimum(np.maximum(np.array(bounds_ns) - window_ns, 0), WINDOW_NS)
    start_ns, stop_ns = within_ns.astype(np.int32)
    hearing = np.array([frame.hearing for frame in frames])
    is_alone = np.ones(len(frames), np.bool_)
    follows = start_ns[1:] >= np.maximum.accumulate(stop_ns)[:-1]
    is_alone[1:] &= follows
    is_alone[:-1] &= follows
    alone_ns = ((stop_ns - start_ns) * is_alone).astype(np.float64) @ hearing  # whole, so exact
    (among,) = (~is_alone).nonzero()
    busy: Float64 = (alone_ns + _union_ns(start_ns[among], stop_ns[among], hearing[among])) / WINDOW_NS
    return busy


def _union_ns(start_ns: Int32, stop_ns: Int32, hearing: Bool) -> Int64:
    """How long each station (S,) hears any of messages (M,) that overlap, by start."""
    stop_ns = stop_ns[:, None] * hearing
    busy_ns = stop_ns - start_ns[:, None]
    taken_until_ns = np.maximum.accumulate(stop_ns)[:-1]
    np.minimum(busy_ns[1:], stop_ns[1:] - taken_until_ns, out=busy_ns[1:])
    union_ns: Int64 = np.maximum(busy_ns, 0).sum(axis=0)
    return union_ns
