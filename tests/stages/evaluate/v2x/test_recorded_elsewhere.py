"""Drives that another tool or an earlier version recorded: what their bags tell is evaluated, and no more."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import LANES, SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.v2x.channel import Channel
from advpipe.pipeline.v2x.radio.medium import Medium
from advpipe.stages.evaluate.v2x.drive import read_drive
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.section import has_v2x, v2x_sections
from advpipe.stages.evaluate.v2x.veremi import export_veremi

EGO = VehicleTopics("ego")
BESIDE = (EGO.reception_info.name, EGO.true_receptions.name)
INFO = '{"map": {"origin": {"latitude_deg": 48.1351, "longitude_deg": 11.582, "altitude_m": 520.0}}}'

Edit = Callable[[RawMessage], RawMessage | None]


def copied(bag: Path, out: Path, edit: Edit) -> Path:
    """The bag with what becomes of each message, and its labels."""
    reader = BagReader(bag)
    with BagWriter(out, provenance=reader.provenance) as writer:
        for raw in reader.raw_messages():
            if (new := edit(raw)) is not None:
                writer.copy(new)
    for labels in bag.glob("*.parquet"):
        shutil.copy(labels, out)
    return out


def without(*topics: str) -> Edit:
    return lambda raw: None if raw.topic.name in topics else raw


def of_a_real_car(raw: RawMessage) -> RawMessage | None:
    """What a car with a radio and our message types could record: packets, its own place and a map."""
    if raw.topic.name == SCENARIO_INFO.name:
        return replace(raw, cdr=serialise(build.string(INFO), SCENARIO_INFO.type))
    return raw if raw.topic.name in (EGO.received_raw.name, EGO.odometry.name, LANES.name) else None


def test_the_radio_does_not_run(smoke: Path, offset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a radio is asked what was received")

    for made in (Channel, Medium):
        monkeypatch.setattr(made, "__init__", refuse)
    (found,) = v2x_sections(smoke, [offset])
    assert found.notes == ()
    with pytest.raises(AssertionError, match="a radio is asked"):
        export_veremi(smoke, smoke.parent / "refused")  # of the vehicles that recorded nothing


def test_a_real_cars_drive(smoke: Path, tmp_path: Path) -> None:
    """Its honest messages are judged as in the whole bag, but that nobody knows its own station id."""
    bag = copied(smoke, tmp_path / "real", of_a_real_car)
    assert has_v2x(bag)
    (whole,), (ego,) = read_receptions(BagReader(smoke)), read_receptions(BagReader(bag))
    assert ego.claims == whole.claims
    assert [r._replace(station_id=-1, length_m=0, width_m=0) for r in whole.receivers] == [
        r._replace(length_m=0, width_m=0) for r in ego.receivers
    ]
    assert ego.near == frozenset()
    found, before = read_drive(bag, "real"), read_drive(smoke, "smoke")
    assert found.detection == before.detection
    assert found.detection.messages > 50
    assert found.radio is None
    assert np.isnan(found.delivered("ego", found.honest("ego")))
    assert len(found.missing_data) == 3
    for topic, sentence in zip(("/ego/ldm", "/v2x/stations", "/v2x/sent"), found.missing_data, strict=True):
        assert f"({topic})" in sentence


def test_bags_recorded_before_receptions_were(smoke: Path, offset: Path, tmp_path: Path) -> None:
    """Nobody guesses which of the received messages were lies: all else is evaluated, and a line says so."""
    (whole,) = v2x_sections(smoke, [offset])
    old = [copied(bag, tmp_path / bag.name, without(*BESIDE)) for bag in (smoke, offset)]
    (found,) = v2x_sections(old[0], old[1:])
    (note,) = found.notes
    assert note.startswith(f"{offset.name}: ")
    assert "their true senders are not recorded (/ego/ground_truth/receptions)" in note
    assert "record the drive again" in note
    clean, attacked = rows_of(found)
    np.testing.assert_equal(clean["false_positive_rate"], rows_of(whole)[0]["false_positive_rate"])
    assert clean["messages"] == rows_of(whole)[0]["messages"]
    assert (attacked["messages"], attacked["false_messages"]) == (0, 0)
    for name, value in rows_of(whole)[1].items():
        if name.startswith(("ldm_", "warning_", "radio_")):
            np.testing.assert_equal(attacked[name], value)
    with pytest.raises(AdvpipeError, match=r"/ego/ground_truth/receptions does not say which sent message"):
        export_veremi(old[0], tmp_path / "veremi")


def test_messages_whose_truth_is_lost_are_not_scored(offset: Path, tmp_path: Path) -> None:
    """As of a recording that was killed: the last second of the truth is missing."""
    last_ns = int(BagReader(offset).log_times_ns("/v2x/stations")[-1])

    def cut(raw: RawMessage) -> RawMessage | None:
        is_lost = raw.topic.name == EGO.true_receptions.name and raw.log_time_ns > last_ns - 10**9
        return None if is_lost else raw

    bag = copied(offset, tmp_path / "cut", cut)
    whole, found = read_drive(offset, "offset"), read_drive(bag, "cut")
    lost = read_receptions(BagReader(bag))[0].numbers.count(None)
    assert lost > 0
    assert whole.detection.messages - found.detection.messages == lost
    assert 0 < found.detection.false_messages < whole.detection.false_messages
    assert found.missing_data[0].startswith(f"{lost} of the {whole.detection.messages} messages ")


@pytest.mark.parametrize(
    ("field", "change"), [("number", 10**9), ("number", 1), ("station_id", 1)], ids=["nobody", "other", "id"]
)
def test_receptions_of_what_nobody_sent(smoke: Path, tmp_path: Path, field: str, change: int) -> None:
    reader = BagReader(smoke)

    def strange(raw: RawMessage) -> RawMessage:
        if raw.topic.name != EGO.true_receptions.name:
            return raw
        message = reader.decode(raw)
        setattr(message, field, getattr(message, field) + change)
        return replace(raw, cdr=serialise(message, raw.topic.type))

    bag = copied(smoke, tmp_path / "strange", strange)
    for read in (read_receptions, lambda reader: export_veremi(reader.path, tmp_path / "out")):
        with pytest.raises(AdvpipeError, match=r"receptions at \d+ ns names message .*/v2x/sent does not"):
            read(BagReader(bag))


@pytest.mark.parametrize(
    ("lacks", "message"),
    [
        (("/scenario/info",), "the geographic origin of its map is unknown"),
        (("/ego/odometry", "/v2x/stations"), "the position of ego when it received messages is unknown"),
    ],
)
def test_what_nothing_can_be_said_without(
    smoke: Path, tmp_path: Path, lacks: tuple[str, ...], message: str
) -> None:
    bag = copied(smoke, tmp_path / "bag", without(*lacks))
    with pytest.raises(AdvpipeError, match=message):
        read_drive(bag, "bag")
