"""The labels of attacks on messages: a Parquet file beside the adversarial bag, one row per touched
message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.labels.columns import arrow_schema
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.growing_table import GrowingTable
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
from advpipe.pipeline.messages.debug import FALSE, NOT_SENT, TRUE, ClaimedPosition
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, Values, changed_fields, places_m, values
from advpipe.pipeline.v2x.facilities.effect import has_effect
from advpipe.pipeline.v2x.message_type import is_cam, message_type_of
from advpipe.stages.attack.v2x.base import MessageEditor, V2xAttack
from advpipe.stages.attack.v2x.bounds_check import BoundsCheck, Touched
from advpipe.stages.attack.v2x.cams import CamEditor, field_of
from advpipe.stages.attack.v2x.identities import StationIdentities

MOST_HELD_BACK = 10_000
"""Messages that a running graph's attacks may hold back and still send."""

_BLOCK = 1000
_NOTHING: Values = dict.fromkeys(FIELDS)
_SHOWN_HEIGHT_M = 1.0


class _Row(NamedTuple):
    """A touched message. before, true, false: the values before the attack, those of a genuine message, and
    those after the attack; None if there are none or the message is not a vehicle's CAM. mattered: None where
    the effect decides."""

    message: Sent
    time_ns: int
    attack: str
    part: str
    attacker: str
    sender: str
    action: str
    mattered: bool | None
    before: Values | None
    true: Values | None
    false: Values | None


class Labels:
    """Compares the messages before and after each editor.

    The columns of `v2x_labels.parquet`: `labels.messages.MESSAGE_COLUMNS`.

    grown: where rows go as they come, in bounded memory, instead of being sorted by time at the end; messages
    count as dropped then when more than `MOST_HELD_BACK` newer ones are held back.

    touching: indices of the editors that touched any message. counts: messages by type and action,
    and how many were CAMs before but no longer. Messages still held back when the file is
    written count as dropped. declared: declarations of attacks, by their indices among all editors.
    identities: what stations call themselves.
    """

    def __init__(
        self,
        cams: CamEditor,
        geodesy: Geodesy,
        names: dict[int, str],
        expiry_s: float,
        declared: Mapping[int, Declaration],
        identities: StationIdentities | None = None,
        grown: GrowingTable | None = None,
    ) -> None:
        self._grown = grown
        self.identities = StationIdentities() if identities is None else identities
        self.cams, self._geodesy, self._names, self._expiry_s = cams, geodesy, names, expiry_s
        self._rows: list[_Row] = []
        self._step_rows: list[_Row] = []
        self._step_held_back: list[tuple[str, Sent]] = []
        self._tables: list[Any] = []
        self._held_back: dict[tuple[int, int], Sent] = {}
        self._editors: list[MessageEditor] = []
        self._newest: dict[int, bytes] = {}
        self._step: dict[int, Sent] = {}
        self._step_cams: list[Sent] = []
        self._by_station: dict[int, list[Sent]] = {}
        self._bounds_check = BoundsCheck(geodesy, declared)
        self.touching: set[int] = set()
        self.counts: Counter[str] = Counter()

    def begin(self, recorded: Sequence[Sent]) -> None:
        """Start a step with its recorded messages."""
        for message in self._step_cams:
            self._newest[message.station_id] = message.payload
        self._step = {message.number: message for message in recorded}
        self._step_cams = [message for message in recorded if is_cam(message.payload)]
        self._by_station, self._step_rows, self._step_held_back = {}, [], []

    def compare(
        self, editor_index: int, editor: MessageEditor, before: Sequence[Sent], after: Sequence[Sent]
    ) -> None:
        """Label what the editor with this index did in the step. Raises AdvpipeError if it exceeded the
        bounds that it declares."""
        while len(self._editors) <= editor_index:
            self._editors.append(editor)
        olds = {message.number: message for message in before}
        attack = editor if isinstance(editor, V2xAttack) else None
        attacking = frozenset() if attack is None else attack.context.attacking
        for message in after:
            old = olds.pop(message.number, None)
            if old is None:
                self._add_new(editor_index, message)
            elif message is old or message == old:
                if (
                    attack is not None
                    and message.station_id in attacking
                    and self._is_corrupt(attack, message)
                ):
                    self._add(editor_index, CORRUPT, message, message, message.request_ns, message.payload)
            elif message.payload == old.payload and message.request_ns != old.request_ns:
                self._add(editor_index, DELAYED, message, old, old.request_ns, self._genuine(message))
            else:
                original = self._step.get(message.number, old)
                self._add(editor_index, CHANGED, message, old, original.request_ns, original.payload)
        for number, message in olds.items():
            self._held_back[editor_index, number] = message
            self._step_held_back.append((editor.name, message))
        self._bounds_check.refuse_beyond()
        while self._grown is not None and len(self._held_back) > MOST_HELD_BACK:
            self._add_dropped(*next(iter(self._held_back)))
        if len(self._rows) >= _BLOCK:
            self._close_block()

    def claims(self) -> list[tuple[int, ClaimedPosition]]:
        """The positions that the step's touched messages claim, and the true ones, each with the time when it
        is sent or would have been. CAMs give no height above the road; the markers have one of 1 m."""
        return [*self._not_sent(), *self._sent()]

    def _sent(self) -> list[tuple[int, ClaimedPosition]]:
        rows = self._step_rows
        true_m, false_m = (
            places_m(self._geodesy, [row.true for row in rows]),
            places_m(self._geodesy, [row.false for row in rows]),
        )
        found = []
        for row, *positions_m in zip(rows, true_m.T, false_m.T, strict=True):
            known_m = {
                role: np.append(position_m, _SHOWN_HEIGHT_M)
                for role, position_m in zip((TRUE, FALSE), positions_m, strict=True)
                if np.isfinite(position_m).all()
            }
            stated = row.false or row.true
            if known_m and stated is not None:
                claim = ClaimedPosition(int(stated["station_id"]), row.part or row.attack, known_m)
                found.append((row.message.request_ns, claim))
        return found

    def _not_sent(self) -> list[tuple[int, ClaimedPosition]]:
        """Where the stations are whose messages an attack dropped, or sends in a later step."""
        held = [(name, message, self._values(message.payload)) for name, message in self._step_held_back]
        points_m = places_m(self._geodesy, [stated for *_, stated in held]).T
        return [
            (
                message.request_ns,
                ClaimedPosition(
                    int(stated["station_id"]), name, {NOT_SENT: np.append(point_m, _SHOWN_HEIGHT_M)}
                ),
            )
            for (name, message, stated), point_m in zip(held, points_m, strict=True)
            if stated is not None and np.isfinite(point_m).all()
        ]

    def write(self, folder: Path) -> None:
        """Write the file, in order of time; messages that are still held back were dropped."""
        for key in tuple(self._held_back):
            self._add_dropped(*key)
            if len(self._rows) >= _BLOCK:
                self._close_block()
                self.cams.forget()
                self._step_rows.clear()
        self._close_block()
        if self._grown is not None:
            self._grown.close()
        else:
            self._write_sorted(folder)

    def _write_sorted(self, folder: Path) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pa.concat_tables(self._tables)
        order = [("time_ns", "ascending"), ("number", "ascending"), ("attack", "ascending")]
        pq.write_table(table.sort_by(order), folder / FILE)

    def _add_dropped(self, editor_index: int, number: int) -> None:
        message = self._held_back.pop((editor_index, number))
        self._add(editor_index, DROPPED, message, message, message.request_ns, message.payload)

    def _add_new(self, editor_index: int, message: Sent) -> None:
        held = self._held_back.pop((editor_index, message.number), None)
        genuine = self._genuine(message)
        if held is None:
            self._add(editor_index, ADDED, message, None, message.request_ns, genuine)
        else:
            self._add(editor_index, DELAYED, message, held, held.request_ns, genuine)

    def _is_corrupt(self, attack: V2xAttack, message: Sent) -> bool:
        if not attack.context.acts(message) or not is_cam(message.payload):
            return False
        return self.cams.open(message.payload) is None

    def _genuine(self, message: Sent) -> bytes | None:
        """The latest genuine message of the station that a message claims to be from."""
        tree = self.cams.open(message.payload)
        if tree is None:
            return None
        station_id = self.identities.radio_of(field_of(tree, "station_id"))
        payload = self._newest.get(station_id)
        for sent in self._recorded(station_id):
            if sent.request_ns <= message.request_ns:
                payload = sent.payload
        return payload

    def _recorded(self, station_id: int) -> Sequence[Sent]:
        """The station's CAMs of the step, as recorded."""
        if not self._by_station:
            for sent in self._step_cams:
                self._by_station.setdefault(sent.station_id, []).append(sent)
        return self._by_station.get(station_id, ())

    def _add(
        self,
        editor_index: int,
        action: str,
        message: Sent,
        old: Sent | None,
        time_ns: int,
        true: bytes | None,
    ) -> None:
        """old: the message before the editor. time_ns: when it was handed to the radio in the recording."""
        is_sent, before = action != DROPPED, None if old is None else old.payload
        sender, editor = self._names.get(message.station_id, ""), self._editors[editor_index]
        self.touching.add(editor_index)
        part = editor.part(message.station_id) if isinstance(editor, V2xAttack) else None
        before_values = self._values(before)
        true_values = before_values if true is before else self._values(true)
        false_values = self._values(message.payload if is_sent else None)
        row = _Row(
            message,
            time_ns,
            editor.name,
            "" if part in (None, editor) else part.name,
            "" if part is None else sender,
            sender,
            action,
            None if part is None else self._judged(part, message, true_values, false_values),
            before_values,
            true_values,
            false_values,
        )
        if is_sent:
            touched = Touched(editor_index, row.attack, row.part, message, old, row.before, row.false)
            self._bounds_check.note(touched)
        self._rows.append(row)
        self._step_rows.append(row)
        self.counts[f"{message_type_of(message.payload).codec.name}s {action}"] += 1
        self.counts["CAMs made invalid"] += is_sent and row.before is not None and row.false is None

    def _judged(
        self, part: V2xAttack, message: Sent, true: Values | None, false: Values | None
    ) -> bool | None:
        """Whether the attack, or its preset, says that the message matters; None if neither does."""
        if part.traits.every_message_matters or part.preset is None or true is None or false is None:
            return part.traits.every_message_matters or None
        payload = self._newest.get(message.station_id)
        for sent in self._recorded(message.station_id):
            if sent.request_ns < message.request_ns:
                payload = sent.payload
        return part.preset.matters(true, false, self._values(payload))

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
            "number": [row.message.number for row in rows],
            "station_id": [row.message.station_id for row in rows],
            "time_ns": [row.time_ns for row in rows],
            "sent_ns": [None if row.action == DROPPED else row.message.request_ns for row in rows],
            **{
                name: [getattr(row, name) for row in rows]
                for name in ("attack", "part", "attacker", "sender", "action")
            },
            "fields": [_changed_fields(row) for row in rows],
            "mattered": [self._mattered(row, moved) for row, moved in zip(rows, moved_m, strict=True)],
        }
        for state, points_m in (("true", true_m), ("false", false_m)):
            for axis, values_m in zip(AXES, points_m, strict=True):
                columns[f"{state}_{axis}"] = pa.array(values_m, pa.float64(), from_pandas=True)
            stated = [getattr(row, state) or _NOTHING for row in rows]
            columns |= {f"{state}_{field}": [one[field] for one in stated] for field in FIELDS}
        table = pa.Table.from_pydict(columns, arrow_schema(MESSAGE_COLUMNS))
        if self._grown is not None:
            self._grown.add_table(table)
        else:
            self._tables.append(table)

    def _mattered(self, row: _Row, moved_m: float) -> bool:
        if row.action == CORRUPT:
            return False
        if row.mattered is not None or row.action == DROPPED:
            return row.mattered is not False
        return has_effect(row.true, row.false, moved_m, self._expiry_s)


def _changed_fields(row: _Row) -> str:
    """The fields that this attack changed in the message that it received."""
    if row.action != CHANGED or row.before is None or row.false is None:
        return ""
    return changed_fields(row.before, row.false)
