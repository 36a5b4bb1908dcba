"""What a station sends beside CAMs: the facilities that generate messages of further types."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple, Protocol

from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.stages.simulate.traffic.road_users import RoadUser


class GeneratedMessage(NamedTuple):
    """A message, and when it is handed to the radio; cam: its values, if it is a CAM."""

    time_ns: int
    payload: bytes
    cam: Cam | None = None


class MessageService(Protocol):
    """A facility of one station that generates messages of one type (`MESSAGE_TYPES`)."""

    @property
    def is_active(self) -> bool:
        """Whether it needs the station's present pseudonym, as others know what it announces by that."""
        ...

    def rename(self, pseudonym: int) -> None:
        """Take the station's next pseudonym, and leave no trace of the last one."""
        ...

    def update(
        self, now_ns: int, state: StationState, user: RoadUser, drivers: Mapping[str, RoadUser]
    ) -> None:
        """Take in the station's own state, and the true state of all vehicles on the road, at this time.

        user: the station's vehicle.
        """
        ...

    def messages_before(self, end_ns: int) -> Iterator[GeneratedMessage]:
        """The messages generated since the last call and before this time, in the order of time."""
        ...
