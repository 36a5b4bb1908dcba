"""What an attack may do to messages: anything beyond the bounds that it declares is refused."""

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
    """Follows what attacks did in the order of time; declared: by their places among all editors."""

    def __init__(self, geodesy: Geodesy, declared: Mapping[int, Declaration]) -> None:
        self._geodesy, self._declared = geodesy, declared
        self._added_ns: dict[tuple[int, int], deque[int]] = {}

    def refuse_beyond(
        self,
        place: int,
        attack: str,
        part: str,
        one: Sent,
        old: Sent | None,
        said: tuple[Values | None, Values | None],
    ) -> None:
        """Raises AdvpipeError where what an attack, or a part of it, made of a message is beyond its bounds.

        old: the message before, None for one that was added. said: what it says before and after.
        """
        declared = self._declared.get(place)
        terms = declared.part(part) if declared is not None and part else declared
        if terms is None or not terms.bounds:
            return
        if old is None:
            count = self._added_in_a_second(place, one)
            change = MessageChange(self._geodesy, added_in_a_second=count)
        else:
            change = MessageChange(self._geodesy, *said, (one.request_ns - old.request_ns) / NS_PER_S)
        for excess in excesses(change, terms.bounds, MESSAGE_QUANTITIES):
            raise AdvpipeError(f"{part or attack} went beyond its bounds: {excess}")

    def _added_in_a_second(self, place: int, one: Sent) -> int:
        """How many its radio has added by now, in the second that ends with this one."""
        times_ns = self._added_ns.setdefault((place, one.station_id), deque())
        times_ns.append(one.request_ns)
        while times_ns[0] <= one.request_ns - NS_PER_S:
            times_ns.popleft()
        return len(times_ns)
