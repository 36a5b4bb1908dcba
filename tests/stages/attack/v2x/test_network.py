"""Attacks whose messages go through Artery: its stand-in lets every station within 200 m receive them."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.latched import latched_text
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.topics import V2X_STATISTICS, VehicleTopics
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

STANDIN = Path(__file__).parents[3] / "pipeline" / "artery" / "standin.py"
DRIVE = (
    "sensors={lidars: {}, gnss: {}}",
    "simulation={seed: 5, duration_s: 3, warmup_s: 3}",
    "traffic={vehicles: 14, pedestrians: 0, parked_per_km: 0}",
    "environment={buildings: 0, trees_per_km: 0, poles_per_km: 0, clutter_per_km: 0}",
    "v2x.radio={building_loss: none, vehicle_loss: none}",
)
REACH_M = 200.0


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of messages that our own network recorded."""
    out = tmp_path_factory.mktemp("drive") / "drive"
    simulate(load_scenario("smoke", list(DRIVE)), out)
    return out / "clean"


@pytest.fixture(autouse=True)
def artery(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "advpipe-artery"
    program.write_text(
        f'#!/bin/sh\nexec {shlex.join([sys.executable, str(STANDIN)])} "$@"\n', encoding="utf-8"
    )
    program.chmod(0o755)
    monkeypatch.setenv("ADVPIPE_ARTERY_BIN", str(program))


def spec(type: str, **keys: object) -> AttackSpec:
    return AttackSpec.model_validate({"network": "artery", **keys, "type": type})


def steps_of(bag: Path) -> list[V2xStep]:
    return list(V2xDrive(BagReader(bag)).steps())


def heard_by_ego(bag: Path) -> set[int]:
    reader = BagReader(bag)
    return {one.number for _, one in reader.messages(VehicleTopics("ego").true_receptions.name)}


def in_reach_of_ego(steps: list[V2xStep]) -> set[int]:
    """The numbers of the messages that the stand-in lets ego receive."""
    found = set[int]()
    for step in steps:
        places = {radio.vehicle: radio for radio in step.radios}
        if "ego" not in places:
            continue
        place_m = {radio.station_id: radio.map_SE3_base[:3, 3] for radio in step.radios}
        for one in step.sent:
            if one.station_id != places["ego"].station_id:
                away_m = np.linalg.norm(place_m[one.station_id] - places["ego"].map_SE3_base[:3, 3])
                found |= {one.number} if away_m < REACH_M else set()
    return found


def test_ghosts_are_heard_where_their_attackers_radio_is(drive: Path, tmp_path: Path) -> None:
    attack(drive, tmp_path / "bag", AttackRequest((spec("cam-sybil-grid", attackers={"share": 0.2}),)))
    clean, forged = steps_of(drive), steps_of(tmp_path / "bag")
    sent = [one for step in forged for one in step.sent]
    ghosts = {one.number for one in sent} - {one.number for step in clean for one in step.sent}
    assert len(ghosts) > 20
    heard = heard_by_ego(tmp_path / "bag")
    assert heard == in_reach_of_ego(forged)
    assert heard & ghosts
    found = json.loads(latched_text(BagReader(tmp_path / "bag"), V2X_STATISTICS.name))
    assert set(found["outcomes"]) == {"received", "own", "lost"}
    assert found["cams"] == len(sent)
    assert set(found["busy_mean"]) == {0.125}


def test_a_roadside_unit_stands_still_and_is_heard(drive: Path, tmp_path: Path) -> None:
    ego = next(radio for radio in steps_of(drive)[10].radios if radio.vehicle == "ego")
    x_m, y_m = ego.map_SE3_base[:2, 3].tolist()
    unit = {"roadside_unit": {"x_m": x_m, "y_m": y_m}}
    attack(drive, tmp_path / "bag", AttackRequest((spec("cam-sybil-grid", attackers=unit),)))
    forged = steps_of(tmp_path / "bag")
    ids = {
        radio.station_id for step in forged for radio in step.radios if radio.vehicle.startswith("roadside")
    }
    false = {one.number for step in forged for one in step.sent if one.station_id in ids}
    assert len(false) > 20
    assert heard_by_ego(tmp_path / "bag") == in_reach_of_ego(forged)
    assert heard_by_ego(tmp_path / "bag") & false


def test_an_attack_on_gps_and_one_on_messages_go_through_it(drive: Path, tmp_path: Path) -> None:
    attacks = (
        AttackSpec.model_validate({"type": "gnss-bias", "victim": "ego", "network": "artery"}),
        spec("cam-replay", attackers={"share": 0.2}, network="embedded"),
    )
    attack(drive, tmp_path / "bag", AttackRequest(attacks))
    assert heard_by_ego(tmp_path / "bag") == in_reach_of_ego(steps_of(tmp_path / "bag"))
    assert "network: artery" in (tmp_path / "bag" / "attack.yaml").read_text(encoding="utf-8")


def test_same_seed_same_bytes(drive: Path, tmp_path: Path) -> None:
    request = AttackRequest((spec("cam-replay", attackers={"share": 0.2}),))
    for name in ("one", "two"):
        attack(drive, tmp_path / name / "bag", request)
    one, two = (next((tmp_path / name / "bag").glob("*.mcap")).read_bytes() for name in ("one", "two"))
    assert one == two


def test_without_artery_nothing_is_written(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ADVPIPE_ARTERY_BIN", str(tmp_path / "none"))
    request = AttackRequest((spec("cam-replay", attackers={"share": 0.2}),))
    with pytest.raises(UsageError, match="ADVPIPE_ARTERY_BIN: there is no file"):
        attack(drive, tmp_path / "bag", request)
    assert not (tmp_path / "bag").exists()


def test_an_attack_on_clouds_has_no_use_for_it() -> None:
    with pytest.raises(UsageError, match="detach has no use for network; leave it out"):
        AttackRequest((spec("detach"),)).check()


def test_attackers_are_those_of_our_radio(drive: Path, tmp_path: Path) -> None:
    """The radio changes who hears a message, and nothing of what is sent."""
    sent = dict[str, list[Sent]]()
    for network in ("artery", "embedded"):
        one = spec("cam-position-offset", attackers={"share": 0.2}, network=network)
        attack(drive, tmp_path / network, AttackRequest((one,)))
        sent[network] = [one for step in steps_of(tmp_path / network) for one in step.sent]
    assert sent["artery"] == sent["embedded"]
