"""The channel busy ratio: the share of the time that a station finds the channel taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.stations import Int64

WINDOW_NS = 100_000_000
"""The measuring window (ETSI TS 102 687, T_CBR); windows begin at whole tenths of a second."""


@dataclass(frozen=True)
class ChannelLoad:
    """stations: (S,), ids. busy_ratio: (S,), over the window that ends at `end_ns`."""

    end_ns: int
    stations: Int64
    busy_ratio: Float64


def busy_ratio(frames: Sequence[RadioFrame], stations: int, end_ns: int) -> Float64:
    """The channel busy ratio (S,) over the window that ends at `end_ns`.

    frames: those sent before `end_ns` and on the air in the window, by start. A station counts what it
    receives at or above the carrier-sense threshold, -85 dBm in TS 102 687, and what it sends; overlaps count
    once.
    """
    if not frames:
        return np.zeros(stations)
    window_ns = end_ns - WINDOW_NS
    hearing = np.array([frame.hearing for frame in frames])
    start_ns = np.array([max(frame.start_ns, window_ns) for frame in frames])[:, None]
    stop_ns = np.array([min(frame.end_ns, end_ns) for frame in frames])[:, None]
    stop_ns = np.where(hearing, stop_ns, window_ns)
    taken_until_ns = np.vstack([np.full((1, stations), window_ns), np.maximum.accumulate(stop_ns)[:-1]])
    busy_ns = np.maximum(stop_ns - np.maximum(start_ns, taken_until_ns), 0).sum(axis=0)
    busy: Float64 = busy_ns / WINDOW_NS
    return busy
