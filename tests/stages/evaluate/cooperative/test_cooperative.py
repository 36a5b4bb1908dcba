"""A car that one vehicle cannot see and another can, and what false poses make of it; all by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.verbosity import Verbosity, use_verbosity
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import invert, se3_from_yaw, transform_points
from advpipe.pipeline.labels.perceived_objects import OBJECT_COLUMNS, write_object_labels
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.heard_objects import heard_objects_cdr
from advpipe.pipeline.messages.topics import TF_STATIC, VehicleTopics
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.stages.evaluate.cooperative.fusion import fuse_detections, without_oneself
from advpipe.stages.evaluate.cooperative.instants import asked_for, fused_instants
from advpipe.stages.evaluate.cooperative.pair import Alignment, find_pair, misalignment_deg, misalignment_m
from advpipe.stages.evaluate.cooperative.section import cooperative_rows, cooperative_sections

EGO, OTHER = VehicleTopics("ego"), VehicleTopics("other")
STAMPS_NS = (1_000_000_000, 1_100_000_000, 1_200_000_000)
DETECTOR = "middle_detector:MiddleDetector"
MAP_SE3_EGO = se3_from_yaw([5.0, 0.0, 0.0], 0.0)
MAP_SE3_OTHER = se3_from_yaw([60.0, 0.0, 0.0], np.pi)  # comes towards ego
POSES = ("true poses", "clean poses")
CAR = [45.0, 0.0, 1.0, 4.0, 2.0, 2.0, 0.0]


@pytest.fixture(autouse=True)
def _detector(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def corners() -> np.ndarray:
    """The eight corners of the car and the middles between them, on the map, just inside."""
    grid = np.array(np.meshgrid(*[[-0.499, 0, 0.499]] * 3)).reshape(3, -1).T
    return np.array(CAR[:3]) + grid * CAR[3:6]


def cloud_of(map_m: np.ndarray, map_SE3_base: np.ndarray) -> np.ndarray:
    points = transform_points(invert(map_SE3_base), map_m)
    cloud = np.zeros(len(points), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = points.T
    return cloud


def write(
    path: Path,
    shift_m: tuple[float, float] = (0.0, 0.0),
    vehicles=(EGO, OTHER),
    false_from: int = 0,
    false_to: int = 3,
    heard_m: float | None = None,
) -> Path:
    """`shift_m`: by how much the other's reported place is off, in these of the three frames. `heard_m`: how
    far ahead of the car's true place a CPM reports it, None without CPMs."""
    ground = np.array([[20.0, 3.0, 0.0]] * 9)  # the ego sees the road only
    seen = {EGO: (MAP_SE3_EGO, ground), OTHER: (MAP_SE3_OTHER, corners())}
    with BagWriter(path, provenance={"kind": "clean"}) as bag:
        static = [(one.base_frame, one.lidar_frame, np.eye(4)) for one in vehicles]
        bag.write(TF_STATIC, build.transforms(STAMPS_NS[0], static), STAMPS_NS[0])
        for one in vehicles:
            start = build.initial_pose(STAMPS_NS[0], np.zeros(3), [0, 0, 0, 1], np.eye(6))
            bag.write(one.initial_pose, start, STAMPS_NS[0])
        for frame, stamp_ns in enumerate(STAMPS_NS):
            is_false = false_from <= frame < false_to
            car = Boxes(np.array([CAR]), np.zeros(1, np.int64), ("car",), np.zeros((1, 3)))
            if heard_m is not None:
                bag.write_cdr(EGO.heard_objects, heard_objects_cdr(report(stamp_ns, heard_m)), stamp_ns)
            bag.write(EGO.objects, build.detections_message(stamp_ns, "map", car), stamp_ns)
            for one in vehicles:
                pose, map_m = seen[one]
                reported = pose.copy()
                reported[:2, 3] += shift_m if one is OTHER and is_false else (0.0, 0.0)
                for topic, place in ((one.true_odometry, pose), (one.odometry, reported)):
                    odometry = build.odometry(
                        stamp_ns, place, np.zeros(3), np.zeros(3), child_frame_id=one.base_frame
                    )
                    bag.write(topic, odometry, stamp_ns)
                fix = build.nav_sat_fix(stamp_ns, 50 + shift_m[0] * (one is OTHER), 8, 0)
                bag.write(one.gnss_fix, fix, stamp_ns)
                cdr = cloud_to_cdr(cloud_of(map_m, pose), stamp_ns, one.lidar_frame)
                bag.write_cdr(one.lidar_points, cdr, stamp_ns)
    return path


def report(now_ns: int, shift_m: float) -> LdmSnapshot:
    """A map with the car, which stands, as two stations report it; and with something that is no car."""
    x_m, y_m, z_m, *size_m, yaw_rad = CAR
    car = HeardObject(
        *(7, 1, "car", now_ns - 10**8, now_ns),
        centre_m=(x_m + shift_m, y_m, z_m),
        yaw_rad=yaw_rad,
        velocity_mps=(0.0, 0.0),
        length_m=size_m[0],
        width_m=size_m[1],
        height_m=size_m[2],
    )
    heard = (car, replace(car, station_id=8), replace(car, object_id=2, label="tram"))
    return LdmSnapshot(now_ns, (), {}, heard)


def test_cpms_tell_of_a_car_that_the_vehicle_does_not_see(tmp_path: Path) -> None:
    """Two reports of one car are one; reported 1 m off, as above; poses are all true."""
    clean = write(tmp_path / "clean", heard_m=0.0)
    attacked = write(tmp_path / "cpm-shift", heard_m=1.0)
    label = dict.fromkeys(OBJECT_COLUMNS, 0) | {"attack": "cpm-shift", "action": "changed"}
    times_ns = STAMPS_NS[0], STAMPS_NS[-1]
    write_object_labels(attacked, [{**label, "time_ns": time_ns} for time_ns in times_ns])
    (section,) = cooperative_sections(clean, [attacked], 0, DETECTOR)
    found = {(row["poses"], row["fusion"]): (row["ap_strict"], row["ap_loose"]) for row in rows_of(section)}
    assert found == {
        ("alone", ""): (0, 0),
        **{(name, fusion): (1, 1) for name in POSES for fusion in ("clouds", "detections")},
        ("clean poses", "CPMs"): (1, 1),
        ("cpm-shift", "CPMs"): (0, 1),
    }
    assert not section.pictures  # no pose is false


def test_precision_by_hand(tmp_path: Path) -> None:
    """Off by 1 m along a car of 4 m: overlap 3 / 5 = 0.6, loose but not strict; by 3 m: neither."""
    clean = BagReader(write(tmp_path / "clean"))
    attacked = {
        f"{shift:g} m": BagReader(write(tmp_path / f"{shift}", (shift, 0.0))) for shift in (0.2, 1.0, 3.0)
    }
    rows, telling = cooperative_rows(clean, find_pair(clean), attacked, DETECTOR)
    assert list(telling.poses) == ["true poses", "clean poses", *attacked]
    assert telling.poses["3 m"][0][0, 3] == pytest.approx(58.0)  # from ego, by the false place
    assert len(telling.truth) == 1
    found = {(row.poses, row.fusion): (row.ap_strict, row.ap_loose) for row in rows}
    assert found == {
        ("alone", ""): (0, 0),
        **{
            (poses, fusion): (1, 1)
            for poses in ("true poses", "clean poses")
            for fusion in ("clouds", "detections")
        },
        **{("0.2 m", fusion): (1, 1) for fusion in ("clouds", "detections")},
        **{("1 m", fusion): (0, 1) for fusion in ("clouds", "detections")},
        **{("3 m", fusion): (0, 0) for fusion in ("clouds", "detections")},
    }
    assert {(row.frames, row.objects) for row in rows} == {(3, 3)}
    off = {row.poses: row.misalignment_m for row in rows if row.poses != "alone"}
    assert off == pytest.approx(
        {"true poses": 0, "clean poses": 0, "0.2 m": 0.2, "1 m": 1, "3 m": 3}, abs=1e-6
    )


def test_only_instants_with_false_poses_count(tmp_path: Path) -> None:
    """The other's place is false in the second frame of three."""
    clean, attacked = write(tmp_path / "clean"), write(tmp_path / "paa", (1.0, 0.0), false_from=1, false_to=2)
    reader = BagReader(clean)
    rows, _ = cooperative_rows(reader, find_pair(reader), {"paa": BagReader(attacked)}, DETECTOR)
    assert {row.frames for row in rows} == {1}
    (off_m,) = {row.misalignment_m for row in rows if row.poses == "paa"}
    assert off_m == pytest.approx(1.0)


def test_the_others_sensor_in_the_own_frame(tmp_path: Path) -> None:
    """55 m ahead, turned around; with a false place, ahead and to the left of there."""
    reader = BagReader(write(tmp_path / "bag", (2.0, 7.0)))
    pair = find_pair(reader)
    assert (pair.own, pair.other) == (EGO, OTHER)
    true, reported = Alignment(reader, pair, true=True), Alignment(reader, pair)
    assert np.allclose(true.at(STAMPS_NS[0]), se3_from_yaw([55, 0, 0], np.pi))
    assert np.allclose(reported.at(STAMPS_NS[0])[:3, 3], [57, 7, 0])
    with pytest.raises(AdvpipeError, match="reports no pose at 5 ns"):
        reported.at(5)


@pytest.mark.parametrize("turned_deg", [0.0, 0.01, 30.0, 90.0, 180.0])
def test_how_far_off_and_turned(turned_deg: float) -> None:
    """3 and 4 m off, and turned; the same about another axis."""
    here, there = se3_from_yaw([1, 2, 0], 0.5), se3_from_yaw([4, 6, 0], 0.5 + np.radians(turned_deg))
    assert misalignment_m(there, here) == pytest.approx(5)
    assert misalignment_deg(there, here) == pytest.approx(turned_deg, abs=1e-6)
    leaning = np.eye(4)[[2, 0, 1, 3]]  # x to y, y to z, z to x
    assert misalignment_deg(leaning @ there, leaning @ here) == pytest.approx(turned_deg, abs=1e-6)
    assert misalignment_deg(leaning, np.eye(4)) == pytest.approx(120)


def test_an_object_that_both_find_is_one() -> None:
    """The better of two boxes that overlap; and one that only the other finds, turned around."""
    own = Detections(np.array([[10.0, 0, 1, 4, 2, 2, 0]]), np.array([0.6]), np.zeros(1, np.int64))
    others = Detections(
        np.array([[44.5, 0.0, 1, 4, 2, 2, 0], [5, 3, 1, 4, 2, 2, 0]]),
        np.array([0.8, 0.7]),
        np.zeros(2, np.int64),
    )
    fused = fuse_detections(own, others, se3_from_yaw([55, 0, 0], np.pi))
    assert fused.scores.tolist() == [0.8, 0.7]
    assert np.allclose(fused.boxes[:, :2], [[10.5, 0], [50, -3]])
    labels = Detections(others.boxes, others.scores, np.ones(2, np.int64))
    assert len(fuse_detections(own, labels, se3_from_yaw([55, 0, 0], np.pi))) == 3  # of another class


def test_nobody_is_an_object_to_itself() -> None:
    boxes = np.array([[0.5, 0, -1, 4, 2, 2, 0.1], [10, 0, -1, 4, 2, 2, 0]])
    kept = without_oneself(Detections(boxes, np.array([0.9, 0.8]), np.zeros(2, np.int64)))
    assert kept.boxes[:, 0].tolist() == [10]


def test_a_section_where_gps_was_attacked(tmp_path: Path) -> None:
    clean, attacked = write(tmp_path / "clean"), write(tmp_path / "paa", (3.0, 0.0))
    (section,) = cooperative_sections(clean, [clean, attacked], 0, DETECTOR)
    assert {record["poses"] for record in rows_of(section)} == {"alone", "true poses", "clean poses", "paa"}
    assert all(len(line) == len(section.tables[0].heads) for line in section.tables[0].lines)
    (picture,) = section.pictures
    assert picture.png.startswith(b"\x89PNG")
    assert cooperative_sections(clean, [clean], 0, DETECTOR) == ()


def test_no_section_with_one_vehicle(tmp_path: Path) -> None:
    clean = write(tmp_path / "clean", vehicles=(EGO,))
    assert cooperative_sections(clean, [clean], 0, DETECTOR) == ()


def test_frames_choose_the_clouds_that_are_fused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The place is false in the last two frames of three; what is fused is counted, and no more is."""
    clean = write(tmp_path / "clean")
    attacked = write(tmp_path / "paa", (1.0, 0.0), false_from=1)
    for chosen, frames in (("::", 2), ("0:2", 1), ("2", 1), ("0::2", 1)):
        with use_verbosity(Verbosity(verbose=True)):
            (section,) = cooperative_sections(clean, [attacked], 0, DETECTOR, frames=FrameSlice.parse(chosen))
        assert {record["frames"] for record in rows_of(section)} == {frames}
        assert f"cooperative perception: {frames} in" in capsys.readouterr().err


def test_frames_at_which_all_poses_are_right_need_no_detector(tmp_path: Path) -> None:
    clean = write(tmp_path / "clean")
    attacked = write(tmp_path / "paa", (1.0, 0.0), false_from=1)
    (section,) = cooperative_sections(clean, [attacked], 0, "there is none", frames=FrameSlice(0, 1))
    expected = "No pose and no CPM is false in the frames 0:1:1, so nothing was fused."
    assert section.lead.startswith(expected)
    assert not section.records
    with pytest.raises(AdvpipeError, match="select none of the bag's 3 frames"):
        cooperative_sections(clean, [attacked], 0, DETECTOR, frames=FrameSlice(7, 9))


def test_frames_count_in_the_clouds_that_are_named(tmp_path: Path) -> None:
    """Both LiDARs turn together here; the ego's clouds in the time of the other's are meant."""
    reader = BagReader(write(tmp_path / "clean"))
    pair, topic = find_pair(reader), OTHER.lidar_points.name
    assert asked_for(reader, pair, FrameSlice(1, 3), topic) == range(1, 3)
    assert asked_for(reader, pair, FrameSlice(0, None, 2), topic) == range(0, 3, 2)
    assert asked_for(reader, pair) == range(3)


def test_at_most_fifty_of_those_asked_for_and_false() -> None:
    assert fused_instants(range(0, 1000, 10), range(105, 305)) == FrameSlice(110, 301, 10)
    thinned = fused_instants(range(1000), range(200, 330))
    assert thinned == FrameSlice(200, 330, 3)
    assert fused_instants(range(4), range(12, 36)) is None
