"""What stations call themselves: their pseudonyms, as far as the drive has been read."""

from __future__ import annotations

from collections.abc import Iterable

from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.message_type import claimed_station_id


class StationIdentities:
    """The station ids in the recorded messages, which are true."""

    def __init__(self) -> None:
        self._newest: dict[int, int] = {}
        self._radios: dict[int, int] = {}

    def note(self, recorded: Iterable[Sent]) -> None:
        """Take in the recorded messages of a step."""
        for one in recorded:
            claimed = claimed_station_id(one.payload)
            if claimed is not None:
                self._newest[one.station_id] = claimed
                self._radios[claimed] = one.station_id

    def of(self, radio: int) -> int:
        """What the station with this radio calls itself now."""
        return self._newest.get(radio, radio)

    def radio_of(self, claimed: int) -> int:
        """The radio of the station that a message claims to be from."""
        return self._radios.get(claimed, claimed)
