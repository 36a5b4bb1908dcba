"""Messages that were changed in what their attack does not declare untrue, and bounds that were not kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_attack_labels import CAMS, FIXES, Attacks, faults, unchecked

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.gnss import squared_sigmas
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.topics import V2X_SENT, VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.attack.v2x.cams import with_fields
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.checks.cams import CamsCheck
from advpipe.stages.verify.checks.fixes import Fixes

Rewrite = Callable[[Path, Callable[[Iterable[RawMessage]], Iterator[RawMessage]]], None]


def declaring(**declared: object) -> Callable[[Attacks], None]:
    def change(attacks: Attacks) -> None:
        attacks[0]["declared"] |= declared

    return change


def test_a_changed_field_not_declared_untrue_is_a_fault(data_set: Path) -> None:
    bag = data_set / "cam"
    rows = pq.read_table(bag / CAMS).to_pylist()
    assert len(faults(bag, CamsCheck, declaring(untrue=["speed", "heading"]))) == len(rows)
    assert faults(bag, CamsCheck, declaring(untrue=["speed", "position"])) == []
    first = min(rows, key=lambda row: row["number"])
    assert faults(bag, CamsCheck, declaring(untrue=[]))[0] == (
        f"message {first['number']} had latitude_deg,longitude_deg changed; cam-position-offset declares "
        "nothing untrue"
    )


def test_a_change_beyond_the_declaration_is_a_fault(data_set: Path, rewrite: Rewrite) -> None:
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
            payload = encode_cam_tree(with_fields(decode_cam_tree(bytes(message.payload)), speed_mps=99.0))
            false_message = replace(message, payload=np.frombuffer(payload, np.uint8))
            yield replace(raw, cdr=serialise(false_message, V2X_SENT.type))

    rewrite(bag, faster)
    for name, value in (("false_speed_mps", 99.0), ("fields", "latitude_deg,longitude_deg,speed_mps")):
        values = [value, *table[name].to_pylist()[1:]]
        at = table.column_names.index(name)
        table = table.set_column(at, table.schema.field(at), pa.array(values, table.schema.field(at).type))
    pq.write_table(table, bag / CAMS)
    assert faults(bag, CamsCheck) == [
        f"message {number} had speed_mps changed; cam-position-offset declares only the position untrue"
    ]


def test_parts_of_a_mix_are_checked_by_their_declarations(data_set: Path) -> None:
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
    assert faults(bag, CamsCheck) == []

    def swapped(attacks: Attacks) -> None:
        one, other = attacks[0]["declared"]["parts"]
        assert set(attacks[0]["declared"]["untrue"]) == {"heading", "dimensions"}
        one["untrue"], other["untrue"] = other["untrue"], one["untrue"]

    assert len(faults(bag, CamsCheck, swapped)) == len(rows)


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
def test_declarations_depend_on_parameters(data_set: Path, options: dict[str, object], claims: int) -> None:
    """The generation time is untrue only where a parameter asks for it."""
    bag = data_set / "other"
    spec = attack_spec({**options, "attackers": {"share": 1.0}})
    attack(data_set / "clean", bag, AttackRequest((spec,)), workers=1)
    assert pq.read_table(bag / CAMS).num_rows > 0
    assert len(BagReader(bag).provenance.fields.attacks[0].declared.untrue) == claims
    assert faults(bag, CamsCheck) == []


@pytest.mark.parametrize(
    ("bag", "check", "bounds", "expected"),
    [
        (
            "gnss",
            Fixes,
            {"fix_displacement_m": [0, 0.1]},
            "exceeds the bounds of gnss-bias: distance between the false and the true fix: ",
        ),
        ("gnss", Fixes, {"fix_height_change_m": [0, 0]}, "absolute change of a fix's height"),
        (
            "cam",
            CamsCheck,
            {"position_offset_m": [0, 20]},
            "exceeds the bounds of cam-position-offset: horizontal offset of the reported position: ",
        ),
        ("cam", CamsCheck, {"delay_s": [1, 2]}, "delay of a message: 0 s, but the attack declares 1 to 2 s"),
        (
            "dos",
            CamsCheck,
            {"messages_added_per_s": [0, 5]},
            "messages an attacker added within one second: 6, but the attack declares 0 to 5",
        ),
    ],
)
def test_exceeded_bounds_are_faults(
    data_set: Path, bag: str, check: type[BagCheck], bounds: dict[str, list[float]], expected: str
) -> None:
    """Whichever of two attacks of one name it was, one of them may have done it."""
    assert faults(data_set / bag, check) == []
    assert expected in " ".join(faults(data_set / bag, check, declaring(bounds=bounds)))
    known = {**bounds, "smell": [0, 1]}
    assert expected in " ".join(faults(data_set / bag, check, declaring(bounds=known)))
    twice = json.loads(BagReader(data_set / bag).provenance["attacks"])

    def one_of_two(attacks: Attacks) -> None:
        declaring(bounds=bounds)(attacks)
        attacks += twice

    assert faults(data_set / bag, check, one_of_two) == []


@pytest.mark.parametrize(("bag", "check"), [("gnss", Fixes), ("cam", CamsCheck)])
def test_bounds_on_unknown_quantities_are_unchecked(data_set: Path, bag: str, check: type[BagCheck]) -> None:
    unchecked_text = unchecked(data_set / bag, check, declaring(bounds={"smell": [0, 1]}))
    assert f"smell of {'gnss-bias' if bag == 'gnss' else 'cam-position-offset'} not checked" in unchecked_text


def test_fixes_of_an_older_version_are_unchecked(data_set: Path) -> None:
    def undeclared(attacks: Attacks) -> None:
        del attacks[0]["declared"]

    unchecked_text = unchecked(data_set / "gnss", Fixes, undeclared)
    assert "bounds of gnss-bias not checked: the bag comes from a version" in unchecked_text


def test_a_victim_without_fixes_is_unchecked(data_set: Path) -> None:
    """Of another vehicle, the bag holds CAMs alone, which tell places in steps."""
    drive = V2xDrive(BagReader(data_set / "clean"))
    victim = next(name for name in drive.stations.values() if name != "ego")
    bag = data_set / "other"
    spec = attack_spec({"type": "gnss-bias", "victim": victim})
    attack(data_set / "clean", bag, AttackRequest((spec,)), workers=1)
    assert f"bounds of gnss-bias not checked: no fixes of {victim}" in unchecked(bag, Fixes, lambda _: None)


def test_a_fix_beyond_its_bounds_is_a_fault(data_set: Path, rewrite: Rewrite) -> None:
    """Bag and labels agree with each other, and the fix is 90 m higher than it may be."""
    bag, topic = data_set / "gnss", VehicleTopics("ego").gnss_fix
    table = pq.read_table(bag / FIXES)
    row = {name: column[0].as_py() for name, column in zip(table.column_names, table.columns, strict=True)}
    assert row["attack"] == "gnss-bias"

    def higher(messages: Iterable[RawMessage]) -> Iterator[RawMessage]:
        reader, is_first = BagReader(data_set / "gnss"), True
        for raw in messages:
            if raw.topic.name == topic.name and is_first:
                fix = reader.decode(raw)
                raw = replace(raw, cdr=serialise(replace(fix, altitude=fix.altitude + 90.0), topic.type))
                is_first = False
            yield raw

    covariance_m2 = next(iter(BagReader(data_set / "clean").messages(topic.name)))[1].position_covariance
    up_m = row["offset_up_m"] + 90.0
    offset_m = np.array([row["offset_east_m"], row["offset_north_m"], up_m])
    stated = {
        "false_altitude_m": row["false_altitude_m"] + 90.0,
        "offset_up_m": up_m,
        "squared_sigmas": squared_sigmas(offset_m, np.array(covariance_m2).reshape(3, 3)),
        "mattered": True,
    }
    rewrite(bag, higher)
    for name, value in stated.items():
        at = table.column_names.index(name)
        values = [value, *table[name].to_pylist()[1:]]
        table = table.set_column(at, table.schema.field(at), pa.array(values, table.schema.field(at).type))
    pq.write_table(table, bag / FIXES)
    (line,) = faults(bag, Fixes)
    assert line.startswith("fix 0 of ego exceeds the bounds of gnss-bias: distance between the false")
