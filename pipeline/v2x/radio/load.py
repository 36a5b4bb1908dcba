"""The channel busy ratio: the share of the time that a station finds the channel taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.frame import Frame
from advpipe.pipeline.v2x.radio.stations import Int64

WINDOW_NS = 100_000_000
"""Over which it is measured (ETSI TS 102 687, T_CBR); windows begin at whole tenths of a second."""


@dataclass(frozen=True)
class ChannelLoad:
    """stations: (S,), ids. busy_ratio: (S,), over the window that ends at `end_ns`."""

    end_ns: int
    stations: Int64
    busy_ratio: Float64


def busy_ratio(frames: Sequence[Frame], stations: int, end_ns: int) -> Float64:
    """The ratio (S,) over the window that ends then.

    frames: those sent before `end_ns` and on the air in the window, by start. A station counts what it hears
    at or above the carrier-sense threshold, -85 dBm in TS 102 687, and what it sends; overlaps count once.
    """
    busy_ns = np.zeros(stations, np.int64)
    taken_until_ns = np.full(stations, end_ns - WINDOW_NS)
    for frame in frames:
        stop_ns = min(frame.end_ns, end_ns)
        more_ns = np.where(frame.hearing, stop_ns - np.maximum(taken_until_ns, frame.start_ns), 0)
        busy_ns += np.maximum(more_ns, 0)
        np.maximum(taken_until_ns, stop_ns, out=taken_until_ns, where=frame.hearing)
    return busy_ns / WINDOW_NS
