"""MCAP files: records, lengths, places, checksums, compression, schemas, and metadata.yaml beside them."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

from hypothesis import reject
from hypothesis import strategies as st

from tests.fuzz import base, calls
from tests.fuzz.case import Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.mcap_tree import Node, body_of, packed, put_together, take_apart
from tests.fuzz.values import NUMBERS, TEXTS

MCAP, METADATA = "clean_0.mcap", "metadata.yaml"
CALLS = {
    name: calls.BAG_CALLS[name] for name in ("read", "inspect", "verify", "frames", "recover", "view", "play")
}
SCHEMA_LINES = (
    *(
        "uint8 x",
        "string s",
        "float64[3] m",
        "uint8[] data",
        "string<=5 t",
        "uint8[<=3] u",
        "a/B c",
        "Header h",
    ),
    *("uint8[99999999] big", "string[5000] many", "uint8[0] none", "wstring w", "uint8 X=1", 'string S="a'),
    *(
        "=" * 80,
        "MSG: a/msg/B",
        "MSG: std_msgs/msg/Header",
        "std_msgs/Header[9999] h",
        "#" * 5000,
        "uint8",
        "\0",
    ),
)
IDL = (
    "module a { module msg { struct B { double x; sequence<sequence<B>> b; "
    "@key(1) string<5> s[3][4]; }; }; };"
)


LONGEST_REPEAT_BYTES = 16 << 20
"""Of one record again and again: a thousand large chunks would be gigabytes of our own."""


@st.composite
def field_values(draw: st.DrawFn, value: Any) -> Any:
    """Another value of the kind that a field of a record has."""
    if isinstance(value, int):
        extreme = st.sampled_from([int(n) for n in NUMBERS if abs(n) < 2**65])
        return draw(st.one_of(extreme, st.integers(0, 300), st.just(value + 1))) % 2**64
    if isinstance(value, str):
        if draw(st.booleans()):
            return draw(st.sampled_from([text for text in TEXTS if text != "\ud800"]))
        lines = value.split("\n")
        place = draw(st.integers(0, len(lines) - 1))
        lines[place : place + draw(st.integers(0, 1))] = [draw(st.sampled_from(SCHEMA_LINES))]
        return "\n".join(lines)
    if isinstance(value, bytes):
        if draw(st.integers(0, 9)) == 0:
            return IDL.encode()
        if draw(st.booleans()):
            return draw(edited_bytes(value))[0]
        return draw(field_values(value.decode("latin-1"))).encode()
    if isinstance(value, dict) and value:
        key = draw(st.sampled_from(sorted(value)))
        changed = {other: item for other, item in value.items() if other != key}
        return changed if draw(st.booleans()) else {**value, key: draw(field_values(value[key]))}
    if isinstance(value, list) and value:
        place = draw(st.integers(0, len(value) - 1))
        return draw(st.sampled_from([value[:place], value + value[place:], value[place:], []]))
    return value


@st.composite
def edited_record(draw: st.DrawFn, node: Node) -> str:
    """Changes one record's fields or bytes, in place."""
    if node.chunk is not None:
        if draw(st.booleans()):
            name = draw(st.sampled_from(["compression", "message_start_time", "message_end_time"]))
            value = draw(field_values(getattr(node.chunk, name)))
            node.chunk = dataclasses.replace(node.chunk, **{name: value})
            node.body = packed(node)
            return f"chunk.{name} = {value!r:.40}"
        note = draw(edited_records(node.inside))
        node.body = packed(node)
        return f"in the chunk at {node.start}: {note}"
    value = node.value()
    if value is None or draw(st.integers(0, 3)) == 0:
        node.body, note = draw(edited_bytes(node.body))
        return f"{note} in a record {node.opcode}"
    names = [f.name for f in dataclasses.fields(value)]
    name = draw(st.sampled_from(names))
    setattr(value, name, draw(field_values(getattr(value, name))))
    node.body = body_of(value)
    return f"{type(value).__name__}.{name} = {getattr(value, name)!r:.60}"


@st.composite
def edited_records(draw: st.DrawFn, nodes: list[Node]) -> str:
    """Changes one of some records, their number or their order, in place."""
    if not nodes:
        return "nothing"
    place = draw(st.integers(0, len(nodes) - 1))
    edit = draw(st.sampled_from(["record", "record", "record", "record", "drop", "repeat", "move", "opcode"]))
    node = nodes[place]
    if edit == "record":
        return draw(edited_record(node))
    if edit == "drop":
        del nodes[place]
    elif edit == "repeat":
        most = 1 + LONGEST_REPEAT_BYTES // (9 + len(node.body))
        nodes[place:place] = [node] * min(draw(st.sampled_from([1, 2, 1000])), most)
    elif edit == "move":
        nodes.insert(draw(st.integers(0, len(nodes) - 1)), nodes.pop(place))
    else:
        node.opcode = draw(st.integers(0, 255))
    return f"{edit} of record {place}"


@st.composite
def mcap_cases(draw: st.DrawFn, data: bytes) -> Case:
    call = draw(st.sampled_from(sorted(CALLS)))
    notes: list[str] = []
    changed = data
    if draw(st.integers(0, 4)):
        nodes = take_apart(data)
        try:
            notes += [draw(edited_records(nodes)) for _ in range(draw(st.integers(1, 3)))]
            changed = put_together(nodes)
        except Exception as error:  # a value that no such record can hold
            if type(error).__module__.startswith("hypothesis"):
                raise
            reject()
    if not notes or draw(st.integers(0, 5)) == 0:
        changed, note = draw(edited_bytes(changed))
        notes.append(note)
    return Case(call, MCAP, changed, "; ".join(notes))


@st.composite
def metadata_cases(draw: st.DrawFn, data: bytes) -> Case:
    changed, note = draw(edited_bytes(data))
    return Case(draw(st.sampled_from(sorted(CALLS))), METADATA, changed, note)


def cases(folder: Path) -> st.SearchStrategy[Case]:
    packed_bag = (folder / MCAP).read_bytes()
    plain = unpacked(packed_bag)
    mcap = partial(mcap_cases)
    return st.one_of(
        mcap(packed_bag), mcap(plain), mcap(plain), metadata_cases((folder / METADATA).read_bytes())
    )


def unpacked(data: bytes) -> bytes:
    """The same file without compression, so that bytes are those of messages."""
    nodes = take_apart(data)
    for node in nodes:
        if node.chunk is not None:
            node.chunk = dataclasses.replace(node.chunk, compression="")
            node.body = packed(node)
    return put_together(nodes)


TARGET = Target("container", f"{base.DRIVE}/clean", cases, CALLS)
