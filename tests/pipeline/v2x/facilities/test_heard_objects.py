"""Objects heard of: where they are on the map, and how long they are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.heard_objects import heard_objects_cdr, heard_objects_of_message
from advpipe.pipeline.messages.types import typestore
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.facilities.cpm import Cpm, PerceivedObject
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObjects, heard_objects, map_frame
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.pipeline.v2x.facilities.verdict import Verdict

NOW_NS = 1_800_000_000_000_000_000
GEODESY = Geodesy(48.1, 11.5, 500.0)
OBJECT = PerceivedObject(
    object_id=1, measured_ms=0, east_m=30.0, north_m=40.0, east_mps=10.0, north_mps=0.0, height_m=1.5
)
CPM = Cpm(
    station_id=5,
    reference_ms=timestamp_its_ms(NOW_NS),
    latitude_deg=48.1,
    longitude_deg=11.5,
    objects=(OBJECT,),
)


def test_an_object_is_placed_east_and_north_of_the_reference_position() -> None:
    (one,) = heard_objects(CPM, GEODESY) or ()
    assert one.centre_m == pytest.approx((30.0, 40.0, 0.75), abs=1e-3)
    assert one.moved_m(NOW_NS + 500_000_000) == pytest.approx((35.0, 40.0), abs=1e-3)


def test_far_from_the_origin_places_agree_with_the_projection() -> None:
    """10 km east of the origin, north on the Earth is not the map's y axis; the oracle is PROJ."""
    at = GEODESY.to_geographic([10_000.0, 5_000.0, 0.0])
    there = replace(CPM, latitude_deg=float(at[0]), longitude_deg=float(at[1]))
    north = GEODESY.to_map([at[0] + 1e-4, at[1], at[2]])
    frame = map_frame(there, GEODESY)
    assert frame is not None
    length_m = float(np.hypot(*(north[:2] - [10_000.0, 5_000.0])))
    assert frame.to_map(0.0, length_m) == pytest.approx(north[:2].tolist(), abs=1e-3)
    assert frame.to_east_north(*frame.to_map(3.0, -4.0)) == pytest.approx((3.0, -4.0))


def test_objects_are_kept_until_they_are_too_old() -> None:
    known, objects = HeardObjects(1.0), heard_objects(CPM, GEODESY)
    assert known.receive(objects, NOW_NS) is Verdict.ACCEPTED
    assert len(known.snapshot(NOW_NS + 10**9)) == 1
    assert known.snapshot(NOW_NS + 10**9 + 1) == ()
    assert known.receive(objects, NOW_NS + 2 * 10**9) is Verdict.EXPIRED
    assert known.receive(objects, NOW_NS - 2 * 10**9) is Verdict.FUTURE
    assert known.receive(None, NOW_NS) is Verdict.UNPLACED


def test_an_older_measurement_does_not_replace_a_newer_one() -> None:
    known = HeardObjects(1.0)
    older = heard_objects(replace(CPM, reference_ms=CPM.reference_ms - 100), GEODESY)
    known.receive(heard_objects(CPM, GEODESY), NOW_NS)
    assert known.receive(older, NOW_NS) is Verdict.SUPERSEDED
    (one,) = known.snapshot(NOW_NS)
    assert one.measured_ns == NOW_NS


def test_a_recorded_message_has_the_objects() -> None:
    objects = tuple(heard_objects(CPM, GEODESY, NOW_NS) or ())
    snapshot = LdmSnapshot(NOW_NS, (), {}, objects)
    message = typestore().deserialize_cdr(heard_objects_cdr(snapshot), "advpipe_msgs/msg/HeardObjectArray")
    (read,) = heard_objects_of_message(message)
    assert read == replace(
        objects[0],
        yaw_rad=pytest.approx(float("nan"), nan_ok=True),
        velocity_mps=pytest.approx(objects[0].velocity_mps),
        length_m=pytest.approx(float("nan"), nan_ok=True),
        width_m=pytest.approx(float("nan"), nan_ok=True),
    )
