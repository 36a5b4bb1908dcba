"""The engine on a recorded drive: what no attack touches stays as it is, to the byte."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.messages import FILE
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS
from advpipe.pipeline.messages.v2x import sent_message, sent_of_message, stations_of_message
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.attack.v2x.change import V2xChange, forge

JAM = ("v2x.radio.bitrate_mbps=3", "v2x.radio.overhead_bytes=1500", "v2x.cam={speed_mps: 0}")


def spec(name: str, **keys):
    return attack_spec({"type": name, **keys})


def by_topic(messages: Sequence[RawMessage]) -> dict[str, list[RawMessage]]:
    found = defaultdict(list)
    for message in messages:
        found[message.topic.name].append(message)
    return found


def labels_of(change: V2xChange, folder: Path) -> list[dict]:
    change.write_labels(folder)
    return pq.read_table(folder / FILE).to_pylist()


def vehicle(reader: BagReader, index: int = 0) -> str:
    """One that is not instrumented and sends all the time."""
    count = defaultdict(int)
    drive = V2xDrive(reader)
    for step in drive.steps():
        for one in step.sent:
            count[one.station_id] += 1
    others = sorted((n for n in count if n not in drive.listeners), key=lambda n: (-count[n], n))
    return drive.stations[others[index]]


@pytest.mark.parametrize(
    "settings",
    [
        (),
        (*JAM, "vehicles={ego: {}, other: {}}", "v2x.ldm.rate_hz=5", "v2x.radio.building_loss=obstacles"),
    ],
    ids=["plain", "jammed, two listeners"],
)
@pytest.mark.parametrize("dcc_reacts", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_without_an_active_attack_all_messages_are_unchanged(recorded, tmp_path, settings, dcc_reacts):
    reader = recorded(*settings)
    late = spec("cam-dos", schedule={"from_s": 2.95}, attackers={"vehicles": ("ego",)})
    with pytest.raises(AdvpipeError, match=r"cam-dos: its schedule begins at 2\.95 s"):
        forge(reader, [late], 1)
    idle = spec("cam-position-offset", schedule={"from_s": 2.9}, attackers={"share": 1.0})
    change = forge(reader, [idle], 1, dcc_reacts=dcc_reacts)
    mine, before = list(change.messages()), list(reader.raw_messages(change.topics))
    assert "/ego/v2x/rx/cam" in by_topic(before)
    assert mine == before
    assert labels_of(change, tmp_path) == []
    assert change.held_back == 0


def test_a_false_position_reaches_ldms_and_nothing_else_changes(recorded, tmp_path):
    """One station is 30 m farther east in the victim's map, from one second on; all others stay."""
    reader = recorded()
    attacker = vehicle(reader)
    (number,) = [n for n, name in V2xDrive(reader).stations.items() if name == attacker]
    attack = spec(
        "cam-position-offset",
        parameters={"x_m": 30.0, "rebuild_path": False},
        attackers={"vehicles": [attacker]},
        schedule={"from_s": 1.0},
    )
    change = forge(reader, [attack], 1)
    mine, before = (by_topic(m) for m in (list(change.messages()), list(reader.raw_messages(change.topics))))
    assert set(mine) == set(before)
    start_ns = min(m.log_time_ns for m in reader.raw_messages([V2X_STATIONS.name]))
    false_count = 0
    for new, old in zip(mine[V2X_SENT.name], before[V2X_SENT.name], strict=True):
        new_sent, old_sent = (sent_of_message(reader.decode(m)) for m in (new, old))
        assert replace(new_sent, payload=b"") == replace(old_sent, payload=b"")
        is_attacked = old_sent.station_id == number and old_sent.request_ns >= start_ns + 1_000_000_000
        false_count += is_attacked
        assert (new_sent.payload != old_sent.payload) == is_attacked
        if is_attacked:
            falsified, true = decode_cam(new_sent.payload), decode_cam(old_sent.payload)
            # 111.3 km on the equator's degree, by the cosine of 48.1 degrees: 74.5 km on this one
            assert (falsified.longitude_deg - true.longitude_deg) * 74_480 == pytest.approx(30, abs=0.05)
            assert replace(falsified, longitude_deg=0, latitude_deg=0) == replace(
                true, longitude_deg=0, latitude_deg=0
            )
    assert false_count >= 3
    assert [(m.log_time_ns, len(m.cdr)) for m in mine["/ego/v2x/rx/raw"]] == [
        (m.log_time_ns, len(m.cdr)) for m in before["/ego/v2x/rx/raw"]
    ]
    assert mine["/v2x/statistics"] == before["/v2x/statistics"]
    moved = 0
    for new, old in zip(mine["/ego/ldm"], before["/ego/ldm"], strict=True):
        pairs = zip(reader.decode(new).objects, reader.decode(old).objects, strict=True)
        for now, then in pairs:
            offset_m = now.centre.x - then.centre.x
            assert offset_m == pytest.approx(30 if abs(offset_m) > 1 else 0, abs=0.03)
            assert now.station_id == number or offset_m == 0
            moved += offset_m > 1
    assert moved >= 3
    rows = labels_of(change, tmp_path)
    assert len(rows) == false_count
    assert {(row["attack"], row["attacker"], row["action"]) for row in rows} == {
        ("cam-position-offset", attacker, "changed")
    }
    for row in rows:
        assert row["false_x_m"] - row["true_x_m"] == pytest.approx(30, abs=0.02)
        assert row["false_y_m"] == pytest.approx(row["true_y_m"], abs=0.02)
        assert row["false_speed_mps"] == row["true_speed_mps"]
        assert row["mattered"]
        assert set(row["fields"].split(",")) <= {"latitude_deg", "longitude_deg"}


def test_zero_speed_of_a_standing_car_has_no_effect(recorded, tmp_path):
    reader = recorded()
    attack = spec("cam-speed-constant", parameters={"speed_mps": 0.0}, attackers={"share": 1.0})
    rows = labels_of(forge(reader, [attack], 1), tmp_path)
    assert {row["mattered"] for row in rows} == {True, False}
    assert all(row["mattered"] == (row["true_speed_mps"] > 1.0) for row in rows)


def test_same_seed_same_bytes(recorded):
    reader = recorded()
    attacks = [spec("cam-position-random", attackers={"share": 0.3}), spec("cam-dos-random")]
    runs = [[m.cdr for m in forge(reader, attacks, seed).messages()] for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_roadside_unit_transmits_and_is_among_the_stations(recorded, tmp_path):
    reader = recorded()
    unit = {"roadside_unit": {"x_m": 5.0, "y_m": -8.0}}
    change = forge(reader, [spec("cam-dos-random", attackers=unit, parameters={"rate_hz": 20.0})], 1)
    messages = by_topic(list(change.messages()))
    for message in messages[V2X_STATIONS.name]:
        last = stations_of_message(reader.decode(message))[-1]
        assert last.vehicle == "roadside_unit_1"
        np.testing.assert_allclose(last.map_SE3_base[:3, 3], [5, -8, 3.0 - 1.5])
    senders = [sent_of_message(reader.decode(m)).station_id for m in messages[V2X_SENT.name]]
    assert senders.count(last.station_id) >= 50
    assert {row["attacker"] for row in labels_of(change, tmp_path)} == {"roadside_unit_1"}
    with pytest.raises(AdvpipeError, match="cam-speed-constant changes the CAMs that a vehicle sends"):
        forge(reader, [spec("cam-speed-constant", attackers=unit)], 1)


def test_a_flood_affects_others_congestion_control_with_dcc_reacts(recorded):
    reader = recorded(*JAM)
    flood = spec("cam-dos", attackers={"vehicles": [vehicle(reader)]}, parameters={"rate_hz": 200.0})
    calm, quiet = forge(reader, [flood], 1), forge(reader, [flood], 1, dcc_reacts=True)
    messages = [by_topic(list(change.messages())) for change in (calm, quiet)]
    sent = [len(each[V2X_SENT.name]) for each in messages]
    assert calm.held_back == 0
    assert quiet.held_back > 0
    assert sent[0] - sent[1] == quiet.held_back
    assert quiet.counts()["CAMs held back by others' congestion control"] == quiet.held_back
    clean = {m.cdr for m in reader.raw_messages(["/ego/v2x/rx/raw"])}
    assert len(clean - {m.cdr for m in messages[0]["/ego/v2x/rx/raw"]}) > 10  # lost, or later


def test_dcc_reacts_without_congestion_control_is_refused(recorded):
    reader, flood = recorded("v2x.cam.dcc=none"), spec("cam-dos")
    with pytest.raises(AdvpipeError, match=r"recorded without congestion control .*; leave out dcc_reacts"):
        forge(reader, [flood], 1, dcc_reacts=True)
    forge(reader, [flood], 1)


class Spoofed:
    """What a spoofed GPS makes of a vehicle's CAMs, in the manner of `gnss-...`."""

    name = "gnss-test"

    def __init__(self, station_id: int) -> None:
        self.station_id = station_id

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        assert step.end_ns is not None
        return [
            replace(one, payload=b"\xff" * 40) if one.station_id == self.station_id else one for one in sent
        ]


def test_editors_run_before_attacks(recorded, tmp_path):
    """An attacker whose messages are corrupted before has no CAM left to falsify."""
    reader = recorded()
    attacker = vehicle(reader)
    (number,) = [n for n, name in V2xDrive(reader).stations.items() if name == attacker]
    attack = spec("cam-speed-constant", attackers={"vehicles": [attacker]})
    change = forge(reader, [attack], 1, [Spoofed(number)])
    rows = labels_of(change, tmp_path)
    assert change.counts()["CAMs made invalid"] == change.counts()["CAMs corrupt"] == len(rows) / 2 > 2
    assert {(row["attack"], row["attacker"], row["sender"], row["action"]) for row in rows} == {
        ("gnss-test", "", attacker, "changed"),
        ("cam-speed-constant", attacker, attacker, "corrupt"),
    }
    assert all(row["mattered"] == (row["attack"] == "gnss-test") for row in rows)


def copy(reader: BagReader, out: Path, keep) -> BagReader:
    with BagWriter(out, provenance=reader.provenance) as bag:
        for raw in reader.raw_messages():
            if (kept := keep(raw)) is not None:
                bag.copy(kept)
    return BagReader(out)


def test_a_corrupt_cam_is_kept_counted_and_labelled(recorded, tmp_path):
    reader = recorded()
    attacker = vehicle(reader)
    (number,) = [n for n, name in V2xDrive(reader).stations.items() if name == attacker]
    spoilt: list[int] = []

    def keep(raw: RawMessage) -> RawMessage:
        if raw.topic.name == V2X_SENT.name and not spoilt:
            sent = sent_of_message(reader.decode(raw))
            if sent.station_id == number:
                spoilt.append(sent.number)
                return replace(raw, cdr=sent_message(replace(sent, payload=sent.payload[:9]))[1])
        return raw

    damaged = copy(reader, tmp_path / "damaged", keep)
    change = forge(damaged, [spec("cam-heading-reversed", attackers={"vehicles": [attacker]})], 1)
    messages = by_topic(list(change.messages()))[V2X_SENT.name]
    kept = [one for m in messages if (one := sent_of_message(reader.decode(m))).number == spoilt[0]]
    assert len(kept[0].payload) == 9
    assert change.counts()["CAMs corrupt"] == 1
    rows = labels_of(change, tmp_path)
    assert [row["number"] for row in rows if row["action"] == "corrupt"] == spoilt
    assert sum(row["action"] == "changed" for row in rows) > 2


def test_attacks_that_met_no_cam_are_counted(recorded, tmp_path):
    """Whose CAMs are all dropped tells no false speed; nor does anybody between two messages."""
    reader = recorded()
    own = {"vehicles": [vehicle(reader)]}
    names = ("cam-heading-reversed", "cam-drop", "cam-speed-constant")
    change = forge(reader, [spec(name, attackers=own) for name in names], 1)
    change.write_labels(tmp_path)
    idle = {what: count for what, count in change.counts().items() if what.startswith("attack")}
    assert idle == {"attack that met no CAM: cam-speed-constant": 1}
    change = forge(reader, [spec("cam-drop", schedule={"from_s": 0.0009, "to_s": 0.001})], 1)
    change.write_labels(tmp_path)
    assert change.counts() == {"attack that met no CAM: cam-drop": 1}


def test_invalid_input_is_a_one_line_error(recorded, tmp_path):
    reader = recorded()
    with pytest.raises(AdvpipeError, match=r"cam-drop: attacker 'nobody' has no radio in .*; stations are"):
        forge(reader, [spec("cam-drop", attackers={"vehicles": ["nobody"]})], 1)
    with pytest.raises(AdvpipeError, match=r"victim 'eog' .*; did you mean 'ego'\? stations are"):
        forge(reader, [spec("cam-drop", victim="eog")], 1)
    with pytest.raises(AdvpipeError, match=r"victim '.*' is not instrumented in .*; choose from ego"):
        forge(reader, [spec("cam-drop", victim=vehicle(reader))], 1)
    with pytest.raises(AdvpipeError, match=r"cam-drop: its schedule begins at 99 s"):
        forge(reader, [spec("cam-drop", schedule={"from_s": 99.0})], 1)
    with pytest.raises(AdvpipeError, match=r"cam-dimensions: unknown parameter 'size'"):
        forge(reader, [spec("cam-dimensions", parameters={"size": 1})], 1)
    silent = copy(reader, tmp_path / "silent", lambda raw: None if raw.topic.name == V2X_SENT.name else raw)
    with pytest.raises(AdvpipeError, match="silent has no CAMs"):
        forge(silent, [spec("cam-drop")], 1)
    deaf = copy(reader, tmp_path / "deaf", lambda raw: None if "v2x" in raw.topic.name else raw)
    with pytest.raises(AdvpipeError, match="deaf has no /v2x/stations"):
        forge(deaf, [spec("cam-drop")], 1)
