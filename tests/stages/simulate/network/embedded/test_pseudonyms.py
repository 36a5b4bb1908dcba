"""Drives in which stations change their pseudonyms: everything that names a station changes together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cryptography")

from advpipe.pipeline.bag.pseudonyms import read_pseudonyms
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.v2x import sent_of_message
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.facilities.denm import decode_denm
from advpipe.pipeline.v2x.geonetworking.packet import parse_broadcast, parse_packet
from advpipe.pipeline.v2x.message_type import claimed_station_id, is_cam
from advpipe.pipeline.v2x.security.envelope import Envelope
from advpipe.stages.simulate.run import simulate

SETTINGS = (
    "vehicles={}",
    "simulation.duration_s=5",
    "v2x.penetration=1",
    "v2x.security=etsi",
    "v2x.denm={stopped_s: 0.5, braking_mps2: 2.0}",
    "v2x.pseudonyms={period_s: 1.5, variation: 0.1}",
)


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> BagReader:
    out = tmp_path_factory.mktemp("pseudonyms") / "drive"
    return BagReader(simulate(load_scenario("smoke", SETTINGS), out).bag)


def sent(reader: BagReader) -> list[tuple[Sent, Any]]:
    """The messages, each with its packet."""
    packets = {one.number: bytes(one.data) for _, one in reader.messages("/v2x/packets")}
    messages = [sent_of_message(one) for _, one in reader.messages("/v2x/sent")]
    return [(one, parse_packet(packets[one.number])) for one in messages]


def test_id_ticket_and_address_change_together(reader: BagReader) -> None:
    by_pseudonym: dict[int, set[tuple[int, bytes, bytes]]] = {}
    for one, packet in sent(reader):
        envelope = Envelope.decode(packet.content)
        mac = parse_broadcast(envelope.content).sender.mac
        claimed = claimed_station_id(one.payload)
        assert claimed is not None
        by_pseudonym.setdefault(claimed, set()).add((one.station_id, envelope.digest, mac))
    assert all(len(names) == 1 for names in by_pseudonym.values())
    names = [next(iter(names)) for names in by_pseudonym.values()]
    for part in (1, 2):
        assert len({name[part] for name in names}) == len(names) > len({name[0] for name in names}) + 20


def test_the_truth_says_who_called_itself_what(reader: BagReader) -> None:
    uses = read_pseudonyms(reader)
    radios = {one.pseudonym: one.station_id for one in uses}
    since_ns = {one.pseudonym: one.time_ns for one in uses}
    assert len(radios) == len(uses) > 20
    last: dict[int, int] = {}
    for one, _ in sent(reader):
        claimed = claimed_station_id(one.payload) or 0
        assert radios.get(claimed, claimed) == one.station_id
        assert one.request_ns >= since_ns.get(claimed, 0)
        last[one.station_id] = claimed
    assert set(last.values()) & set(radios)


def test_a_new_pseudonym_begins_without_a_past(reader: BagReader) -> None:
    firsts: dict[int, Any] = {}
    for one, _ in sent(reader):
        if is_cam(one.payload):
            cam = decode_cam(one.payload)
            firsts.setdefault(cam.station_id, cam)
    changed = [firsts[use.pseudonym] for use in read_pseudonyms(reader) if use.pseudonym in firsts]
    assert len(changed) > 20
    assert all(cam.low_frequency is not None and len(cam.low_frequency.path_history) <= 1 for cam in changed)


def test_an_event_keeps_its_identity_while_it_is_announced(reader: BagReader) -> None:
    denms = [(one, decode_denm(one.payload)) for one, _ in sent(reader) if not is_cam(one.payload)]
    assert len(denms) > 20
    radios: dict[Any, set[int]] = {}
    for one, denm in denms:
        assert denm.station_id == denm.action.station_id
        radios.setdefault(denm.action, set()).add(one.station_id)
    assert all(len(each) == 1 for each in radios.values())


def test_a_silent_station_sends_nothing(tmp_path: Path) -> None:
    rules = "{strategy: silent_period, period_s: 1, silent_min_s: 1, silent_max_s: 1}"
    settings = [*SETTINGS[:3], f"v2x.pseudonyms={rules}"]
    silent = BagReader(simulate(load_scenario("smoke", settings), tmp_path / "drive").bag)
    times_ns: dict[int, list[int]] = {}
    for _, one in silent.messages("/v2x/sent"):
        times_ns.setdefault(one.station_id, []).append(build.stamp_ns(one))
    uses = read_pseudonyms(silent)
    assert len(uses) > 20
    for use in uses:
        quiet = (use.time_ns - 900_000_000, use.time_ns)
        assert not [t for t in times_ns.get(use.station_id, []) if quiet[0] <= t < quiet[1]]
