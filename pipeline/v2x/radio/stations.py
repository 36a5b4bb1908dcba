"""Input and output of the medium: stations, transmissions, outcomes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.vehicle_loss import Bodies

Int64 = npt.NDArray[np.int64]
UInt64 = npt.NDArray[np.uint64]
UInt8 = npt.NDArray[np.uint8]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Stations:
    """The S radios on the road during one step.

    ids: (S,), unique; a radio's true number, whatever station ids its messages claim.
    antenna_m: (S, 3), places of the antennas in the map's frame. bodies: their vehicles, where they are
    obstacles.
    """

    ids: Int64
    antenna_m: Float64
    bodies: Bodies | None = None

    def __post_init__(self) -> None:
        if self.antenna_m.shape != (len(self.ids), 3) or not np.isfinite(self.antenna_m).all():
            raise ValueError(f"antenna_m must be finite and have the shape ({len(self.ids)}, 3)")
        if len(set(self.ids.tolist())) != len(self.ids):
            raise ValueError("two stations have the same id")

    def columns_of(self, ids: Int64) -> Int64:
        """The columns of these stations in `ids`; -1 for an unknown one."""
        if not len(self.ids):
            return np.full(len(ids), -1)
        order = np.argsort(self.ids, kind="stable")
        found = np.minimum(np.searchsorted(self.ids, ids, sorter=order), len(order) - 1)
        return np.where(self.ids[order[found]] == ids, order[found], -1)


@dataclass(frozen=True)
class Transmissions:
    """M messages that stations hand to their radios.

    messages: (M,), the caller's numbers for them, handed back in `ReceptionOutcomes`.
    keys: (M,), keys of their random draws; see `draws.message_keys`.
    senders: (M,), ids of the stations. request_ns: (M,), when they are handed to the radio.
    cam_bytes: (M,), length of each CAM. power_dbm: (M,), or None for the configured power.
    contents: M packets or messages, for a medium that carries their bytes; empty where nobody needs them.
    """

    messages: Int64
    keys: UInt64
    senders: Int64
    request_ns: Int64
    cam_bytes: Int64
    power_dbm: Float64 | None = None
    contents: tuple[bytes, ...] = ()

    def __post_init__(self) -> None:
        columns = (self.keys, self.senders, self.request_ns, self.cam_bytes, self.power_dbm)
        if any(column is not None and column.shape != self.messages.shape for column in columns):
            raise ValueError("the columns of the transmissions differ in length")

    def __len__(self) -> int:
        return len(self.messages)

    @classmethod
    def none(cls) -> Transmissions:
        """No transmissions."""
        empty = np.empty(0, np.int64)
        return cls(empty, empty.astype(np.uint64), empty, empty, empty)


class Outcome(IntEnum):
    """The outcome of a message at one station."""

    RECEIVED = 0
    OWN = 1
    """The station sent it itself."""
    SENDING = 2
    """The station was sending at that time (half duplex)."""
    WEAK = 3
    """Below the sensitivity."""
    BUSY = 4
    """The receiver was locked on to an earlier message, and this one too weak to capture it."""
    NOISE = 5
    """Bit errors, from noise alone."""
    INTERFERENCE = 6
    """Bit errors, from other messages on the air."""


RECEIVED: int = Outcome.RECEIVED.value
"""A plain number: numpy takes several times as long to compare arrays with a member of an enumeration."""


class Reception(NamedTuple):
    """One message that one station received."""

    message: int
    receiver: int
    arrival_ns: int
    power_dbm: float
    sinr_db: float


IN_ORDER = attrgetter("arrival_ns", "receiver", "message")
"""Of receptions: by arrival, and then by receiver."""

_reception: Callable[[tuple[int | float, ...]], Reception] = partial(tuple.__new__, Reception)
"""Without the call in Python that `Reception` itself takes."""


@dataclass(frozen=True)
class ReceptionOutcomes:
    """The outcomes of M messages at S stations.

    messages, senders, request_ns, start_ns, end_ns: (M,), in order of their ends: request, and start and end
    of transmission.
    receivers: (S,), ids. outcome: (M, S), `Outcome`. power_dbm, sinr_db, distance_m: (M, S).
    delay_ns: (M, S), from the end of a received message until it reaches the station's facilities; else 0.
    dropped: (D,), messages that were never sent: the channel was busy too long, or their sender has left.
    """

    messages: Int64
    senders: Int64
    request_ns: Int64
    start_ns: Int64
    end_ns: Int64
    receivers: Int64
    outcome: UInt8
    power_dbm: Float64
    sinr_db: Float64
    distance_m: Float64
    delay_ns: Int64
    dropped: Int64

    def receptions(self, receivers: Int64 | None = None) -> list[Reception]:
        """The receptions by these stations, or by all, in order of arrival."""
        columns = np.arange(len(self.receivers))
        if receivers is not None:
            columns = (self.receivers[:, None] == receivers).any(axis=1).nonzero()[0]
        row, nth = (self.outcome[:, columns] == RECEIVED).nonzero()
        column = columns[nth]
        place = row * len(self.receivers) + column
        values = (
            self.messages[row],
            self.receivers[column],
            self.end_ns[row] + self.delay_ns.take(place),
            self.power_dbm.take(place),
            self.sinr_db.take(place),
        )
        found = [*map(_reception, zip(*(value.tolist() for value in values), strict=True))]
        return sorted(found, key=IN_ORDER)
