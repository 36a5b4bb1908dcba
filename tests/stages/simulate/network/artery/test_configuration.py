"""Artery's configuration, line by line of what the scenario says."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.network.artery.configuration import check_supported, write_configuration


def lines(folder: Path, *settings: str) -> dict[str, str]:
    scenario = load_scenario("smoke", ["v2x.network=artery", *settings])
    check_supported(scenario)
    write_configuration(scenario, folder, sumo=("127.0.0.1", 8813), order=1, port=4711)
    text = (folder / "omnetpp.ini").read_text(encoding="utf-8").splitlines()
    return dict(line.split(" = ", 1) for line in text if " = " in line)


def test_the_radio_and_the_rules_are_the_scenarios(tmp_path: Path) -> None:
    found = lines(
        tmp_path,
        "v2x.radio={transmit_power_dbm: 20, frequency_hz: 5.89e9, bitrate_mbps: 12, noise_dbm: -104, "
        "sensitivity_dbm: -92, carrier_sense_dbm: -84, snir_threshold_db: 4, capture_threshold_db: 7, "
        "antenna_height_m: 1.6}",
        "v2x.cam={min_interval_s: 0.2, max_interval_s: 0.9, heading_deg: 5, position_m: 3, speed_mps: 0.4, "
        "path_points: 10, dcc: adaptive}",
    )
    wlan, service = "*.node[*].wlan[*]", "*.node[*].middleware.CA"
    assert found[f"{wlan}.radio.transmitter.power"] == "100.0mW"
    assert found[f"{wlan}.radio.channelNumber"] == "178"
    assert found[f"{wlan}.radio.carrierFrequency"] == "5.89GHz"
    assert found[f"{wlan}.bitrate"] == "12.0Mbps"
    assert found["*.radioMedium.backgroundNoise.power"] == "-104.0dBm"
    assert found[f"{wlan}.radio.receiver.sensitivity"] == "-92.0dBm"
    assert found[f"{wlan}.radio.receiver.energyDetection"] == "-84.0dBm"
    assert found[f"{wlan}.radio.receiver.snirThreshold"] == "4.0dB"
    assert found[f"{wlan}.radio.receiver.captureThreshold"] == "7.0dB"
    assert found["*.node[*].mobility.antennaHeight"] == "1.6m"
    assert found[f"{service}.minInterval"] == "0.2s"
    assert found[f"{service}.maxInterval"] == "0.9s"
    assert found[f"{service}.headingDelta"] == "5.0"
    assert found[f"{service}.positionDelta"] == "3.0m"
    assert found[f"{service}.speedDelta"] == "0.4mps"
    assert found[f"{service}.pathHistoryLength"] == "10"
    assert found["*.node[*].vanetza[*].dcc.typename"] == '"LimericDccEntity"'
    assert found["*.traci.launcher.port"] == "8813"
    assert found["*.traci.nodes.port"] == "4711"


@pytest.mark.parametrize(
    ("radio", "model"),
    [
        ("{path_loss: free_space, shadowing: null, fading: none}", {"pathLossType": '"FreeSpacePathLoss"'}),
        ("{}", {"gamma1": "2.0", "gamma2": "4.0", "sigma1": "5.6dB", "sigma2": "8.1dB"}),
        ("{shadowing: null, far_exponent: 3.5}", {"sigma1": "0.0dB", "sigma2": "0.0dB", "gamma2": "3.5"}),
        ("{path_loss: free_space, shadowing: null}", {"gamma1": "2.0", "gamma2": "2.0"}),
        (
            "{shadowing: null, fading: none}",
            {"shapes": 'xml("<shapes default=\\"1e+06\\" />")', "pathLossType": '"VanetNakagamiFading"'},
        ),
    ],
)
def test_every_path_loss_has_a_model(tmp_path: Path, radio: str, model: dict[str, str]) -> None:
    found = lines(tmp_path, f"v2x.radio={radio}")
    for key, value in model.items():
        prefix = "*.radioMedium." if key == "pathLossType" else "*.radioMedium.pathLoss."
        assert found[prefix + key] == value
    assert ("*.radioMedium.pathLoss.shapes" in found) == ("shapes" in model)


def test_the_seed_is_the_scenarios(tmp_path: Path) -> None:
    first = lines(tmp_path, "simulation.seed=1")["seed-0-mt"]
    assert lines(tmp_path, "simulation.seed=1")["seed-0-mt"] == first
    assert lines(tmp_path, "simulation.seed=2")["seed-0-mt"] != first


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("v2x.security=etsi", "v2x.security: etsi"),
        ("v2x.denm={}", "v2x.denm"),
        ("v2x.radio.bandwidth_mhz=20", "v2x.radio.bandwidth_mhz other than 10"),
        ("v2x.radio.frequency_hz=5.9012e9", "v2x.radio.frequency_hz 5.9012e"),
        ("v2x.radio.building_loss=obstacles", "v2x.radio.building_loss"),
        ("v2x.radio.interference=false", "v2x.radio.interference: false"),
        ("v2x.radio.shadowing.correlation_distance_m=20", "v2x.radio.shadowing.correlation_distance_m"),
    ],
)
def test_what_artery_lacks_is_refused_by_name(tmp_path: Path, setting: str, named: str) -> None:
    with pytest.raises(UsageError, match=f"artery cannot do .*{named}.*; change it, or use embedded"):
        lines(tmp_path, setting)


def test_traffic_without_sumo_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"needs SUMO, which it steps, but traffic\.source is trajectories"):
        lines(tmp_path, "traffic.source=trajectories")
