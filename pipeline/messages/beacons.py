"""Records of published logs of beacons as messages, advpipe_msgs/BeaconLog."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Protocol

import numpy as np

from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import BEACONS
from advpipe.pipeline.messages.types import message_class

_STATE = "advpipe_msgs/msg/BeaconState"


class LoggedBeacon(Protocol):
    """A record with the fields of the message, and the stamp of its header."""

    @property
    def stamp_ns(self) -> int:
        """Since 1970."""

    @property
    def state(self) -> Any:
        """A dataclass with the fields of advpipe_msgs/BeaconState."""

    @property
    def own_state(self) -> Any:
        """The same of the receiver."""


_FIELDS = (
    *("kind", "file", "place", "receiver", "sender", "pseudonym", "message", "receive_time", "send_time"),
    *("attacker", "rssi", "text"),
)


def beacon_log_message(record: LoggedBeacon) -> Any:
    """advpipe_msgs/BeaconLog of a record."""
    return message_class(BEACONS.type)(
        header=build.message_header(record.stamp_ns, ""),
        state=_state_message(record.state),
        own_state=_state_message(record.own_state),
        **{name: getattr(record, name) for name in _FIELDS},
    )


def _state_message(state: Any) -> Any:
    values = {each.name: np.array(getattr(state, each.name), np.float64) for each in fields(state)}
    return message_class(_STATE)(**values)
