"""What attacks did to which message, as Parquet beside the adversarial bag: one row a touched message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.labels.columns import arrow_schema
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.messages import (
    ADDED,
    AXES,
    CHANGED,
    CORRUPT,
    DELAYED,
    DROPPED,
    FILE,
    MESSAGE_COLUMNS,
)
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, Values, changed_fields, places_m, values
from advpipe.pipeline.v2x.facilities.effect import has_effect
from advpipe.stages.attack.v2x.base import MessageEditor, V2xAttack
from advpipe.stages.attack.v2x.bounds_check import BoundsCheck
from advpipe.stages.attack.v2x.cams import CamEditor, field_of

_BLOCK = 1000


class _Row(NamedTuple):
    """A touched message. before, true, false: what it said before the attack, what an honest one would have
    said, and what it says; None for what is no CAM, or nobody's."""

    one: Sent
    time_ns: int
    attack: str
    part: str
    attacker: str
    sender: str
    action: str
    always_matters: bool
    before: Values | None
    true: Values | None
    false: Values | None


class Labels:
    """Compares what editors get with what they hand on, message by message.

    The columns of `v2x_labels.parquet`: `labels.messages.MESSAGE_COLUMNS`.

    touching: places, among all editors, of those that touched any message. counts: of the messages by
    action, and "made invalid": of those, how many were CAMs and no longer are.
    Those held back count as dropped once the file is written. declared: what attacks declare, by their places
    among all editors.
    """

    def __init__(
        self,
        cams: CamEditor,
        geodesy: Geodesy,
        names: dict[int, str],
        expiry_s: float,
        declared: Mapping[int, Declaration],
    ) -> None:
        self.cams, self._geodesy, self._names, self._expiry_s = cams, geodesy, names, expiry_s
        self._rows: list[_Row] = []
        self._tables: list[Any] = []
        self._held: dict[tuple[int, int], Sent] = {}
        self._editors: list[MessageEditor] = []
        self._newest: dict[int, bytes] = {}
        self._step: dict[int, Sent] = {}
        self._by_station: dict[int, list[Sent]] = {}
        self._refusal = BoundsCheck(geodesy, declared)
        self.touching: set[int] = set()
        self.counts: Counter[str] = Counter()

    def begin(self, recorded: Sequence[Sent]) -> None:
        """A step, with what was recorded."""
        for station_id, messages in self._by_station.items():
            self._newest[station_id] = messages[-1].payload
        self._step = {one.number: one for one in recorded}
        self._by_station = {}
        for one in recorded:
            self._by_station.setdefault(one.station_id, []).append(one)

    def compare(
        self, place: int, editor: MessageEditor, before: Sequence[Sent], after: Sequence[Sent]
    ) -> None:
        """What the editor, at this place among all, did in the step. Raises AdvpipeError where that is beyond
        the bounds that it declares."""
        while len(self._editors) <= place:
            self._editors.append(editor)
        olds = {one.number: one for one in before}
        for one in after:
            old = olds.pop(one.number, None)
            if old is None:
                self._arrived(place, one)
            elif one is old or one == old:
                if isinstance(editor, V2xAttack) and self._is_corrupt(editor, one):
                    self._add(place, CORRUPT, one, one, one.request_ns, one.payload)
            elif one.payload == old.payload and one.request_ns != old.request_ns:
                self._add(place, DELAYED, one, old, old.request_ns, self._honest(one))
            else:
                original = self._step.get(one.number, old)
                self._add(place, CHANGED, one, old, original.request_ns, original.payload)
        for number, one in olds.items():
            self._held[place, number] = one
        if len(self._rows) >= _BLOCK:
            self._close_block()

    def write(self, folder: Path) -> None:
        """Writes the file, in order of time; whatever is still held back by then was dropped."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        for (place, _), one in self._held.items():
            self._add(place, DROPPED, one, one, one.request_ns, one.payload)
            if len(self._rows) >= _BLOCK:
                self._close_block()
                self.cams.forget()
        self._held.clear()
        self._close_block()
        table = pa.concat_tables(self._tables)
        order = [("time_ns", "ascending"), ("number", "ascending"), ("attack", "ascending")]
        pq.write_table(table.sort_by(order), folder / FILE)

    def _arrived(self, place: int, one: Sent) -> None:
        held = self._held.pop((place, one.number), None)
        honest = self._honest(one)
        if held is None:
            self._add(place, ADDED, one, None, one.request_ns, honest)
        else:
            self._add(place, DELAYED, one, held, held.request_ns, honest)

    def _is_corrupt(self, attack: V2xAttack, one: Sent) -> bool:
        return attack.context.acts(one) and self.cams.open(one.payload) is None

    def _honest(self, one: Sent) -> bytes | None:
        """What the station that a message claims to be from has last said itself."""
        tree = self.cams.open(one.payload)
        if tree is None:
            return None
        station_id = field_of(tree, "station_id")
        payload = self._newest.get(station_id)
        for said in self._by_station.get(station_id, ()):
            if said.request_ns <= one.request_ns:
                payload = said.payload
        return payload

    def _add(
        self,
        place: int,
        action: str,
        one: Sent,
        old: Sent | None,
        time_ns: int,
        true: bytes | None,
    ) -> None:
        """old: the message as the editor got it. time_ns: when it was handed to the radio, as recorded."""
        is_sent, before = action != DROPPED, None if old is None else old.payload
        sender, editor = self._names.get(one.station_id, ""), self._editors[place]
        self.touching.add(place)
        part = editor.part(one.station_id) if isinstance(editor, V2xAttack) else None
        row = _Row(
            one,
            time_ns,
            editor.name,
            "" if part in (None, editor) else part.name,
            "" if part is None else sender,
            sender,
            action,
            part is not None and part.traits.every_message_matters,
            said := self._values(before),
            said if true is before else self._values(true),
            self._values(one.payload if is_sent else None),
        )
        if is_sent:
            self._refusal.refuse_beyond(place, row.attack, row.part, one, old, (row.before, row.false))
        self._rows.append(row)
        self.counts[action] += 1
        self.counts["made invalid"] += is_sent and row.before is not None and row.false is None

    def _values(self, payload: bytes | None) -> Values | None:
        tree = None if payload is None else self.cams.open(payload)
        return None if tree is None else values(tree)

    def _close_block(self) -> None:
        import pyarrow as pa

        rows, self._rows = self._rows, []
        true_m, false_m = (
            places_m(self._geodesy, [row.true for row in rows]),
            places_m(self._geodesy, [row.false for row in rows]),
        )
        moved_m = np.hypot(*(true_m - false_m)).tolist()
        columns: dict[str, Any] = {
            "number": [row.one.number for row in rows],
            "station_id": [row.one.station_id for row in rows],
            "time_ns": [row.time_ns for row in rows],
            "sent_ns": [None if row.action == DROPPED else row.one.request_ns for row in rows],
            **{
                name: [getattr(row, name) for row in rows]
                for name in ("attack", "part", "attacker", "sender", "action")
            },
            "fields": [_changed_fields(row) for row in rows],
            "mattered": [self._mattered(row, moved) for row, moved in zip(rows, moved_m, strict=True)],
        }
        for kind, kind_m in (("true", true_m), ("false", false_m)):
            for axis, values_m in zip(AXES, kind_m, strict=True):
                columns[f"{kind}_{axis}"] = pa.array(values_m, pa.float64(), from_pandas=True)
            for field in FIELDS:
                columns[f"{kind}_{field}"] = [
                    None if (said := getattr(row, kind)) is None else said[field] for row in rows
                ]
        self._tables.append(pa.Table.from_pydict(columns, arrow_schema(MESSAGE_COLUMNS)))

    def _mattered(self, row: _Row, moved_m: float) -> bool:
        if row.action == CORRUPT:
            return False
        if row.always_matters or row.action == DROPPED:
            return True
        return has_effect(row.true, row.false, moved_m, self._expiry_s)


def _changed_fields(row: _Row) -> str:
    """The fields that this attack changed, by what it was given."""
    if row.action != CHANGED or row.before is None or row.false is None:
        return ""
    return changed_fields(row.before, row.false)
