"""Checks that attacks on messages stay within their declared bounds."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MessageChange
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_values import Values


class BoundsCheck:
    """Checks each touched message, in order of time. declared: by the attacks' indices among all editors."""

    def __init__(self, geodesy: Geodesy, declared: Mapping[int, Declaration]) -> None:
        self._geodesy, self._declared = geodesy, declared
        self._added_ns: dict[tuple[int, int], deque[int]] = {}

    def refuse_beyond(
        self,
        editor_index: int,
        attack: str,
        part: str,
        message: Sent,
        old: Sent | None,
        values: tuple[Values | None, Values | None],
    ) -> None:
        """Raise AdvpipeError if an attack, or a part of it, changed a message beyond its bounds.

        old: the message before the attack, None for an added one. values: of the message before and after.
        """
        declared = self._declared.get(editor_index)
        part_declared = declared.part(part) if declared is not None and part else declared
        if part_declared is None or not part_declared.bounds:
            return
        if old is None:
            count = self._added_in_a_second(editor_index, message)
            change = MessageChange(self._geodesy, added_in_a_second=count)
        else:
            change = MessageChange(self._geodesy, *values, (message.request_ns - old.request_ns) / NS_PER_S)
        for excess in excesses(change, part_declared.bounds, MESSAGE_QUANTITIES):
            raise AdvpipeError(f"{part or attack} went beyond its bounds: {excess}")

    def _added_in_a_second(self, editor_index: int, message: Sent) -> int:
        """How many messages the message's radio has added in the second that ends with this one."""
        times_ns = self._added_ns.setdefault((editor_index, message.station_id), deque())
        times_ns.append(message.request_ns)
        while times_ns[0] <= message.request_ns - NS_PER_S:
            times_ns.popleft()
        return len(times_ns)
