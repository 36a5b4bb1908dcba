"""tshark, an independent decoder, reads the same values from the same bytes."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cam_as_message import cam_of_message

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.codec.btp import btp_packet, cam_payload
from advpipe.pipeline.v2x.codec.codec import asn1_cam, decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import cam_tree, decode_cam
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS, CamGenerator
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.stages.simulate.run import simulate

CamTree = dict[str, Any]

pytestmark = pytest.mark.oracle

LINK_BARE, LINK_BTP = 147, 148
DISSECTORS = '"User 0 (DLT=147)","its","0","","0",""', '"User 1 (DLT=148)","btpb","0","","0",""'

BASIC = "cam.camParameters.basicContainer"
POSITION = f"{BASIC}.referencePosition"
ELLIPSE = f"{POSITION}.positionConfidenceEllipse"
HIGH, LOW = "cam.camParameters.highFrequencyContainer", "cam.camParameters.lowFrequencyContainer"
FIELDS = {
    "its.protocolVersion": "header.protocolVersion",
    "its.messageID": "header.messageID",
    "its.stationID": "header.stationID",
    "cam.generationDeltaTime": "cam.generationDeltaTime",
    "cam.stationType": f"{BASIC}.stationType",
    "its.latitude": f"{POSITION}.latitude",
    "its.longitude": f"{POSITION}.longitude",
    "its.semiMajorConfidence": f"{ELLIPSE}.semiMajorConfidence",
    "its.semiMinorConfidence": f"{ELLIPSE}.semiMinorConfidence",
    "its.semiMajorOrientation": f"{ELLIPSE}.semiMajorOrientation",
    "its.altitudeValue": f"{POSITION}.altitude.altitudeValue",
    "its.altitudeConfidence": f"{POSITION}.altitude.altitudeConfidence",
    "its.headingValue": f"{HIGH}.heading.headingValue",
    "its.headingConfidence": f"{HIGH}.heading.headingConfidence",
    "its.speedValue": f"{HIGH}.speed.speedValue",
    "its.speedConfidence": f"{HIGH}.speed.speedConfidence",
    "cam.driveDirection": f"{HIGH}.driveDirection",
    "its.vehicleLengthValue": f"{HIGH}.vehicleLength.vehicleLengthValue",
    "its.vehicleLengthConfidenceIndication": f"{HIGH}.vehicleLength.vehicleLengthConfidenceIndication",
    "cam.vehicleWidth": f"{HIGH}.vehicleWidth",
    "its.longitudinalAccelerationValue": f"{HIGH}.longitudinalAcceleration.longitudinalAccelerationValue",
    "its.longitudinalAccelerationConfidence": (
        f"{HIGH}.longitudinalAcceleration.longitudinalAccelerationConfidence"
    ),
    "its.curvatureValue": f"{HIGH}.curvature.curvatureValue",
    "its.curvatureConfidence": f"{HIGH}.curvature.curvatureConfidence",
    "cam.curvatureCalculationMode": f"{HIGH}.curvatureCalculationMode",
    "its.yawRateValue": f"{HIGH}.yawRate.yawRateValue",
    "its.yawRateConfidence": f"{HIGH}.yawRate.yawRateConfidence",
    "cam.accelerationControl": f"{HIGH}.accelerationControl",
    "cam.lanePosition": f"{HIGH}.lanePosition",
    "its.steeringWheelAngleValue": f"{HIGH}.steeringWheelAngle.steeringWheelAngleValue",
    "its.steeringWheelAngleConfidence": f"{HIGH}.steeringWheelAngle.steeringWheelAngleConfidence",
    "its.lateralAccelerationValue": f"{HIGH}.lateralAcceleration.lateralAccelerationValue",
    "its.lateralAccelerationConfidence": f"{HIGH}.lateralAcceleration.lateralAccelerationConfidence",
    "its.verticalAccelerationValue": f"{HIGH}.verticalAcceleration.verticalAccelerationValue",
    "its.verticalAccelerationConfidence": f"{HIGH}.verticalAcceleration.verticalAccelerationConfidence",
    "cam.performanceClass": f"{HIGH}.performanceClass",
    "cam.vehicleRole": f"{LOW}.vehicleRole",
    "cam.exteriorLights": f"{LOW}.exteriorLights",
    "its.deltaLatitude": f"{LOW}.pathHistory.*.pathPosition.deltaLatitude",
    "its.deltaLongitude": f"{LOW}.pathHistory.*.pathPosition.deltaLongitude",
    "its.deltaAltitude": f"{LOW}.pathHistory.*.pathPosition.deltaAltitude",
    "its.pathDeltaTime": f"{LOW}.pathHistory.*.pathDeltaTime",
}
"""tshark's fields, and where we have the same value."""


def capture(path: Path, packets: Sequence[bytes], link_type: int) -> None:
    """A pcap file of packets without any link layer."""
    records = [struct.pack("<IIII", 0, 0, len(packet), len(packet)) + packet for packet in packets]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link_type) + b"".join(records))


def tshark(path: Path, fields: Sequence[str]) -> list[list[str]]:
    if (program := shutil.which("tshark")) is None:
        pytest.skip("tshark is not installed")
    command = [program, "-n", "-r", str(path), "-T", "fields", "-E", "occurrence=a", "-E", "aggregator=,"]
    for dissector in DISSECTORS:
        command += ["-o", f"uat:user_dlts:{dissector}"]
    for field in fields:
        command += ["-e", field]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [line.split("\t") for line in output.splitlines()]


def ours(tree: Any, asn1: Any, path: list[str]) -> list[str]:
    """The raw values at a path, as tshark prints them; [] where the CAM has none."""
    if not path:
        if asn1.TYPE == "ENUMERATED":
            return [str(asn1._cont[tree])]
        if asn1.TYPE == "BIT STRING":
            value, length = tree
            return [f"{value << (-length % 8):02x}"]
        return [str(tree)]
    if asn1.TYPE == "CHOICE":
        return ours(tree[1], asn1._cont[tree[0]], path) if tree[0].startswith("basicVehicle") else []
    if asn1.TYPE == "SEQUENCE OF":
        return [text for item in tree for text in ours(item, asn1._cont, path[1:])]
    if path[0] not in tree:
        return []
    return ours(tree[path[0]], asn1._cont[path[0]], path[1:])


def agree(folder: Path, trees: list[CamTree]) -> None:
    """Without a toll zone or other containers, whose latitudes tshark would list with the first."""
    path = folder / "cams.pcap"
    capture(path, [encode_cam_tree(tree) for tree in trees], LINK_BARE)
    lines = tshark(path, [*FIELDS, "_ws.malformed"])
    assert len(lines) == len(trees)
    for tree, (*texts, malformed) in zip(trees, lines, strict=True):
        assert malformed == ""
        for (field, place), text in zip(FIELDS.items(), texts, strict=True):
            assert text == ",".join(ours(tree, asn1_cam(), place.split("."))), field


def test_tshark_decodes_random_cams(tmp_path: Path, random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(0)
    trees = [random_cam_tree(rng, vehicle=True) for _ in range(400)]
    for tree in trees:
        parameters = tree["cam"]["camParameters"]
        parameters.pop("specialVehicleContainer", None)
        parameters["highFrequencyContainer"][1].pop("cenDsrcTollingZone", None)
    agree(tmp_path, trees)


def test_tshark_decodes_every_cam_of_a_drive(tmp_path: Path, car: Callable[..., StationState]) -> None:
    """A minute on a ring of 100 m radius, with every field that our stations fill."""
    generator, trees = CamGenerator(0), []
    for check in range(600):
        angle_rad, time_ns = 0.014 * check, check * CHECK_INTERVAL_NS
        state = car(
            time_ns=1_767_268_800 * 10**9 + time_ns,
            latitude_deg=48 + 100 * math.cos(angle_rad) / 111_200,
            longitude_deg=11 + 100 * math.sin(angle_rad) / 74_500,
            altitude_m=520.0 + math.sin(angle_rad),
            heading_rad=angle_rad + math.pi / 2,
            speed_mps=14.0,
            yaw_rate_radps=-0.14,
            curvature_per_m=-0.01,
            longitudinal_acceleration_mps2=0.3 * math.sin(angle_rad),
            lateral_acceleration_mps2=-1.96,
            east_north_covariance_m2=(0.5, 0.1, 0.3),
            altitude_std_m=1.0,
            heading_std_rad=0.01,
            speed_std_mps=0.05,
            acceleration_std_mps2=0.1,
            yaw_rate_std_radps=0.002,
            curvature_std_per_m=0.0002,
        )
        if (sent := generator.check(time_ns, state)) is not None:
            trees.append(cam_tree(decode_cam(sent.payload)))
    assert len(trees) > 150
    agree(tmp_path, trees)


def test_tshark_decodes_every_cam_of_a_recorded_drive(tmp_path: Path) -> None:
    """Three listeners in dense traffic: what was sent, and what was received and recorded as values."""
    settings = [
        "simulation.duration_s=3",
        "traffic.vehicles=100",
        "v2x.penetration=1",
        "vehicles={ego: {}, one: {}, two: {}}",
        "sensors.lidars.lidar.channels=1",
        "sensors.lidars.lidar.points_per_second=1000",
    ]
    simulate(load_scenario("smoke", settings), tmp_path / "drive")
    reader = BagReader(tmp_path / "drive" / "clean")
    payloads = [bytes(message.payload) for _, message in reader.messages("/v2x/sent")]
    trees = [decode_cam_tree(payload) for payload in payloads]
    assert len(trees) > 500
    assert [encode_cam_tree(tree) for tree in trees] == payloads
    agree(tmp_path, trees)
    sent = set(payloads)
    for vehicle in ("ego", "one", "two"):
        for way in ("tx", "rx"):
            raw = list(reader.messages(f"/{vehicle}/v2x/{way}/raw"))
            cams = list(reader.messages(f"/{vehicle}/v2x/{way}/cam"))
            assert [stamp for stamp, _ in raw] == [stamp for stamp, _ in cams]
            values = [cam_of_message(message) for _, message in cams]
            carried = [cam_payload(bytes(message.data)) for _, message in raw]
            assert [encode_cam_tree(tree) for tree in values] == carried
            assert sent.issuperset(carried)
            agree(tmp_path, values)


def test_tshark_decodes_the_btp_header(tmp_path: Path, cam_vector: bytes) -> None:
    path = tmp_path / "btp.pcap"
    capture(path, [btp_packet(cam_vector)], LINK_BTP)
    fields = ["btpb.dstport", "btpb.dstportinf", "its.stationID", "_ws.malformed"]
    assert tshark(path, fields) == [["2001", "0x0000", str(0xCAFE01), ""]]
