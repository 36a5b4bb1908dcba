"""Messages that were changed in what their attack does not declare untrue, and bounds that were not kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_labels import CAMS, Attacks, faults

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.topics import V2X_SENT
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.codec.codec import decode, encode
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.attack.v2x.cams import with_fields
from advpipe.stages.verify.checks.cams import Cams

Rewrite = Callable[[Path, Callable[[Iterable[RawMessage]], Iterator[RawMessage]]], None]


def declaring(**declared: object) -> Callable[[Attacks], None]:
    def change(attacks: Attacks) -> None:
        attacks[0]["declared"] |= declared

    return change


def test_a_field_that_is_not_declared_untrue(data_set: Path) -> None:
    bag = data_set / "cam"
    rows = pq.read_table(bag / CAMS).to_pylist()
    assert len(faults(bag, Cams, declaring(untrue=["speed", "heading"]))) == len(rows)
    assert faults(bag, Cams, declaring(untrue=["speed", "position"])) == []
    first = min(rows, key=lambda row: row["number"])
    assert faults(bag, Cams, declaring(untrue=[]))[0] == (
        f"message {first['number']} has its latitude_deg,longitude_deg changed; cam-position-offset declares "
        "nothing untrue"
    )


def test_a_message_that_is_changed_in_more(data_set: Path, rewrite: Rewrite) -> None:
    """Bag and labels agree with each other: only the declaration tells."""
    bag = data_set / "cam"
    table = pq.read_table(bag / CAMS)
    number = table["number"][0].as_py()

    def faster(messages: Iterable[RawMessage]) -> Iterator[RawMessage]:
        reader = BagReader(data_set / "cam")
        for raw in messages:
            message = reader.decode(raw) if raw.topic.name == V2X_SENT.name else None
            if message is None or message.number != number:
                yield raw
                continue
            payload = encode(with_fields(decode(bytes(message.payload)), speed_mps=99.0))
            lie = replace(message, payload=np.frombuffer(payload, np.uint8))
            yield replace(raw, cdr=serialise(lie, V2X_SENT.type))

    rewrite(bag, faster)
    for name, value in (("false_speed_mps", 99.0), ("fields", "latitude_deg,longitude_deg,speed_mps")):
        values = [value, *table[name].to_pylist()[1:]]
        at = table.column_names.index(name)
        table = table.set_column(at, table.schema.field(at), pa.array(values, table.schema.field(at).type))
    pq.write_table(table, bag / CAMS)
    assert faults(bag, Cams) == [
        f"message {number} has its speed_mps changed; cam-position-offset declares only the position untrue"
    ]


def test_parts_of_a_mix_declare_their_own(data_set: Path) -> None:
    """The mix itself declares what any part makes untrue, which is no licence for the others."""
    bag = data_set / "mix"
    options = {
        "type": "cam-mix",
        "parameters": {"attacks": "cam-heading-reversed,cam-dimensions"},
        "attackers": {"share": 1.0},
    }
    attack(data_set / "clean", bag, AttackRequest((attack_spec(options),)), workers=1)
    rows = pq.read_table(bag / CAMS).to_pylist()
    assert {row["part"] for row in rows} == {"cam-heading-reversed", "cam-dimensions"}
    assert faults(bag, Cams) == []

    def swapped(attacks: Attacks) -> None:
        one, other = attacks[0]["declared"]["parts"]
        assert set(attacks[0]["declared"]["untrue"]) == {"heading", "dimensions"}
        one["untrue"], other["untrue"] = other["untrue"], one["untrue"]

    assert len(faults(bag, Cams, swapped)) == len(rows)


@pytest.mark.parametrize(
    ("options", "claims"),
    [
        ({"type": "cam-delay", "parameters": {"delay_min_s": 0.01, "delay_max_s": 0.3, "restamp": True}}, 1),
        ({"type": "cam-stale", "parameters": {"messages": 1, "restamp": False}}, 8),
        ({"type": "cam-masquerade", "parameters": {"ahead_s": 0.5}}, 2),
        ({"type": "cam-masquerade"}, 1),
        ({"type": "cam-mix", "parameters": {"attacks": "all"}}, 8),
    ],
)
def test_what_hangs_on_parameters(data_set: Path, options: dict[str, object], claims: int) -> None:
    """The generation time is untrue only where a parameter asks for it."""
    bag = data_set / "other"
    spec = attack_spec({**options, "attackers": {"share": 1.0}})
    attack(data_set / "clean", bag, AttackRequest((spec,)), workers=1)
    assert pq.read_table(bag / CAMS).num_rows > 0
    assert len(BagReader(bag).provenance.said.attacks[0].declared.untrue) == claims
    assert faults(bag, Cams) == []
