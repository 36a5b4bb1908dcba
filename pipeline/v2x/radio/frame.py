"""A message on its way through the radio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.stations import Bool, Int64

NOT_SENT = -1


@dataclass(slots=True, eq=False)
class RadioFrame:
    """power_dbm, distance_m: (S,), at each station. hearing: (S,), stations that sense the channel as busy.

    sender: column of the station, -1 once it has left. slots: remaining backoff slots. start_ns, end_ns: when
    the transmission starts and ends.
    """

    message: int
    key: int
    sender_id: int
    sender: int
    request_ns: int
    air_time_ns: int
    bits: int
    slots: int
    power_dbm: Float64
    distance_m: Float64
    hearing: Bool
    start_ns: int = NOT_SENT
    end_ns: int = NOT_SENT
    is_reported: bool = False

    @property
    def is_sent(self) -> bool:
        """Whether the radio sent the frame."""
        return self.start_ns != NOT_SENT

    def send(self, start_ns: int) -> None:
        """Start the transmission."""
        self.start_ns, self.end_ns = start_ns, start_ns + self.air_time_ns

    def rearrange(self, columns: Int64, sender: int) -> None:
        """Follow a change of the stations: `columns` (S,) are their former places, -1 for new ones."""
        self.sender = sender
        is_new = columns < 0
        self.power_dbm = np.where(is_new, -np.inf, np.append(self.power_dbm, -np.inf)[columns])
        self.distance_m = np.where(is_new, np.inf, np.append(self.distance_m, np.inf)[columns])
        self.hearing = ~is_new & np.append(self.hearing, False)[columns]
