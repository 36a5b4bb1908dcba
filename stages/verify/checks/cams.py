"""Whether labels of V2X messages tell exactly which were changed, and what they say now."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import V2X_SENT
from advpipe.pipeline.bag.v2x import sent_of_message
from advpipe.pipeline.v2x.cam import Cam
from advpipe.pipeline.v2x.cam_error import CamError
from advpipe.pipeline.v2x.cam_tree import decode_cam
from advpipe.stages.verify.checks.attacked import MESSAGE_LABELS, Attacked
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result
from advpipe.stages.verify.tables import rows

_FIELDS = (
    *("station_id", "station_type", "generation_delta_time_ms", "latitude_deg", "longitude_deg"),
    *("altitude_m", "heading_rad", "speed_mps", "length_m", "width_m", "yaw_rate_radps"),
    *("longitudinal_acceleration_mps2", "curvature_per_m", "acceleration_control"),
)
"""What labels repeat of a CAM, under `false_...` as it is now; `true_...` of a changed one is as it was."""

_COLUMNS = (
    *("number", "station_id", "action", "time_ns", "sent_ns"),
    *(f"{kind}_{name}" for kind in ("true", "false") for name in _FIELDS),
)
_Values = tuple[Any, ...]


class _Message(NamedTuple):
    """A message of /v2x/sent: who sent it, when, and a digest of its bytes."""

    station_id: int
    request_ns: int
    digest: bytes


class _Label(NamedTuple):
    """The last row about a message, and whether one of them says that it was added."""

    action: str
    station_id: int
    time_ns: int
    sent_ns: int | None
    true: _Values
    false: _Values
    is_added: bool


class Cams(BagCheck):
    """All that was sent, in both bags, by the number of the message.

    Memory holds some 100 bytes of each message, and 1 kB of each label.
    """

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = Attacked(self.bag, self.bag.parent)
        path = attacked.table(MESSAGE_LABELS)
        where, topic = self.bag.subject.place(path), f"{self.bag.place} {V2X_SENT.name}"
        if V2X_SENT.name not in attacked.clean.topics or not attacked.has_messages:
            return
        if not path.is_file():
            yield Fault(where, "is missing, though messages were attacked")
            return
        labels = _labels(path)
        reacts = any(one.get("dcc_reacts") for one in attacked.attacks)
        clean: dict[int, _Message] = {}
        for number, (was, payload) in _sent(attacked.clean):
            clean[number] = was
            yield from (Fault(where, what) for what in _untrue(number, labels.get(number), was, payload))
        for number, (now, payload) in _sent(attacked.adversarial):
            before, label = clean.pop(number, None), labels.pop(number, None)
            if label is None:
                if before != now:
                    yield Fault(topic, f"message {number} is not that of the clean bag, and has no label")
                continue
            is_new = before != now
            if is_new == (label.action == "corrupt"):
                yield Fault(where, f"message {number} is labelled {label.action}, which it is not")
            elif label.is_added != (before is None):
                yield Fault(where, f"message {number} is labelled {label.action}; the clean bag disagrees")
            elif label.station_id != now.station_id:
                yield Fault(where, f"message {number} is from {now.station_id}, not {label.station_id}")
            elif label.sent_ns != now.request_ns:
                yield Fault(where, f"message {number} was sent at {now.request_ns} ns, not {label.sent_ns}")
            elif wrong := _wrong_field(label.false, payload):
                yield Fault(where, f"message {number} does not say what false_{wrong} tells")
        for number, was in clean.items():
            gone = labels.pop(number, None)
            if gone is not None and gone.station_id != was.station_id:
                yield Fault(where, f"message {number} was from {was.station_id}, not {gone.station_id}")
            if (gone is None or gone.sent_ns is not None) and not reacts:
                yield Fault(topic, f"message {number} of the clean bag is missing, and no label says so")
        for number, label in labels.items():
            if not label.is_added or (label.sent_ns is not None and not reacts):
                yield Fault(where, f"tells of a message {number} that neither bag holds")


def _labels(path: Path) -> dict[int, _Label]:
    """The last row about each message."""
    labels: dict[int, _Label] = {}
    for row in rows(path, _COLUMNS):
        number = row["number"]
        is_added = row["action"] == "added" or (number in labels and labels[number].is_added)
        true, false = (tuple(row[f"{kind}_{name}"] for name in _FIELDS) for kind in ("true", "false"))
        labels[number] = _Label(
            row["action"], row["station_id"], row["time_ns"], row["sent_ns"], true, false, is_added
        )
    return labels


def _untrue(number: int, label: _Label | None, was: _Message, payload: bytes) -> Iterator[str]:
    """What the label of a changed message tells otherwise of the clean bag's."""
    if label is None or label.action != "changed":
        return
    if label.time_ns != was.request_ns:
        yield f"message {number} was recorded at {was.request_ns} ns, not {label.time_ns}"
    if wrong := _wrong_field(label.true, payload):
        yield f"message {number} did not say what true_{wrong} tells"


def _sent(reader: BagReader) -> Iterator[tuple[int, tuple[_Message, bytes]]]:
    if V2X_SENT.name not in reader.topics:
        return
    for _, message in reader.messages(V2X_SENT.name):
        sent = sent_of_message(message)
        digest = hashlib.blake2b(sent.payload, digest_size=16).digest()
        yield sent.number, (_Message(sent.station_id, sent.request_ns, digest), sent.payload)


def _wrong_field(told: _Values, payload: bytes) -> str:
    """The first field that a label tells otherwise than the message; "" for none."""
    try:
        cam = decode_cam(payload)
    except CamError:
        return next((name for name, value in _named(told) if value is not None), "")
    if cam.roadside is not None:  # which labels leave out
        return ""
    return next((name for name, value in _named(told) if not _is_same(value, cam, name)), "")


def _named(values: _Values) -> Iterator[tuple[str, Any]]:
    return zip(_FIELDS, values, strict=True)


def _is_same(told: Any, cam: Cam, name: str) -> bool:
    real = getattr(cam, name)
    if told is None or real is None:
        return told is real
    return told == real or math.isclose(told, real, rel_tol=1e-12)
