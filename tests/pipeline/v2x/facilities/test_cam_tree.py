from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.codec.codes import AccelerationControl, DriveDirection, ExteriorLights, VehicleRole
from advpipe.pipeline.v2x.facilities.cam import Cam, LowFrequency, PathPoint, cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import (
    cam_of_tree,
    cam_tree,
    core_of_tree,
    decode_cam,
    encode_cam,
)
from advpipe.pipeline.v2x.facilities.station_state import StationState

CamTree = dict[str, Any]
UNAVAILABLE = {"steeringWheelAngle": (512, 127), "lateralAcceleration": (161, 102)} | {
    "verticalAcceleration": (161, 102)
}


def normal(tree: CamTree) -> CamTree:
    """Without the few values that have a twin of the same meaning: the twin in their place."""
    basic = tree["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    basic["longitude"] = max(basic["longitude"], -1_799_999_999)
    ellipse = basic["positionConfidenceEllipse"]
    ellipse["semiMajorOrientation"] %= 3600 if ellipse["semiMajorOrientation"] == 3600 else 4000
    kind, high = tree["cam"]["camParameters"]["highFrequencyContainer"]
    if kind.startswith("basic"):
        heading = high["heading"]
        heading["headingValue"] %= 3600 if heading["headingValue"] == 3600 else 4000
        for name, codes in UNAVAILABLE.items():
            if name in high and tuple(high[name].values()) == codes:
                del high[name]
    return tree


def test_nothing_is_lost_between_values_and_si_units(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(0)
    for _ in range(500):
        tree = normal(random_cam_tree(rng))
        assert cam_tree(cam_of_tree(tree)) == tree


def test_the_core_equals_the_fields_of_the_cam(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        tree = random_cam_tree(rng)
        core, cam = core_of_tree(tree), cam_of_tree(tree)
        assert core == tuple(getattr(cam, name) for name in core._fields)


def test_the_vector_in_si_units(cam_vector: bytes) -> None:
    cam = decode_cam(cam_vector)
    assert (cam.latitude_deg, cam.longitude_deg, cam.altitude_m) == (48.7654321, -9.1234567, 374.5)
    assert cam.heading_rad == pytest.approx(math.radians(123.4))
    assert (cam.speed_mps, cam.length_m, cam.width_m) == (13.89, 4.5, 1.8)
    assert cam.longitudinal_acceleration_mps2 == -1.2
    assert cam.curvature_per_m == -0.0037  # to the right
    assert cam.yaw_rate_radps == pytest.approx(math.radians(-5.12))
    assert cam.acceleration_control == AccelerationControl.GAS_PEDAL
    assert cam.low_frequency is not None
    assert cam.low_frequency.exterior_lights == ExteriorLights.LOW_BEAM
    assert cam.low_frequency.path_history[1] == PathPoint(-110e-7, 58e-7, None, 2.2)
    assert encode_cam(cam) == cam_vector


def test_only_altered_fields_of_a_cam_change(cam_vector: bytes) -> None:
    altered = dataclasses.replace(decode_cam(cam_vector), speed_mps=0.0, latitude_deg=48.0)
    before, after = decode_cam_tree(cam_vector), decode_cam_tree(encode_cam(altered))
    high = before["cam"]["camParameters"]["highFrequencyContainer"][1]
    high["speed"]["speedValue"] = 0
    before["cam"]["camParameters"]["basicContainer"]["referencePosition"]["latitude"] = 480_000_000
    assert after == before


def test_a_full_state_arrives_within_one_unit(car: Callable[..., StationState]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        state = car(
            latitude_deg=rng.uniform(-89, 89),
            longitude_deg=rng.uniform(-180, 180),
            altitude_m=rng.uniform(-500, 5000),
            heading_rad=rng.uniform(-10, 10),
            speed_mps=rng.uniform(0, 80),
            length_m=rng.uniform(1, 25),
            width_m=rng.uniform(0.5, 3),
            longitudinal_acceleration_mps2=rng.uniform(-9, 9),
            lateral_acceleration_mps2=rng.uniform(-9, 9),
            yaw_rate_radps=rng.uniform(-1, 1),
            curvature_per_m=rng.uniform(-0.1, 0.1),
            heading_std_rad=math.radians(rng.uniform(0, 5)),
            speed_std_mps=rng.uniform(0, 0.5),
            drive_direction=DriveDirection.BACKWARD,
            acceleration_control=AccelerationControl.BRAKE_PEDAL,
        )
        cam = decode_cam(encode_cam(cam_of_state(state)))
        assert cam.latitude_deg == pytest.approx(state.latitude_deg, abs=0.51e-7)
        assert cam.longitude_deg == pytest.approx(state.longitude_deg, abs=0.51e-7)
        assert cam.altitude_m == pytest.approx(state.altitude_m, abs=0.0051)
        assert cam.heading_rad is not None
        turn = math.remainder(cam.heading_rad - state.heading_rad, math.tau)
        assert abs(turn) <= math.radians(0.051)
        for name, step in (
            ("speed_mps", 0.01),
            ("length_m", 0.1),
            ("width_m", 0.1),
            ("longitudinal_acceleration_mps2", 0.1),
            ("lateral_acceleration_mps2", 0.1),
        ):
            above = getattr(cam, name) - getattr(state, name)
            assert -1e-6 * step <= above < step, name  # rounded up
        assert cam.yaw_rate_radps == pytest.approx(state.yaw_rate_radps, abs=math.radians(0.0051))
        assert cam.curvature_per_m == pytest.approx(state.curvature_per_m, abs=0.51e-4)
        assert cam.speed_confidence_mps == pytest.approx(1.96 * state.speed_std_mps + 0.005, abs=0.0055)
        assert cam.drive_direction == DriveDirection.BACKWARD
        assert cam.acceleration_control == AccelerationControl.BRAKE_PEDAL


def test_missing_values_of_a_state_are_unavailable(car: Callable[..., StationState]) -> None:
    cam = decode_cam(encode_cam(cam_of_state(car())))
    assert cam.altitude_m is cam.semi_major_m is cam.yaw_rate_radps is cam.curvature_per_m is None
    assert cam.lateral_acceleration_mps2 is cam.low_frequency is None
    high = cam_tree(cam)["cam"]["camParameters"]["highFrequencyContainer"][1]
    assert "lateralAcceleration" not in high


def test_the_low_frequency_container_round_trips(car: Callable[..., StationState]) -> None:
    low = LowFrequency(
        vehicle_role=VehicleRole.TAXI,
        exterior_lights=ExteriorLights.LOW_BEAM | ExteriorLights.LEFT_TURN_SIGNAL,
        path_history=(PathPoint(-1e-4, 2e-4, 0.25, 1.5), PathPoint(-1e-4, 2e-4, None, None)),
    )
    cam = decode_cam(encode_cam(cam_of_state(car(), low)))
    assert cam.low_frequency == low


def test_forbidden_codes_of_heading_and_longitude_are_never_sent(car: Callable[..., StationState]) -> None:
    tree = cam_tree(cam_of_state(car(heading_rad=math.radians(359.97), longitude_deg=-180.0)))
    parameters = tree["cam"]["camParameters"]
    assert parameters["highFrequencyContainer"][1]["heading"]["headingValue"] == 0
    assert parameters["basicContainer"]["referencePosition"]["longitude"] == 1_800_000_000


def test_a_state_that_no_cam_can_represent_is_refused(car: Callable[..., StationState]) -> None:
    with pytest.raises(CamError, match="speed_mps is nan"):
        encode_cam(cam_of_state(car(speed_mps=math.nan)))
    with pytest.raises(CamError, match="latitude_deg 95 is outside"):
        encode_cam(cam_of_state(car(latitude_deg=95.0)))


def test_a_roadside_units_cam_round_trips(random_cam_tree: Callable[..., CamTree]) -> None:
    cam = Cam(station_id=1, station_type=15, generation_delta_time_ms=5, roadside={})
    payload = encode_cam(cam)
    assert decode_cam(payload) == cam
    kind, _ = decode_cam_tree(payload)["cam"]["camParameters"]["highFrequencyContainer"]
    assert kind == "rsuContainerHighFrequency"


def test_containers_of_a_later_release_are_refused(cam_vector: bytes) -> None:
    tree = decode_cam_tree(cam_vector)
    tree["cam"]["camParameters"]["highFrequencyContainer"] = ("_ext_0", b"\x12")
    with pytest.raises(CamError, match="of a later release"):
        decode_cam(encode_cam_tree(tree))
