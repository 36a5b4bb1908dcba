"""Messages: every field of every topic's type with extreme values, and other lengths, orders and times."""

from __future__ import annotations

import struct
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import reject
from hypothesis import strategies as st
from rosbags.serde import SerdeError

from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.types import message_class, serialise, typestore
from tests.fuzz import base, calls
from tests.fuzz.case import Case, Target
from tests.fuzz.edits import EXTREMES, edited_bytes
from tests.fuzz.targets.bag_edit import BagDocument, mcap_bytes
from tests.fuzz.values import NUMBERS, TEXTS

MCAP = "clean_0.mcap"
TRUE_TEXTS = [text for text in TEXTS if text != "\ud800"]  # CDR holds UTF-8
INTEGERS = [int(number) for number in NUMBERS if abs(number) < 2**65]
FLOATS = [float(number) for number in NUMBERS if isinstance(number, float) or abs(number) < 2**65]

CALLS = [name for name in sorted(calls.BAG_CALLS) for _ in range(1 if name in ("read", "recover") else 3)]
WEIGHTS = {
    "/v2x/st": 8,
    "/v2x/se": 8,
    "odometry": 3,
    "initialpose": 3,
    "imu": 3,
    "gnss": 3,
    "truth": 3,
    "tf": 3,
    "lidar": 3,
}
"""Of topics by a part of their names: what most calls read is drawn most often."""


def weight(topic: str) -> int:
    return next((number for part, number in WEIGHTS.items() if part in topic), 1)


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every number, string and sequence in a message."""
    if is_dataclass(value):
        names = [f.name for f in fields(value) if f.name != "__msgtype__"]
        return [leaf for name in names for leaf in leaves(getattr(value, name), (*path, name))]
    found = [path]
    if isinstance(value, list):
        for index, item in enumerate(value[:8]):
            found += leaves(item, (*path, index)) if is_dataclass(item) else [(*path, index)]
    return found


def at(value: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        value = getattr(value, step) if isinstance(step, str) else value[step]
    return value


def put(message: Any, path: tuple[Any, ...], value: Any) -> None:
    holder = at(message, path[:-1])
    if isinstance(path[-1], str):
        object.__setattr__(holder, path[-1], value)
    else:
        holder[path[-1]] = value


def parts(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every message inside a message, starting with itself."""
    if isinstance(value, list):
        return [part for index, item in enumerate(value[:8]) for part in parts(item, (*path, index))]
    if not is_dataclass(value):
        return []
    names = [f.name for f in fields(value) if f.name != "__msgtype__"]
    return [path, *(part for name in names for part in parts(getattr(value, name), (*path, name)))]


@st.composite
def filled_part(draw: st.DrawFn, message: Any) -> str:
    """One number in all fields of a message inside the message: a quaternion of zeros, a box of NaN."""
    part = draw(st.sampled_from(parts(message)))
    number = draw(st.sampled_from([0, 0, *NUMBERS]))
    for leaf in leaves(at(message, part), part):
        old = at(message, leaf)
        if isinstance(old, float) and (isinstance(number, float) or abs(number) < 2**65):
            put(message, leaf, float(number))
        elif isinstance(old, int) and isinstance(number, int):
            put(message, leaf, number)
    return f"all of {'.'.join(map(str, part)) or 'it'} = {number!r:.40}"


@st.composite
def other_values(draw: st.DrawFn, value: Any) -> Any:
    """Another value that a field of this type can (nearly) hold."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return draw(st.one_of(st.sampled_from(INTEGERS), st.integers(0, 300), st.just(value + 1)))
    if isinstance(value, float):
        return draw(st.one_of(st.sampled_from(FLOATS), st.floats(-1e7, 1e7), st.floats()))
    if isinstance(value, str):
        return draw(st.one_of(st.sampled_from(TRUE_TEXTS), st.text(st.characters(codec="utf-8"), max_size=9)))
    if isinstance(value, list):
        return draw(st.sampled_from([[], value[:1], value * 2, value * 100, value[::-1]]))
    if isinstance(value, np.ndarray):
        return draw(_other_arrays(value))
    return value


@st.composite
def _other_arrays(draw: st.DrawFn, value: np.ndarray) -> np.ndarray:
    edit = draw(st.sampled_from(["fill", "one", "shorter", "longer", "bytes"]))
    if edit == "shorter":
        return value[: len(value) // 2]
    if edit == "longer":
        return np.concatenate([value, value])
    changed = value.copy()
    if edit == "bytes":
        data = draw(edited_bytes(value.tobytes()))[0]
        return np.frombuffer(data[: len(data) // value.itemsize * value.itemsize], value.dtype)
    number = draw(st.sampled_from(FLOATS if value.dtype.kind == "f" else INTEGERS))
    with np.errstate(all="ignore"):
        number = np.array(number).astype(value.dtype) if value.dtype.kind == "f" else number % 256
    if edit == "fill" or not len(changed):
        changed[:] = number
    else:
        changed[draw(st.integers(0, len(changed) - 1))] = number
    return changed


@st.composite
def edited_fields(draw: st.DrawFn, raw: RawMessage) -> tuple[RawMessage, str]:
    """The message with one to three other values."""
    message_class(raw.topic.type)  # adds the types of CAMs to the store
    try:
        message = typestore().deserialize_cdr(raw.cdr, raw.topic.type)
    except SerdeError:
        reject()  # it was changed before
    notes = []
    for _ in range(draw(st.integers(1, 3))):
        places = leaves(message)
        if not places:
            reject()
        if draw(st.integers(0, 2)) == 0:
            notes.append(draw(filled_part(message)))
            continue
        path = draw(st.sampled_from(places))
        value = draw(other_values(at(message, path)))
        notes.append(f"{'.'.join(map(str, path))} = {value!r:.60}")
        put(message, path, value)
    try:
        cdr = serialise(message, raw.topic.type)
    except Exception:
        reject()  # a value that the field cannot hold; rosbags raises many exceptions for it
    return replace(raw, cdr=cdr), f"{raw.topic.name}: {'; '.join(notes)}"


@st.composite
def edited_message(draw: st.DrawFn, raw: RawMessage) -> tuple[RawMessage, str]:
    """The message with other fields, another length somewhere in its bytes, or other times."""
    edit = draw(st.sampled_from(["fields"] * 6 + ["word", "bytes", "times", "type"]))
    if edit == "fields":
        return draw(edited_fields(raw))
    cdr = raw.cdr
    if edit == "word" and len(cdr) >= 8:  # lengths lie at multiples of four
        place = draw(st.integers(0, len(cdr) // 4 - 1)) * 4
        number = draw(st.sampled_from(EXTREMES)) % 2**32
        changed = replace(raw, cdr=cdr[:place] + struct.pack("<I", number) + cdr[place + 4 :])
    elif edit == "times":
        time_ns = draw(st.one_of(st.sampled_from(EXTREMES[:-1]), st.integers(-(10**9), 10**9).map(
            lambda shift: raw.log_time_ns + shift)))  # fmt: skip
        changed = replace(raw, log_time_ns=time_ns % 2**64)
    elif edit == "type":
        changed = replace(raw, cdr=cdr[:4] + draw(st.binary(max_size=64)))
    else:
        changed = replace(raw, cdr=draw(edited_bytes(cdr))[0])
    return changed, f"{edit} of a message of {raw.topic.name}"


@st.composite
def bag_cases(draw: st.DrawFn, document: BagDocument) -> Case:
    """A bag in which some messages of a topic are changed, come twice, not at all or in another order."""
    messages, notes = list(document.messages), []
    call = draw(st.sampled_from(CALLS))
    topics = [topic for topic in document.topics for _ in range(weight(topic))]
    for _ in range(draw(st.integers(1, 3))):
        topic = draw(st.sampled_from(topics))
        places = [place for place, raw in enumerate(messages) if raw.topic.name == topic]
        if not places:
            continue
        place = draw(st.sampled_from(places))
        edit = draw(st.sampled_from(["edit"] * 6 + ["all", "drop", "drop all", "repeat", "stamp"]))
        notes.append(f"{edit} of {topic}")
        if edit == "edit":
            messages[place], note = draw(edited_message(messages[place]))
            notes[-1] = note
        elif edit == "all":
            changed, note = draw(edited_fields(messages[place]))
            for other in places:
                messages[other] = replace(messages[other], cdr=changed.cdr)
            notes[-1] = f"all alike: {note}"
        elif edit == "drop":
            del messages[place]
        elif edit == "drop all":
            messages = [raw for raw in messages if raw.topic.name != topic]
        elif edit == "repeat":
            messages[place:place] = [messages[place]] * draw(st.sampled_from([1, 1, 50]))
        else:
            other = draw(st.sampled_from(places))
            messages[place] = replace(messages[place], log_time_ns=messages[other].log_time_ns)
    if draw(st.booleans()):
        messages.sort(key=lambda raw: raw.log_time_ns)
    return Case(call, MCAP, mcap_bytes(messages, document.provenance), "; ".join(notes))


def cases(folder: Path) -> st.SearchStrategy[Case]:
    return bag_cases(BagDocument(folder))


TARGET = Target("cdr", f"{base.DRIVE}/clean", cases, calls.BAG_CALLS)
