"""Checks that attacks on messages stay within their declared bounds."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MessageChange
from advpipe.pipeline.labels.quantity import Range, excesses
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_values import Values, places_m


class Touched(NamedTuple):
    """A message that an attack, or a part of it, touched.

    old: the message before the attack, None for an added one. before, after: its values.
    """

    editor_index: int
    attack: str
    part: str
    message: Sent
    old: Sent | None
    before: Values | None
    after: Values | None


class BoundsCheck:
    """Checks all touched messages, in order of time; their places are computed together, a step at a time.

    declared: by the attacks' indices among all editors.
    """

    def __init__(self, geodesy: Geodesy, declared: Mapping[int, Declaration]) -> None:
        self._geodesy, self._declared = geodesy, declared
        self._added_ns: dict[tuple[int, int], deque[int]] = {}
        self._noted: list[tuple[Touched, Mapping[str, Range]]] = []

    def note(self, touched: Touched) -> None:
        """Note a message that is to be checked, if its attack declares bounds."""
        whole = self._declared.get(touched.editor_index)
        declared = whole.part(touched.part) if whole is not None and touched.part else whole
        if declared is not None and declared.bounds:
            self._noted.append((touched, declared.bounds))

    def refuse_beyond(self) -> None:
        """Raise AdvpipeError if a noted message was changed beyond its attack's bounds; forget them all."""
        noted, self._noted = self._noted, []
        if not noted:
            return
        both = [*(each.before for each, _ in noted), *(each.after for each, _ in noted)]
        both_m = places_m(self._geodesy, both)
        moved_m = np.hypot(*(both_m[:, len(noted) :] - both_m[:, : len(noted)])).tolist()
        for (touched, bounds), distance_m in zip(noted, moved_m, strict=True):
            for excess in excesses(self._change(touched, distance_m), bounds, MESSAGE_QUANTITIES):
                raise AdvpipeError(f"{touched.part or touched.attack} went beyond its bounds: {excess}")

    def _change(self, touched: Touched, moved_m: float) -> MessageChange:
        message, old = touched.message, touched.old
        if old is None:
            count = self._added_in_a_second(touched.editor_index, message)
            return MessageChange(self._geodesy, added_in_a_second=count)
        delay_s = (message.request_ns - old.request_ns) / NS_PER_S
        return MessageChange(self._geodesy, touched.before, touched.after, delay_s, moved_m=moved_m)

    def _added_in_a_second(self, editor_index: int, message: Sent) -> int:
        """How many messages the message's radio has added in the second that ends with this one."""
        times_ns = self._added_ns.setdefault((editor_index, message.station_id), deque())
        times_ns.append(message.request_ns)
        while times_ns[0] <= message.request_ns - NS_PER_S:
            times_ns.popleft()
        return len(times_ns)
