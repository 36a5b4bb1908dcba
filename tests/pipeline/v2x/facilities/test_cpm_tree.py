"""CPMs in SI units: units by hand, and what is read again."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from advpipe.pipeline.v2x.codec.codes import SensorType
from advpipe.pipeline.v2x.codec.cpm_codec import OBJECTS, SENSORS, VEHICLE, CpmError
from advpipe.pipeline.v2x.facilities.cpm import Cpm, PerceivedObject, SensorInformation
from advpipe.pipeline.v2x.facilities.cpm_tree import cpm_tree, decode_cpm, encode_cpm

OBJECT = PerceivedObject(
    object_id=7,
    measured_ms=-20,
    east_m=12.34,
    north_m=-5.0,
    up_m=0.75,
    east_mps=-1.5,
    north_mps=0.02,
    label="car",
    yaw_rad=math.radians(90),
    length_m=4.5,
    width_m=1.8,
    height_m=1.5,
    age_ms=300,
    sensor_ids=(1,),
)
CPM = Cpm(
    station_id=0xCAFE01,
    reference_ms=694_310_405_000,
    latitude_deg=48.1,
    longitude_deg=11.5,
    altitude_m=500.0,
    heading_rad=math.radians(180),
    perceived=3,
    objects=(OBJECT,),
    sensors=(SensorInformation(1, SensorType.LIDAR, 80.0),),
)


def containers(cpm: Cpm) -> dict[int, object]:
    tree = cpm_tree(cpm)
    return {each["containerId"]: each["containerData"] for each in tree["payload"]["cpmContainers"]}


def test_units_are_those_of_the_dictionary() -> None:
    found = containers(CPM)
    assert found[VEHICLE] == {"orientationAngle": {"value": 1800, "confidence": 127}}
    assert found[SENSORS] == [
        {
            "sensorId": 1,
            "sensorType": 2,
            "perceptionRegionShape": ("circular", {"radius": 800}),
            "shadowingApplies": True,
        }
    ]
    (listed,) = found[OBJECTS]["perceivedObjects"]
    assert found[OBJECTS]["numberOfPerceivedObjects"] == 3
    assert listed["measurementDeltaTime"] == -20
    assert [listed["position"][axis]["value"] for axis in ("xCoordinate", "yCoordinate", "zCoordinate")] == [
        *(1234, -500, 75)
    ]
    assert listed["velocity"][1]["xVelocity"]["value"] == -150
    assert listed["angles"]["zAngle"]["value"] == 900
    assert [listed[f"objectDimension{axis}"]["value"] for axis in "XYZ"] == [45, 18, 15]
    assert listed["classification"] == [{"objectClass": ("vehicleSubClass", 5), "confidence": 101}]


def test_what_is_encoded_is_read_again() -> None:
    read = decode_cpm(encode_cpm(CPM))
    assert read.sensors == CPM.sensors
    assert (read.station_id, read.reference_ms, read.perceived) == (0xCAFE01, 694_310_405_000, 3)
    (one,) = read.objects
    assert one == replace(OBJECT, yaw_rad=pytest.approx(OBJECT.yaw_rad))
    assert read.heading_rad == pytest.approx(math.pi)


@pytest.mark.parametrize("label", ["car", "truck", "cyclist", "pedestrian", "unknown"])
def test_classes_survive(label: str) -> None:
    (one,) = decode_cpm(encode_cpm(replace(CPM, objects=(replace(OBJECT, label=label),)))).objects
    assert one.label == label


def test_a_cpm_without_objects_and_sensors_has_neither_container() -> None:
    cpm = replace(CPM, objects=(), sensors=None, perceived=0)
    assert set(containers(cpm)) == {VEHICLE}
    assert decode_cpm(encode_cpm(cpm)) == replace(cpm, heading_rad=pytest.approx(math.pi))


def test_values_that_a_cpm_cannot_hold_are_refused() -> None:
    with pytest.raises(CpmError, match="is nan"):
        encode_cpm(replace(CPM, objects=(replace(OBJECT, east_m=math.nan),)))
    with pytest.raises(CpmError, match="255 objects, not 256"):
        encode_cpm(replace(CPM, objects=(OBJECT,) * 256))
