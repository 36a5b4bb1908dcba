"""The section `v2x`: defaults, and values that are refused with their place."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.section import Shadowing


def test_the_defaults_are_the_documented_ones() -> None:
    radio = load_scenario("smoke").v2x.radio
    assert (radio.transmit_power_dbm, radio.frequency_hz, radio.bitrate_mbps) == (23, 5.9e9, 6)
    assert (radio.noise_dbm, radio.path_loss, radio.fading) == (-98, "dual_slope", "nakagami")
    assert radio.shadowing == Shadowing(near_stddev_db=5.6, far_stddev_db=8.1)


def test_each_loss_model_can_be_chosen() -> None:
    chosen = ["path_loss=free_space", "shadowing=null", "fading=none", "building_loss=obstacles"]
    radio = load_scenario("smoke", [f"v2x.radio.{choice}" for choice in chosen]).v2x.radio
    assert (radio.path_loss, radio.shadowing, radio.fading) == ("free_space", None, "none")
    assert radio.building_loss == "obstacles"


BAD = {
    "v2x.penetration=1.1": r"v2x\.penetration: .*less than or equal to 1, not 1\.1",
    "v2x.penetration=-0.1": r"v2x\.penetration: .*greater than or equal to 0",
    "v2x.penetration=.nan": r"v2x\.penetration: .*",
    "v2x.radio.transmit_power_dbm=90": r"transmit_power_dbm: .*less than or equal to 44",
    "v2x.radio.transmit_power_dbm=-31": r"transmit_power_dbm: .*greater than or equal to -30",
    "v2x.radio.frequency_hz=5.9": r"frequency_hz: .*greater than or equal to 700000000",
    "v2x.radio.frequency_hz=-5.9e9": r"frequency_hz: ",
    "v2x.radio.noise_dbm=.inf": r"noise_dbm: .*finite",
    "v2x.radio.bandwidth_mhz=7": r"bandwidth_mhz: Input should be 5, 10 or 20",
    "v2x.radio.bitrate_mbps=7": r"bitrate_mbps 7 is none of a 10 MHz channel \(3, 4\.5, 6, 9, 12",
    "v2x.radio.bandwidth_mhz=20": None,
    "v2x.radio={bandwidth_mhz: 20, bitrate_mbps: 3}": r"bitrate_mbps 3 is none of a 20 MHz channel \(6, 9",
    "v2x.radio.path_loss=two_ray": r"path_loss: Input should be 'free_space' or 'dual_slope', not 'two_ray'",
    "v2x.radio.processing_delay_min_s=0.5": r"processing_delay_min_s 0\.5 is above processing_delay_max_s 0",
    "v2x.cam={min_interval_s: 2}": r"min_interval_s 2 is above max_interval_s 1",
    "v2x.cam.dcc=none": None,
    "v2x.cam.dcc=limeric": r"dcc: Input should be 'none', 'reactive' or 'adaptive', not 'limeric'",
    "v2x.cam.dcc=adaptive": None,
    "v2x.cam.low_dynamics_cams=4": r"low_dynamics_cams: .*less than or equal to 3, not 4",
    "v2x.radio.vehicle_loss=knife_edge": None,
    "v2x.radio.shadowing.correlation_distance_m=0": r"correlation_distance_m: .*equal to 0\.1",
    "v2x.ldm.expiry_s=0": r"expiry_s: .*equal to 0\.01",
    "v2x.ldm.rate_hz=7": r"v2x\.ldm\.rate_hz 7 makes 0\.142857 s between snapshots, .*step_s 0\.1",
    "v2x.ldm.rate_hz=20": r"which is not a multiple of simulation\.step_s 0\.1",
    "v2x.ldm.rate_hz=5": None,
    "v2x.radio.fadding=none": r"unknown key; did you mean 'fading'\?",
}


@pytest.mark.parametrize(("override", "message"), BAD.items())
def test_errors_name_invalid_values(override: str, message: str | None) -> None:
    if message is None:
        assert load_scenario("smoke", [override])
        return
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario("smoke", [override])
    assert "\n" not in str(caught.value)
