"""What attacks did to which message, as Parquet beside the adversarial bag: one row a touched message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.air import Sent
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, Values, changed_fields, places_m, values
from advpipe.pipeline.v2x.facilities.effect import matters
from advpipe.stages.attack.v2x.base import MessageEditor, V2xAttack
from advpipe.stages.attack.v2x.cams import Cams, told

FILE_NAME = "v2x_labels.parquet"
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

    Columns of `v2x_labels.parquet`: `number` and `station_id` of the message as in /v2x/sent (the radio's,
    whatever is claimed), `time_ns` when it was handed to the radio (as recorded), `sent_ns` the same after
    the attack (null: never), `attack`, `part` (of a mix, the attack that its attacker carries out; else
    empty), `attacker` (the vehicle or roadside unit; empty where it is not the sender who lies, as with a
    spoofed GPS), `sender`, `action` (changed, added, delayed, dropped, or corrupt: no CAM, left as it is),
    `fields` that the attack changed, with commas between them ("other" for what has no column), `mattered`
    (see `pipeline/v2x/facilities/effect.py`), and `true_...` and `false_...` of each field of a CAM, with x
    and y in the map's frame.

    True values are those of the recorded message. Of one that was added or delayed, they are what the station
    that it claims to be from had said itself by then; null for a station that does not exist.

    touching: places, among all editors, of those that touched any message. counts: of the messages by
    action, and "made invalid": of those, how many were CAMs and no longer are.
    Those held back count as dropped once the file is written.
    """

    def __init__(self, cams: Cams, geodesy: Geodesy, names: dict[int, str], expiry_s: float) -> None:
        self.cams, self._geodesy, self._names, self._expiry_s = cams, geodesy, names, expiry_s
        self._rows: list[_Row] = []
        self._tables: list[Any] = []
        self._held: dict[tuple[int, int], Sent] = {}
        self._editors: list[MessageEditor] = []
        self._newest: dict[int, bytes] = {}
        self._step: dict[int, Sent] = {}
        self._by_station: dict[int, list[Sent]] = {}
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
        """What the editor, at this place among all, did in the step."""
        while len(self._editors) <= place:
            self._editors.append(editor)
        olds = {one.number: one for one in before}
        for one in after:
            old = olds.pop(one.number, None)
            if old is None:
                self._arrived(place, one)
            elif one is old or one == old:
                if isinstance(editor, V2xAttack) and self._is_corrupt(editor, one):
                    self._add(place, "corrupt", one, one.request_ns, one.payload, one.payload)
            elif one.payload == old.payload and one.request_ns != old.request_ns:
                self._add(place, "delayed", one, old.request_ns, old.payload, self._honest(one))
            else:
                original = self._step.get(one.number, old)
                self._add(place, "changed", one, original.request_ns, old.payload, original.payload)
        for number, one in olds.items():
            self._held[place, number] = one
        if len(self._rows) >= _BLOCK:
            self._close_block()

    def write(self, folder: Path) -> None:
        """Writes the file, in order of time; whatever is still held back by then was dropped."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        for (place, _), one in self._held.items():
            self._add(place, "dropped", one, one.request_ns, one.payload, one.payload, False)
            if len(self._rows) >= _BLOCK:
                self._close_block()
                self.cams.forget()
        self._held.clear()
        self._close_block()
        table = pa.concat_tables(self._tables)
        order = [("time_ns", "ascending"), ("number", "ascending"), ("attack", "ascending")]
        pq.write_table(table.sort_by(order), folder / FILE_NAME)

    def _arrived(self, place: int, one: Sent) -> None:
        held = self._held.pop((place, one.number), None)
        honest = self._honest(one)
        if held is None:
            self._add(place, "added", one, one.request_ns, None, honest)
        else:
            self._add(place, "delayed", one, held.request_ns, held.payload, honest)

    def _is_corrupt(self, attack: V2xAttack, one: Sent) -> bool:
        return attack.context.acts(one) and self.cams.open(one.payload) is None

    def _honest(self, one: Sent) -> bytes | None:
        """What the station that a message claims to be from has last said itself."""
        tree = self.cams.open(one.payload)
        if tree is None:
            return None
        station_id = told(tree, "station_id")
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
        time_ns: int,
        before: bytes | None,
        true: bytes | None,
        is_sent: bool = True,
    ) -> None:
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
            "number": pa.array([row.one.number for row in rows], pa.uint64()),
            "station_id": pa.array([row.one.station_id for row in rows], pa.uint32()),
            "time_ns": pa.array([row.time_ns for row in rows], pa.int64()),
            "sent_ns": pa.array(
                [None if row.action == "dropped" else row.one.request_ns for row in rows], pa.int64()
            ),
            **{
                name: pa.array([getattr(row, name) for row in rows], pa.string())
                for name in ("attack", "part", "attacker", "sender", "action")
            },
            "fields": pa.array([_changed(row) for row in rows], pa.string()),
            "mattered": pa.array(
                [self._mattered(row, moved) for row, moved in zip(rows, moved_m, strict=True)], pa.bool_()
            ),
        }
        for kind, kind_m in (("true", true_m), ("false", false_m)):
            for axis, values_m in zip(("x_m", "y_m"), kind_m, strict=True):
                columns[f"{kind}_{axis}"] = pa.array(values_m, pa.float64(), from_pandas=True)
            for field in FIELDS:
                column = [None if (said := getattr(row, kind)) is None else said[field] for row in rows]
                columns[f"{kind}_{field}"] = pa.array(column, _column_type(field))
        self._tables.append(pa.table(columns))

    def _mattered(self, row: _Row, moved_m: float) -> bool:
        if row.action == "corrupt":
            return False
        if row.always_matters or row.action == "dropped":
            return True
        return matters(row.true, row.false, moved_m, self._expiry_s)


def _changed(row: _Row) -> str:
    """The fields that this attack changed, by what it was given."""
    if row.action != "changed" or row.before is None or row.false is None:
        return ""
    return changed_fields(row.before, row.false)


def _column_type(field: str) -> Any:
    import pyarrow as pa

    return pa.float64() if field.rpartition("_")[2] in _UNITS else pa.int64()


_UNITS = ("deg", "m", "rad", "mps", "mps2", "radps")
