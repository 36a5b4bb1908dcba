"""Effects of attacks on the retransmitted drive; tshark decodes every false message."""

from __future__ import annotations

import shutil
import struct
import subprocess
from collections import Counter

import numpy as np
import pyarrow.parquet as pq
import pytest
from pydantic import TypeAdapter
from v2x_lane import context, edited, lane

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_STATIONS, V2X_STATISTICS
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.attack.v2x.delay import Delay, Stale
from advpipe.stages.attack.v2x.flood import Dos, DosDisruptive, DosDisruptiveSybil, DosRandom, DosRandomSybil
from advpipe.stages.attack.v2x.ghosts_ahead import GhostBrake, GhostStop
from advpipe.stages.attack.v2x.masquerade import Masquerade
from advpipe.stages.attack.v2x.replay import CamReplay, DisruptiveReplay
from advpipe.stages.attack.v2x.sybil import SybilCongestion, SybilGrid, SybilReplay
from advpipe.stages.simulate.run import simulate

ATTACK_CLASSES = (
    CamReplay,
    DisruptiveReplay,
    Stale,
    Delay,
    Masquerade,
    Dos,
    DosRandom,
    DosDisruptive,
    DosRandomSybil,
)
ATTACK_CLASSES += (DosDisruptiveSybil, SybilGrid, SybilReplay, SybilCongestion, GhostStop, GhostBrake)


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    settings = (
        "simulation.duration_s=4",
        "sensors.lidars.lidar.channels=1",
        "sensors.lidars.lidar.points_per_second=1000",
    )
    out = tmp_path_factory.mktemp("drive") / "drive"
    simulate(load_scenario("smoke", list(settings)), out)
    return BagReader(out / "clean")


@pytest.fixture(scope="module")
def beside_ego(reader):
    """Where an attacker sets up a radio: 30 m from where the ego is first."""
    _, message = next(reader.messages(V2X_STATIONS.name))
    ego = next(station for station in message.stations if station.vehicle == "ego")
    return {"roadside_unit": {"x_m": ego.pose.position.x + 30, "y_m": ego.pose.position.y}}


def sent_again(reader, folder, **keys):
    """CAMs received by the ego, by the station that sent them; its last map; the sum; the labels."""
    folder.mkdir()
    change = forge(reader, [attack_spec(keys)], 0)
    received, maps, statistics = Counter(), [], None
    for message in change.messages():
        if message.topic.name == "/ego/v2x/rx/cam":
            received[reader.decode(message).header.station_id.value] += 1
        elif message.topic.name == "/ego/ldm":
            maps.append(reader.decode(message))
        elif message.topic.name == V2X_STATISTICS.name:
            statistics = TypeAdapter(Statistics).validate_json(reader.decode(message).data)
    change.write_labels(folder)
    return received, maps, statistics, pq.read_table(folder / "v2x_labels.parquet").to_pylist()


def clean(reader):
    received = Counter(message.header.station_id.value for _, message in reader.messages("/ego/v2x/rx/cam"))
    ((_, message),) = reader.messages(V2X_STATISTICS.name)
    return received, TypeAdapter(Statistics).validate_json(message.data)


def test_a_flood_raises_the_channel_load(reader, beside_ego, tmp_path):
    """1500 messages a second of 0.2 ms: the channel near by is a good quarter busier; others lose more."""
    schedule = {"from_s": 2.0, "to_s": 3.0}
    received, _, statistics, labels = sent_again(
        *(reader, tmp_path / "labels"),
        type="cam-dos-random",
        attackers=beside_ego,
        parameters={"rate_hz": 1500},
        schedule=schedule,
    )
    before, quiet = clean(reader)
    assert len(labels) == 1500
    assert {row["action"] for row in labels} == {"added"}
    assert all(row["mattered"] for row in labels)
    load = dict(zip(statistics.busy_ns, statistics.busy_max, strict=True))
    usual = dict(zip(quiet.busy_ns, quiet.busy_max, strict=True))
    more = sorted(load[end_ns] - usual[end_ns] for end_ns in load)
    assert more[-8] > 0.25
    assert more[len(more) // 2] == pytest.approx(0, abs=0.02)
    theirs = sum(count for station, count in received.items() if station in before)
    assert theirs < 0.97 * before.total()


def test_ghost_vehicles_are_in_the_local_dynamic_map(reader, beside_ego, tmp_path):
    """Five ghost vehicles of a radio 30 m away: all in the ego's map, not one of them on the road."""
    _, maps, _, labels = sent_again(
        *(reader, tmp_path / "labels"),
        type="cam-sybil-grid",
        attackers=beside_ego,
        victim="ego",
        parameters={"around": "victim", "ghosts": 5},
        schedule={"from_s": 1.0},
    )
    ghosts = {row["false_station_id"] for row in labels}
    assert len(ghosts) == 5
    known = {entry.station_id for entry in maps[-1].objects}
    assert ghosts <= known
    assert all(row["true_x_m"] is None and row["mattered"] for row in labels)
    assert {row["attacker"] for row in labels} == {"roadside_unit_1"}


def test_no_message_of_an_attacker_that_drops_is_received(reader, tmp_path):
    received, _, _, labels = sent_again(
        reader, tmp_path / "labels", type="cam-drop", attackers={"share": 0.3}, schedule={"from_s": 0.0}
    )
    before, _ = clean(reader)
    silent = {row["station_id"] for row in labels}
    assert silent & set(before)
    assert not silent & set(received)
    # What the others send arrives as before, but for what the silent ones no longer disturb.
    for station in set(before) - silent:
        assert received[station] >= before[station]


@pytest.mark.oracle
def test_tshark_decodes_every_false_message(tmp_path):
    program = shutil.which("tshark")
    if program is None:
        pytest.skip("tshark is not installed")
    drive, payloads = lane({1: 0.0, 2: 50.0, 3: 90.0}, 40), []
    own = {one.payload for step in drive for one in step.sent}
    for attack_class in ATTACK_CLASSES:
        settings = {"delay_min_s": 0.5, "delay_max_s": 0.5, "restamp": True} if attack_class is Delay else {}
        false_payloads = [
            one.payload for one in edited(attack_class(context("cam", victim=2), **settings), drive)
        ]
        false_payloads = [payload for payload in false_payloads if payload not in own]
        assert false_payloads, attack_class
        payloads += false_payloads
    assert [encode_cam_tree(decode_cam_tree(payload)) for payload in payloads] == payloads
    path = tmp_path / "cams.pcap"
    records = [struct.pack("<IIII", 0, 0, len(one), len(one)) + one for one in payloads]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 147) + b"".join(records))
    fields = ("its.stationID", "cam.generationDeltaTime", "its.latitude", "its.longitude", "its.speedValue")
    command = [program, "-n", "-r", str(path), "-T", "fields", "-E", "occurrence=f"]
    command += ["-o", 'uat:user_dlts:"User 0 (DLT=147)","its","0","","0",""']
    for name in (*fields, "_ws.malformed"):
        command += ["-e", name]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(lines) == len(payloads)
    for payload, line in zip(payloads, lines, strict=True):
        station, delta_ms, latitude, longitude, speed, malformed = line.split("\t")
        cam = decode_cam(payload)
        assert malformed == ""
        assert (int(station), int(delta_ms)) == (cam.station_id, cam.generation_delta_time_ms)
        assert np.array([int(latitude), int(longitude)]) / 1e7 == pytest.approx(
            [cam.latitude_deg, cam.longitude_deg], abs=1e-9
        )
        assert int(speed) / 100 == pytest.approx(cam.speed_mps)
