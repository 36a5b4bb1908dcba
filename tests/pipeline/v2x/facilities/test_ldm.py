"""The Local Dynamic Map: which reports are accepted and kept, and their positions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.cam import Cam, cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.pipeline.v2x.facilities.ldm import LdmReport, LocalDynamicMap, Verdict, report_of_cam
from advpipe.pipeline.v2x.facilities.reference_point import reference_point
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import LdmRules

NOW_NS = 1_767_268_800_000_000_000
MS = 1_000_000
GEODESY = Geodesy(48.1351, 11.5820, 520.0)


def report(station_id: int = 7, age_ms: float = 0, speed_mps: float = 10) -> LdmReport:
    generation_ns = NOW_NS - round(age_ms * MS)
    return LdmReport(station_id, 5, generation_ns, (10.0, 20.0, 1.0), math.pi / 2, speed_mps, 4.0, 2.0)


@pytest.mark.parametrize(
    ("age_ms", "verdict"),
    [
        (0, Verdict.ACCEPTED),
        (1100, Verdict.ACCEPTED),
        (1100.001, Verdict.EXPIRED),
        (-1100, Verdict.ACCEPTED),
        (-1100.001, Verdict.FUTURE),
        (60_000, Verdict.EXPIRED),
    ],
)
def test_reports_within_the_expiry_are_accepted(age_ms: float, verdict: Verdict) -> None:
    """A replay that comes 1.1 s after its original is refused, as Artery does."""
    ldm = LocalDynamicMap(LdmRules())
    assert ldm.receive(report(age_ms=age_ms), NOW_NS) is verdict
    snapshot = ldm.snapshot(NOW_NS)
    assert len(snapshot.entries) == (verdict is Verdict.ACCEPTED)
    assert snapshot.verdicts[verdict] == 1


def test_entries_expire() -> None:
    ldm = LocalDynamicMap(LdmRules())
    ldm.receive(report(), NOW_NS)
    (entry,) = ldm.snapshot(NOW_NS + 1100 * MS).entries
    assert ldm.snapshot(NOW_NS + 1100 * MS).age_s(entry) == pytest.approx(1.1)
    assert not ldm.snapshot(NOW_NS + 1100 * MS + 1).entries


@pytest.mark.parametrize(
    ("keep", "speed_mps", "verdict"), [("newest", 1, Verdict.SUPERSEDED), ("latest", 2, Verdict.ACCEPTED)]
)
def test_older_reports_follow_the_rule(keep: str, speed_mps: float, verdict: Verdict) -> None:
    ldm = LocalDynamicMap(LdmRules(keep=keep))
    assert ldm.receive(report(age_ms=100, speed_mps=1), NOW_NS) is Verdict.ACCEPTED
    assert ldm.receive(report(age_ms=300, speed_mps=2), NOW_NS + MS) is verdict
    (entry,) = ldm.snapshot(NOW_NS + MS).entries
    assert entry.report.speed_mps == speed_mps


def test_a_station_id_has_one_entry() -> None:
    ldm = LocalDynamicMap(LdmRules())
    for index, station_id in enumerate((9, 7, 9)):
        ldm.receive(report(station_id, speed_mps=index), NOW_NS + index)
    entries = ldm.snapshot(NOW_NS + 3).entries
    assert [(entry.report.station_id, entry.report.speed_mps) for entry in entries] == [(7, 1), (9, 2)]
    assert entries[1].received_ns == NOW_NS + 2


def test_messages_without_cam_or_position_are_only_counted() -> None:
    ldm = LocalDynamicMap(LdmRules())
    assert ldm.receive_corrupt() is Verdict.CORRUPT
    unplaced = report_of_cam(Cam(station_id=7, station_type=5, generation_delta_time_ms=0), NOW_NS, GEODESY)
    assert ldm.receive(unplaced, NOW_NS) is Verdict.UNPLACED
    snapshot = ldm.snapshot(NOW_NS)
    assert not snapshot.entries
    assert snapshot.verdicts == {
        Verdict.ACCEPTED: 0,
        Verdict.CORRUPT: 1,
        Verdict.UNPLACED: 1,
        Verdict.EXPIRED: 0,
        Verdict.FUTURE: 0,
        Verdict.SUPERSEDED: 0,
    }


def state(map_SE3_base: np.ndarray) -> StationState:
    place = reference_point(GEODESY, map_SE3_base, 4.5)
    return StationState(
        station_id=42,
        station_type=StationType.PASSENGER_CAR,
        time_ns=NOW_NS - 300 * MS,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        altitude_m=place.altitude_m,
        heading_rad=place.heading_rad,
        speed_mps=13.0,
        length_m=4.5,
        width_m=1.8,
    )


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, 3.1, -2.0])
def test_a_pose_round_trips_through_a_cam(yaw_rad: float) -> None:
    """Six kilometres from the origin, where the map's y axis is off north by 0.06 degrees."""
    map_SE3_base = se3_from_yaw([6000.0, -4000.0, 12.0], yaw_rad)
    cam = decode_cam(encode_cam(cam_of_state(state(map_SE3_base))))
    found = report_of_cam(cam, NOW_NS, GEODESY)
    assert found is not None
    assert (found.station_id, found.generation_ns) == (42, NOW_NS - 300 * MS)
    np.testing.assert_allclose(
        found.centre_m, map_SE3_base[:3, 3], atol=0.02
    )  # 0.1 microdegrees, 0.1 degrees
    assert abs(math.remainder(found.yaw_rad - yaw_rad, math.tau)) < math.radians(0.06)
    assert (found.speed_mps, found.length_m, found.width_m) == (13.0, 4.5, 1.8)


def test_missing_values_of_a_cam_are_nan() -> None:
    full = cam_of_state(state(se3_from_yaw([5.0, 6.0, 0.0], 0.0)))
    bare = replace(full, heading_rad=None, speed_mps=math.inf, length_m=None, width_m=None, altitude_m=None)
    found = report_of_cam(bare, NOW_NS, GEODESY)
    assert found is not None
    assert math.isnan(found.yaw_rad)
    assert math.isnan(found.length_m)
    assert math.isinf(found.speed_mps)
    assert found.centre_m == found.front_m
    np.testing.assert_allclose(found.front_m, [7.25, 6, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg"), [(None, 11.0), (48.0, None), (95.0, 11.0), (0.0, 101.582)]
)
def test_positions_outside_the_projection_give_no_report(
    latitude_deg: float | None, longitude_deg: float | None
) -> None:
    cam = replace(cam_of_state(state(np.eye(4))), latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    assert report_of_cam(cam, NOW_NS, GEODESY) is None
