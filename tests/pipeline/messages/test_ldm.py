import math

import pytest

from advpipe.pipeline.messages.ldm import class_of, ldm_detections_cdr, ldm_snapshot_cdr
from advpipe.pipeline.messages.types import serialise, typestore
from advpipe.pipeline.v2x.facilities.ldm import Entry, LdmReport, LdmSnapshot, Verdict

SNAPSHOT = LdmSnapshot(
    2_000_000_000,
    (
        Entry(LdmReport(7, 5, 1_500_000_000, (10.0, 20.0, 1.0), math.pi / 2, 13.0, 4.0, 2.0), 1_600_000_000),
        Entry(LdmReport(4_294_967_295, 200, 1_900_000_000, (1.0, 2.0, 3.0), *[math.nan] * 4), 1_900_400_000),
    ),
    {verdict: 10 + verdict for verdict in Verdict},
)
EXAMPLES = {
    "advpipe_msgs/msg/LdmSnapshot": ldm_snapshot_cdr(SNAPSHOT),
    "vision_msgs/msg/Detection3DArray": ldm_detections_cdr(SNAPSHOT),
}


@pytest.mark.oracle
@pytest.mark.parametrize("name", EXAMPLES)
def test_bytes_equal_those_of_rosbags(name: str) -> None:
    cdr = EXAMPLES[name]
    assert serialise(typestore().deserialize_cdr(cdr, name), name) == cdr


def test_advpipes_message_holds_the_entries() -> None:
    name = "advpipe_msgs/msg/LdmSnapshot"
    message = typestore().deserialize_cdr(EXAMPLES[name], name)
    first, second = message.objects
    assert message.header.frame_id == "map"
    assert (first.station_id, first.station_type, first.class_id) == (7, 5, "car")
    assert first.age == pytest.approx(0.5)
    assert (first.generation_time.sec, first.generation_time.nanosec) == (1, 500_000_000)
    assert (first.reception_time.sec, first.reception_time.nanosec) == (1, 600_000_000)
    assert (first.reference_point.x, first.reference_point.y, first.reference_point.z) == (10, 20, 1)
    assert (first.centre.x, first.centre.y) == (pytest.approx(10), pytest.approx(18))
    assert (first.yaw, first.speed, first.length, first.width) == (pytest.approx(math.pi / 2), 13, 4, 2)
    assert (second.station_id, second.class_id) == (4_294_967_295, "unknown")
    assert math.isnan(second.speed)
    counts = [message.accepted, message.corrupt, message.unplaced, message.expired, message.future]
    assert [*counts, message.superseded] == [10, 11, 12, 13, 14, 15]


def test_the_standard_message_holds_the_same_objects() -> None:
    name = "vision_msgs/msg/Detection3DArray"
    first, second = typestore().deserialize_cdr(EXAMPLES[name], name).detections
    assert (first.id, first.results[0].hypothesis.class_id) == ("7", "car")
    assert (first.bbox.center.position.x, first.bbox.center.position.y) == (10, pytest.approx(18))
    assert (first.bbox.size.x, first.bbox.size.y, first.bbox.size.z) == (4, 2, 0)
    assert first.bbox.center.orientation.z == pytest.approx(math.sqrt(0.5))
    assert (second.bbox.size.x, second.bbox.center.orientation.w) == (0, 1)


def test_every_station_type_has_a_class() -> None:
    assert [class_of(kind) for kind in (0, 1, 2, 4, 5, 6, 8, 11, 255)] == [
        *("unknown", "pedestrian", "cyclist", "cyclist", "car", "truck", "truck", "unknown", "unknown")
    ]
