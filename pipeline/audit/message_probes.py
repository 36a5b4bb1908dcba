"""The probes of received messages and of the ids that they claim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from advpipe.pipeline.audit.implied import BEGINS_TRUE
from advpipe.pipeline.audit.message_view import CHECK_S, MessageView, StationView
from advpipe.pipeline.audit.probe import Float64, Probe

_ADDED = ("messages_added_per_s",)
_TIMES = ("delay_s", "generation time")
_RATE = ("delay_s", *_ADDED)
_IDS = ("station id", *_ADDED)
_LENGTH = ("position",)
"""A CAM holds the path that its sender claims to have driven: false positions make another one, of other
length, which takes other microseconds on the air. An id that sends once, or that stands, has CAMs with or
without that path alone, so that ids which do not exist tell by their median; a message by itself does not."""
_AGE = (*_IDS, *_TIMES, BEGINS_TRUE)
"""Who sends old messages, or delays them, has to have some first."""


def _off_check(interval_s: Float64) -> Float64:
    """How far intervals (N,) are from a multiple of the check interval."""
    return np.abs(interval_s - np.rint(interval_s / CHECK_S) * CHECK_S)


MESSAGE_PROBES: tuple[Probe[MessageView], ...] = (
    Probe("bytes", "message", "bytes of the message", lambda v: v.length, _LENGTH),
    Probe("interval", "message", "time since the id's last message",
          lambda v: v.interval_s, _RATE),
    Probe("interval-phase", "message", "distance of that time from multiples of 100 ms",
          lambda v: _off_check(v.interval_s), (*_RATE, *_LENGTH)),
    Probe("rate", "message", "messages of the id in one second", lambda v: v.rate_hz, _RATE),
    Probe("phase", "message", "arrival within 100 ms", lambda v: (v.arrival_ns % 100_000_000) / 1e9),
    Probe("digits", "message", "arrival within a microsecond", lambda v: v.arrival_ns % 1000 / 1e9),
    Probe("lag", "message", "time from the stated generation to the arrival", lambda v: v.lag_s, _TIMES),
    Probe("coincidence", "message", "time to the nearest other message", lambda v: v.gap_s, _ADDED),
    Probe("id", "message", "the id as a number", lambda v: v.station.astype(np.float64), _IDS),
    Probe("id-age", "message", "time since the id was first heard", lambda v: v.age_s, _AGE),
    Probe("order", "message", "place among all messages",
          lambda v: np.arange(len(v.station)) / max(len(v.station), 1)),
    Probe("equal-bodies", "message", "messages with the same bytes behind the header",
          lambda v: v.same_body, _IDS),
)  # fmt: skip

CPM_PROBES: tuple[Probe[MessageView], ...] = tuple(
    replace(probe, unit="cpm", implied_by=("perceived objects",) if probe.name == "bytes" else ())
    for probe in MESSAGE_PROBES
    if probe.name not in ("lag", "equal-bodies")
)
"""The same of CPMs, but what reads the time of generation, which stands elsewhere in them. Attacks on CPMs
change the objects that they report, and with them their bytes; nothing else is implied."""

STATION_PROBES: tuple[Probe[StationView], ...] = (
    Probe("id", "station", "the id as a number",
          lambda v: v.each(v.messages.station.astype(np.float64)), _IDS),
    Probe("messages", "station", "number of messages",
          lambda v: v.count, _RATE),
    Probe("bytes", "station", "median bytes of a message",
          lambda v: v.each(v.messages.length), (*_IDS, *_LENGTH)),
    Probe("bytes-spread", "station", "spread of the bytes",
          lambda v: v.spread(v.messages.length), (*_IDS, *_LENGTH)),
    Probe("interval", "station", "median interval",
          lambda v: v.each(v.messages.interval_s), _RATE),
    Probe("interval-spread", "station", "spread of the intervals",
          lambda v: v.spread(v.messages.interval_s), _RATE),
    Probe("interval-phase", "station", "median distance of intervals from multiples of 100 ms",
          lambda v: v.each(_off_check(v.messages.interval_s)), _RATE),
    Probe("lag", "station", "median time from generation to arrival",
          lambda v: v.each(v.messages.lag_s), _TIMES),
    Probe("coincidence", "station", "median time to the nearest other message",
          lambda v: v.each(v.messages.gap_s), _ADDED),
)  # fmt: skip
