"""Drives through a real Artery, which ADVPIPE_ARTERY_BIN names: build.sh builds it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.latched import latched_text
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_STATISTICS
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import core_of_tree
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

from .drives import our_instants, scenario, sent_of, stations_of

pytestmark = pytest.mark.nightly

DRIVE = ("simulation.duration_s=30", "traffic.vehicles=60", "simulation.warmup_s=15")
FREE_SPACE = (
    "v2x.radio={path_loss: free_space, shadowing: null, fading: none, sensitivity_dbm: -85, "
    "transmit_power_dbm: 10}"
)  # which reaches 228 m, less than the map is wide
NAKAGAMI = "v2x.radio={sensitivity_dbm: -85}"


@pytest.fixture(autouse=True)
def program() -> None:
    if "ADVPIPE_ARTERY_BIN" not in os.environ:
        pytest.skip("ADVPIPE_ARTERY_BIN names no Artery with advpipe's module")


def statistics(bag: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(latched_text(BagReader(bag), V2X_STATISTICS.name))
    return found


def per_100_m(found: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Pairs and receptions (10,) by distance."""
    pairs, received = (np.array(found[key][:20]).reshape(-1, 2).sum(axis=1) for key in ("pairs", "received"))
    return pairs, received


@pytest.mark.parametrize("radio", [FREE_SPACE, NAKAGAMI], ids=["free space", "nakagami"])
def test_a_drive_through_artery_is_like_ours(tmp_path: Path, radio: str) -> None:
    """The same scenario with either network: the same instants of CAMs by the same rules, and reception by
    distance, per 100 m, within five points."""
    for network in ("artery", "embedded"):
        simulate(scenario(*DRIVE, radio, f"v2x.network={network}"), tmp_path / network)
    stations = list(stations_of(tmp_path / "artery" / "clean"))
    assert len(stations) >= 20
    same = total = 0
    for station in stations:
        ours, artery = set(our_instants(station)), set(station.sent_ns)
        same, total = same + len(ours & artery), total + len(ours | artery)
    print(f"{same} of {total} CAM instants are the same")
    assert total > 1500
    assert same == total
    shares = {}
    for network in ("artery", "embedded"):
        pairs, received = per_100_m(statistics(tmp_path / network / "clean"))
        assert pairs[0] > 1000
        shares[network] = 100 * received / np.maximum(pairs, 1)
    apart = np.abs(shares["artery"] - shares["embedded"])[pairs > 500]
    print(f"reception at most {apart.max():.1f} points apart", np.round(shares["artery"], 1).tolist())
    assert apart.max() < 5


@pytest.mark.parametrize("radio", [FREE_SPACE, NAKAGAMI], ids=["free space", "nakagami"])
def test_an_attack_through_artery_is_like_ours(tmp_path: Path, radio: str) -> None:
    """The attacked messages through Artery again and through our radio: reception by distance, per 100 m,
    within five points. A change that leaves the lengths of messages changes nobody's receptions."""
    simulate(
        scenario("simulation.duration_s=15", *DRIVE[1:], radio, "v2x.network=artery"), tmp_path / "drive"
    )
    clean = tmp_path / "drive" / "clean"

    def through(network: str, type: str, **keys: object) -> dict[str, Any]:
        plain = {"type": type, "network": network, "attackers": {"share": 0.2}, **keys}
        out = tmp_path / f"{type} {network} {len(keys)}"
        attack(clean, out, AttackRequest((AttackSpec.model_validate(plain),)))
        return statistics(out)

    for type in ("cam-sybil-grid", "cam-replay", "cam-dos"):
        shares = []
        for network in ("artery", "embedded"):
            found = through(network, type)
            pairs, received = per_100_m(found)
            shares.append(100 * received / np.maximum(pairs, 1))
        apart = np.abs(shares[0] - shares[1])[pairs > 500]
        print(f"{type}: at most {apart.max():.1f} points apart", np.round(shares[0], 1).tolist())
        assert apart.max() < 5
    never = through("artery", "cam-speed-constant", schedule={"from_s": 14.9})
    assert through("artery", "cam-speed-constant") == never


def test_stations_are_where_and_when_they_say(tmp_path: Path) -> None:
    """Artery's CAMs tell the positions and the times of the drive's own states."""
    simulate(scenario("simulation.duration_s=3", "v2x.network=artery"), tmp_path / "drive")
    stations = {station.station_id: station for station in stations_of(tmp_path / "drive" / "clean")}
    sent = sent_of(tmp_path / "drive" / "clean")
    assert len(sent) > 100
    for one in sent:
        cam = core_of_tree(decode_cam_tree(one.payload))
        state = stations[one.station_id].states[one.request_ns // 100_000_000 * 100_000_000]
        assert cam.station_id == one.station_id
        assert cam.latitude_deg == pytest.approx(state.latitude_deg, abs=1e-6)
        assert cam.longitude_deg == pytest.approx(state.longitude_deg, abs=1e-6)
        assert cam.generation_delta_time_ms == pytest.approx(
            (state.time_ns // 1_000_000 - 1_072_915_200_000 + 5000) % 65536, abs=1
        )
