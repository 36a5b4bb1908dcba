"""A drive through what a real Artery told, which the stand-in plays back: `exchange.xz`; and an attack on it,
whose messages a real Artery sent and received: `attacked.xz`, with the checksum of what advpipe said in each
step, `attacked.sums`.

They were recorded with `record.py` and `SETTINGS`, by SUMO 1.28.0; with traffic that moves otherwise, the
vehicles would not be where Artery's stations are.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.latched import latched_text
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.topics import V2X_STATISTICS, VehicleTopics
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import core_of_tree
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

from .drives import our_instants, sent_of, stations_of

EXCHANGE, ATTACKED = (Path(__file__).parent / name for name in ("exchange.xz", "attacked.xz"))
AGAIN = Path(__file__).parents[4] / "pipeline" / "artery" / "standin.py"
SETTINGS = (
    "v2x.network=artery",
    "sensors={lidars: {}, gnss: {}}",
    "simulation={seed: 5, duration_s: 3, warmup_s: 3}",
    "traffic={vehicles: 14, pedestrians: 0, parked_per_km: 0}",
    "environment={buildings: 0, trees_per_km: 0, poles_per_km: 0, clutter_per_km: 0}",
)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory, standin: Callable[..., Path]) -> Path:
    """The recorded drive."""
    folder = tmp_path_factory.mktemp("exchange")
    program = standin("--play", str(EXCHANGE))
    simulate(load_scenario("smoke", [*SETTINGS, f"artery.program={program}"]), folder / "drive")
    return folder / "drive" / "clean"


def test_what_artery_sent_is_in_the_bag(drive: Path) -> None:
    sent = sent_of(drive)
    assert len(sent) > 100
    assert [one.number for one in sent] == sorted(one.number for one in sent)
    assert all(one.power_dbm == pytest.approx(23.0, abs=1e-6) for one in sent)
    for one in sent:
        assert core_of_tree(decode_cam_tree(one.payload)).station_id == one.station_id


def test_what_the_instrumented_vehicle_received_is_in_the_bag(drive: Path) -> None:
    reader, topics = BagReader(drive), VehicleTopics("ego")
    info = [message for _, message in reader.messages(topics.reception_info.name)]
    raw = [message for _, message in reader.messages(topics.received_raw.name)]
    truth = [message for _, message in reader.messages(topics.true_receptions.name)]
    assert len(info) == len(raw) == len(truth) > 50
    assert all(-96 < message.power_dbm < 0 < message.sinr_db for message in info)
    numbers = {one.number: one for one in sent_of(drive)}
    for packet, reception in zip(raw, truth, strict=True):
        assert bytes(packet.data)[4:] == numbers[reception.number].payload
        delay_ns = reception.header.stamp.sec * 10**9 + reception.header.stamp.nanosec
        assert 0 < delay_ns - numbers[reception.number].request_ns < 50_000_000
    maps = [message for _, message in reader.messages(topics.ldm.name)]
    assert len(maps) == 30
    assert len(maps[-1].objects) > 5
    assert (maps[-1].corrupt, maps[-1].expired, maps[-1].future) == (0, 0, 0)


def test_artery_sends_when_our_generator_does(drive: Path) -> None:
    for station in stations_of(drive):
        if station.sent_ns:
            assert station.sent_ns == our_instants(station)


def test_statistics_count_all_pairs(drive: Path) -> None:
    found = json.loads(latched_text(BagReader(drive), V2X_STATISTICS.name))
    assert set(found["outcomes"]) == {"received", "own", "lost"}
    assert found["outcomes"]["own"] == found["cams"] == len(sent_of(drive))
    assert sum(found["received"]) == found["outcomes"]["received"]
    assert sum(found["pairs"]) == found["outcomes"]["received"] + found["outcomes"]["lost"]
    assert len(found["busy_ns"]) > 20
    assert 0 < np.mean(found["busy_mean"]) < 0.5


def test_the_drive_can_be_attacked_through_our_radio(drive: Path, tmp_path: Path) -> None:
    spec = AttackSpec(type="cam-position-offset", parameters={})
    attack(drive, tmp_path / "attacked", AttackRequest((spec,), 1))
    before, after = sent_of(drive), sent_of(tmp_path / "attacked")
    assert [one.number for one in before] == [one.number for one in after]
    assert any(one.payload != other.payload for one, other in zip(before, after, strict=True))
    heard = list(BagReader(tmp_path / "attacked").messages(VehicleTopics("ego").received_raw.name))
    assert len(heard) > 50


@pytest.fixture
def artery_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Artery as it was when `attacked.xz` was recorded; it fails where it is told anything else than then."""
    program = tmp_path / "advpipe-artery"
    command = shlex.join([sys.executable, str(AGAIN), "--play", str(ATTACKED)])
    program.write_text(f'#!/bin/sh\nexec {command} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("ADVPIPE_ARTERY_BIN", str(program))


def attack_through_artery(drive: Path, out: Path, **keys: object) -> None:
    values = {"type": "cam-sybil-grid", "network": "artery", "attackers": {"share": 0.2}, **keys}
    attack(drive, out, AttackRequest((AttackSpec.model_validate(values),)))


@pytest.mark.usefixtures("artery_again")
def test_an_attack_goes_through_what_artery_told_of_it(drive: Path, tmp_path: Path) -> None:
    """The ghosts' messages leave from their attackers' radios, and a real Artery decided who hears them."""
    attack_through_artery(drive, tmp_path / "bag")
    reader, topics = BagReader(tmp_path / "bag"), VehicleTopics("ego")
    sent, honest = sent_of(tmp_path / "bag"), {one.number for one in sent_of(drive)}
    info = [message for _, message in reader.messages(topics.reception_info.name)]
    heard = [message.number for _, message in reader.messages(topics.true_receptions.name)]
    assert len(info) == len(heard) == 104
    assert all(-96 < message.power_dbm < 0 < message.sinr_db for message in info)
    assert len(set(heard) - honest) > 30
    assert set(heard) < {one.number for one in sent}
    found = json.loads(latched_text(reader, V2X_STATISTICS.name))
    assert found["outcomes"]["own"] == len(sent)
    assert found["outcomes"]["received"] == sum(found["received"])
    assert 0.2e-3 < found["delay_mean_s"] < 1e-3


@pytest.mark.usefixtures("artery_again")
@pytest.mark.parametrize("keys", [{"attackers": {"share": 0.5}}, {"type": "cam-position-offset"}])
def test_artery_is_told_of_another_attack(drive: Path, tmp_path: Path, keys: dict[str, object]) -> None:
    with pytest.raises(AdvpipeError, match="is not the one that was recorded"):
        attack_through_artery(drive, tmp_path / "bag", **keys)


def test_a_drive_with_packets_has_arterys(tmp_path: Path, standin: Callable[..., Path]) -> None:
    program = standin("--play", str(EXCHANGE))
    settings = [*SETTINGS, "v2x.geonetworking=true", f"artery.program={program}"]
    simulate(load_scenario("smoke", settings), tmp_path / "drive")
    reader = BagReader(tmp_path / "drive" / "clean")
    steps = list(V2xDrive(reader).steps())
    sent = [one for step in steps for one in step.sent]
    assert len(sent) > 100
    assert all(one.packet.endswith(one.payload) for one in sent)
    heard = list(reader.messages(VehicleTopics("ego").received_raw.name))
    assert len(heard) > 50
    assert VehicleTopics("ego").rejections.name not in reader.topics
