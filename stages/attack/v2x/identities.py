"""What stations call themselves: their pseudonyms, as far as the drive has been read."""

from __future__ import annotations

from collections.abc import Iterable

from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.message_type import HEADER_BYTES, claimed_station_id

_MESSAGE = 2
"""Bytes of the header ahead of the station id."""


class StationIdentities:
    """The station ids in the recorded messages, which are true."""

    def __init__(self) -> None:
        self._newest: dict[int, bytes] = {}
        self._radios: dict[bytes, int] = {}

    def note(self, recorded: Iterable[Sent]) -> None:
        """Take in the recorded messages of a step."""
        for one in recorded:
            if len(one.payload) >= HEADER_BYTES:
                self._newest[one.station_id] = one.payload
                self._radios[one.payload[_MESSAGE:HEADER_BYTES]] = one.station_id

    def of(self, radio: int) -> int:
        """What the station with this radio calls itself now."""
        claimed = claimed_station_id(self._newest.get(radio, b""))
        return radio if claimed is None else claimed

    def radio_of(self, claimed: int) -> int:
        """The radio of the station that a message claims to be from."""
        return self._radios.get(claimed.to_bytes(HEADER_BYTES - _MESSAGE, "big"), claimed)
