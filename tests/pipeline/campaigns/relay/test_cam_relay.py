"""CAMs between the radio and its consumers."""

from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from relay_messages import BEGIN_NS, cam_payload_of, packet_cdr
from relay_parts import on, recording, settings_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.relay.cam_relay import CamRelay
from advpipe.pipeline.campaigns.relay.outgoing import ADDED_BY_ATTACK, ATTACKED, UNCHANGED, OutgoingMessage
from advpipe.pipeline.campaigns.relay.place import MapPlace
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.cam_cdr import cam_cdr
from advpipe.pipeline.messages.cam_from_cdr import cam_tree_of_cdr
from advpipe.pipeline.messages.types import message_class, typestore
from advpipe.pipeline.messages.v2x import udp_packet_cdr
from advpipe.pipeline.v2x.codec.btp import cam_payload
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.stages.attack.v2x import labels as labels_module
from advpipe.stages.attack.v2x.base import v2x_traits
from advpipe.stages.attack.v2x.cams import field_of
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

STATIONS = (101, 102, 103, 104)
RAW, VALUES = "/ego/v2x/rx/raw", "/ego/v2x/rx/cam"
TENTH_NS = 100_000_000


def run(tmp_path: Path, attack: dict[str, Any], tenths: int = 20, **others: Any) -> list[OutgoingMessage]:
    """Four stations send ten times a second."""
    settings = settings_of(attack, seed=5, **others)
    sent: list[OutgoingMessage] = []
    with recording(tmp_path / "bag") as recorder:
        relay = CamRelay(settings, settings.attacks, MapPlace(settings.origin), recorder)
        relay.begin(BEGIN_NS)
        for step in range(tenths * 4):
            now_ns = BEGIN_NS + step * TENTH_NS // 4
            relay.take(packet_cdr(STATIONS[step % 4], now_ns), now_ns, 0.0)
            sent += relay.due(now_ns + 1000, 0.0)
        sent += relay.due(now_ns + TENTH_NS, 0.0)
        relay.write_labels()
    assert relay.counts.received == tenths * 4
    withheld = relay.counts.received - sum(one.fate != ADDED_BY_ATTACK for one in on(RAW, sent))
    assert relay.counts.withheld == withheld
    return sent


def trees(sent: list[OutgoingMessage]) -> list[Any]:
    packets = [typestore().deserialize_cdr(one.cdr, "udp_msgs/msg/UdpPacket") for one in on(RAW, sent)]
    return [decode_cam_tree(cam_payload(bytes(packet.data))) for packet in packets]


def labels(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder / "v2x_labels.parquet").to_pylist()
    return rows


def test_a_named_attacker_is_falsified_and_others_are_not(tmp_path: Path) -> None:
    attack = {"type": "cam-speed-constant", "attackers": {"vehicles": ["102"]}}
    sent = run(tmp_path, attack)
    raw = on(RAW, sent)
    assert Counter(one.fate for one in raw) == {UNCHANGED: 60, ATTACKED: 20}
    speeds = {station: set() for station in STATIONS}
    for tree in trees(sent):
        speeds[field_of(tree, "station_id")].add(field_of(tree, "speed_mps"))
    assert [len(speeds[station]) for station in STATIONS] == [20, 1, 20, 20]
    assert {one.cdr for one in raw if one.fate == UNCHANGED} == {
        packet_cdr(STATIONS[step % 4], BEGIN_NS + step * TENTH_NS // 4) for step in range(80) if step % 4 != 1
    }
    assert {(row["attacker"], row["action"]) for row in labels(tmp_path / "bag")} == {("102", "changed")}
    assert [row["true_speed_mps"] for row in labels(tmp_path / "bag")] == pytest.approx(
        [10 + 0.1 * step + 0.025 for step in range(20)], abs=0.011
    )
    assert len(labels(tmp_path / "bag")) == 20
    values = on(VALUES, sent)
    message_class("etsi_its_cam_msgs/msg/CAM")  # which registers it
    cams = [typestore().deserialize_cdr(one.cdr, "etsi_its_cam_msgs/msg/CAM") for one in values]
    assert [cam.header.station_id.value for cam in cams] == [STATIONS[step % 4] for step in range(80)]
    assert BagReader(tmp_path / "bag", debug=True).topics["/advpipe/debug/v2x/sent"].count == 20


@pytest.mark.parametrize(
    ("attack", "fates"),
    [
        ({"type": "cam-speed-constant"}, {UNCHANGED: 30, ATTACKED: 10}),
        ({"type": "cam-drop"}, {UNCHANGED: 30}),
    ],
)
def test_a_graph_without_packets(tmp_path: Path, attack: dict[str, Any], fates: dict[str, int]) -> None:
    """CAMs come and go as ROS 2 messages."""
    settings = settings_of({**attack, "attackers": {"vehicles": ["102"]}}, packet_topic="")
    cams = [cam_cdr(decode_cam_tree(cam_payload_of(station))) for station in STATIONS]
    sent: list[OutgoingMessage] = []
    with recording(tmp_path / "bag") as recorder:
        relay = CamRelay(settings, settings.attacks, MapPlace(None), recorder)
        assert [topic.name for topic in relay.topics] == [VALUES]
        relay.begin(BEGIN_NS)
        for step in range(40):
            now_ns = BEGIN_NS + step * TENTH_NS // 4
            relay.take(cams[step % 4], now_ns, 0.0)
            sent += relay.due(now_ns + 1000, 0.0)
        relay.write_labels()
    assert Counter(one.fate for one in sent) == fates
    assert {one.cdr for one in sent if one.fate == UNCHANGED} == {cams[place] for place in (0, 2, 3)}
    attacked = [cam_tree_of_cdr(one.cdr) for one in sent if one.fate == ATTACKED]
    assert {field_of(tree, "station_id") for tree in attacked} <= {102}
    assert relay.counts.withheld == 40 - len(sent)
    assert len(labels(tmp_path / "bag")) == 10


def test_held_back_messages_are_labelled_in_bounded_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that were dropped long ago have their labels before the end."""
    monkeypatch.setattr(labels_module, "MOST_HELD_BACK", 5)
    run(tmp_path, {"type": "cam-drop", "attackers": {"vehicles": ["102"]}})
    found = labels(tmp_path / "bag")
    assert [row["number"] for row in found] == sorted(row["number"] for row in found)
    assert Counter(row["action"] for row in found) == {"dropped": 20}


def test_a_fix_that_makes_the_origin_first(tmp_path: Path) -> None:
    settings, place = settings_of({"type": "cam-drop", "attackers": {"share": 1.0}}), MapPlace(None)
    with recording(tmp_path / "bag") as recorder:
        relay = CamRelay(settings, settings.attacks, place, recorder)
        relay.begin(BEGIN_NS)
        place.set_origin(48.0, 11.0, 0.0)
        relay.take(packet_cdr(101), BEGIN_NS, 0.0)
        assert not list(relay.due(BEGIN_NS + 5, 0.0))


def test_drop(tmp_path: Path) -> None:
    sent = run(tmp_path, {"type": "cam-drop", "attackers": {"vehicles": ["102"]}})
    assert {field_of(tree, "station_id") for tree in trees(sent)} == {101, 103, 104}
    assert Counter(row["action"] for row in labels(tmp_path / "bag")) == {"dropped": 20}


def test_flood(tmp_path: Path) -> None:
    """Two seconds at 200 messages a second, besides the genuine ones."""
    sent = run(
        tmp_path, {"type": "cam-dos", "attackers": {"vehicles": ["102"]}, "parameters": {"rate_hz": 200}}
    )
    added = [one for one in on(RAW, sent) if one.fate == ADDED_BY_ATTACK]
    assert 380 <= len(added) <= 420
    assert all(one.arrival_s is None for one in added)
    assert {field_of(tree, "station_id") for tree in trees(added)} == {102}


def test_a_roadside_unit_floods_where_nobody_sends(tmp_path: Path) -> None:
    unit = {"roadside_unit": {"x_m": 10, "y_m": 0}}
    origin = {"latitude_deg": 48, "longitude_deg": 11, "altitude_m": 520}
    sent = run(tmp_path, {"type": "cam-dos-random", "attackers": unit}, origin=origin)
    assert sum(one.fate == ADDED_BY_ATTACK for one in on(RAW, sent)) > 60


EVERY_TIME = ("cam-position-offset", "cam-replay", "cam-delay", "cam-sybil-grid", "cam-dos-random-sybil")


@pytest.mark.parametrize(
    "name",
    [
        name if name in EVERY_TIME else pytest.param(name, marks=pytest.mark.nightly)
        for name, attack_class in V2X_ATTACKS.items()
        if "cam" in v2x_traits(attack_class).message_types
    ],
)
def test_every_attack(tmp_path: Path, name: str) -> None:
    """On two stations, around a third; each touches messages, within the bounds that it declares."""
    attack: dict[str, Any] = {"type": name, "attackers": {"vehicles": ["102", "103"]}, "victim": "101"}
    if name == "cam-stale":
        attack["parameters"] = {"messages": 5}
    sent = run(tmp_path, attack, tenths=60 if name == "cam-sybil-replay" else 30)
    assert len(labels(tmp_path / "bag")) > 0
    assert len(on(RAW, sent)) > 0


def test_attacks_on_other_messages_than_cams_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cpm-ghost attacks no CAMs"):
        run(tmp_path, {"type": "cpm-ghost", "attackers": {"vehicles": ["102"]}})


@pytest.mark.parametrize("share", [0.0001, 1.0])
def test_a_share_is_drawn_station_by_station(tmp_path: Path, share: float) -> None:
    run(tmp_path, {"type": "cam-speed-constant", "attackers": {"share": share}}, tenths=3)
    assert {row["attacker"] for row in labels(tmp_path / "bag")} == (
        {"101", "102", "103", "104"} if share == 1 else set()
    )


def test_what_is_no_cam_passes(tmp_path: Path) -> None:
    settings = settings_of({"type": "cam-drop", "attackers": {"share": 1.0}})
    odd = [b"\0\1\0\0", udp_packet_cdr(5, b"nonsense")]
    with recording(tmp_path / "bag") as recorder:
        relay = CamRelay(settings, settings.attacks, MapPlace(None), recorder)
        relay.begin(BEGIN_NS)
        for cdrs in (odd, [packet_cdr(101)], odd):
            for cdr in cdrs:
                relay.take(cdr, BEGIN_NS, 0.0)
        sent = list(relay.due(BEGIN_NS + 5, 0.0))
    assert [one.cdr for one in sent] == [*odd, *odd]


@pytest.mark.parametrize(
    ("attack", "line"),
    [
        ({"type": "cam-dos", "parameters": {"rate_hz": 0}}, "cam-dos: rate_hz is 0"),
        ({"type": "cam-drop", "victim": "ego"}, "cam-drop: victim 'ego' is no station id"),
        (
            {"type": "cam-drop", "attackers": {"roadside_unit": {"x_m": 0, "y_m": 0}}},
            "cam-drop changes the CAMs that a vehicle sends",
        ),
    ],
)
def test_refusals(tmp_path: Path, attack: dict[str, Any], line: str) -> None:
    with pytest.raises(UsageError) as found:
        run(tmp_path, attack)
    assert str(found.value).startswith(line)
