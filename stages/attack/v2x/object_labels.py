"""The labels of attacks on the objects in CPMs: which were added, removed or changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.labels.perceived_objects import (
    OBJECT_ADDED,
    OBJECT_CHANGED,
    OBJECT_REMOVED,
    write_object_labels,
)
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.facilities.cpm_tree import decode_cpm
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject, heard_objects
from advpipe.pipeline.v2x.message_type import CPM, message_type_of


class ObjectLabels:
    """Compares the objects in CPMs before and after each editor."""

    def __init__(self, geodesy: Geodesy) -> None:
        self._geodesy = geodesy
        self._rows: list[dict[str, Any]] = []

    def compare(self, attack: str, before: Sequence[Sent], after: Sequence[Sent]) -> None:
        """Label what the editor of this name did in a step."""
        olds = {one.number: one for one in before}
        for one in after:
            old = olds.get(one.number)
            if old is not None and old.payload != one.payload and message_type_of(one.payload) is CPM:
                self._rows += self._changes(attack, old, one)

    def write(self, folder: Path) -> None:
        """Write the file, if any object was touched, in order of time."""
        if self._rows:
            ordered = sorted(self._rows, key=lambda row: (row["time_ns"], row["number"], row["object_id"]))
            write_object_labels(folder, ordered)

    def _changes(self, attack: str, old: Sent, new: Sent) -> Iterator[dict[str, Any]]:
        true, false = self._objects(old.payload), self._objects(new.payload)
        for object_id in sorted({*true, *false}):
            was, now = true.get(object_id), false.get(object_id)
            if was == now:
                continue
            action = OBJECT_ADDED if was is None else OBJECT_REMOVED if now is None else OBJECT_CHANGED
            yield {
                "number": new.number,
                "station_id": new.station_id,
                "time_ns": new.request_ns,
                "attack": attack,
                "action": action,
                "object_id": object_id,
                "true_x_m": None if was is None else was.centre_m[0],
                "true_y_m": None if was is None else was.centre_m[1],
                "false_x_m": None if now is None else now.centre_m[0],
                "false_y_m": None if now is None else now.centre_m[1],
            }

    def _objects(self, payload: bytes) -> dict[int, HeardObject]:
        try:
            found = heard_objects(decode_cpm(payload), self._geodesy) or []
        except MessageError:
            found = []
        return {one.object_id: one for one in found}
