"""For the tests of more than one package: a short drive whose numbers are known, and random CAMs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_to_cdr
from advpipe.pipeline.messages.markers import markers
from advpipe.pipeline.messages.types import message_class, serialise, typestore
from advpipe.pipeline.v2x.codec.codec import asn1_cam

sys.path.insert(0, str(Path(__file__).parent))

STEP_NS = 100_000_000
START_NS = 1_700_000_000_000_000_000
EGO = topics.VehicleTopics("ego")
ROOF, BUS = topics.VehicleTopics("ego", "roof"), topics.VehicleTopics("bus_3", "front")

CAR = Boxes(
    geometry=np.array([[10.0, 5.0, 0.8, 4.5, 1.8, 1.6, 0.0]]),
    labels=np.array([0]),
    ids=("veh7",),
    velocity_mps=np.array([[0.0, 3.0, 0.0]]),
)


def cloud_of(frame: int, points: int = 200) -> Cloud:
    rng = np.random.default_rng(frame)
    cloud = np.zeros(points, POINT_DTYPE)
    for name in ("x", "y", "z", "intensity", "time"):
        cloud[name] = rng.normal(size=points)
    cloud["ring"] = rng.integers(0, 64, points)
    return cloud


@pytest.fixture
def record() -> Callable[..., Path]:
    def record(path: Path, frames: int = 4, **options: object) -> Path:
        """The ego drives along +x at 10 m/s and faces +y; its LiDAR sits 1 m ahead and 2 m up."""
        provenance = {"kind": "clean", "scenario": "a: 1\nb: ü\n", "seed": "7"}
        with BagWriter(path, provenance=provenance, **options) as bag:
            static = [(EGO.base_frame, EGO.lidar_frame, se3_from_yaw([1, 0, 2], 0))]
            bag.write(topics.TF_STATIC, build.transforms(START_NS, static), START_NS)
            bag.write(topics.SCENARIO_INFO, build.string("{}"), START_NS)
            for frame in range(frames):
                stamp_ns = START_NS + frame * STEP_NS
                map_SE3_base = se3_from_yaw([frame, 0, 0], np.pi / 2)
                odometry = build.odometry(
                    stamp_ns, map_SE3_base, [0, -10, 0], [0, 0, 0], child_frame_id=EGO.base_frame
                )
                pose = [("map", EGO.base_frame, map_SE3_base)]
                bag.write(topics.CLOCK, build.clock(stamp_ns), stamp_ns)
                bag.write(topics.TF, build.transforms(stamp_ns, pose), stamp_ns)
                bag.write(EGO.true_odometry, odometry, stamp_ns)
                bag.write(EGO.gnss_fix, build.nav_sat_fix(stamp_ns, 50.1, 8.6, 100.0), stamp_ns)
                cdr = cloud_to_cdr(cloud_of(frame), stamp_ns, EGO.lidar_frame)
                bag.write_cdr(EGO.lidar_points, cdr, stamp_ns)
                bag.write(EGO.objects, build.detections_message(stamp_ns, "map", CAR), stamp_ns)
                bag.write(EGO.road_users, build.road_users(stamp_ns, "map", CAR, [12], [0.5]), stamp_ns)
                bag.write(EGO.markers, markers(stamp_ns, "map", CAR), stamp_ns)
        return path

    return record


@pytest.fixture
def record_foreign() -> Callable[..., Path]:
    def record_foreign(path: Path, version: int = 9, log_delay_ns: int = 20_000_000) -> Path:
        """Another tool's bag: CARLA's cloud layout, a pose on /tf only, truth logged after the clouds."""
        store = typestore()
        with Writer(path, version=version, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {
                name: writer.add_connection(name, type_name, typestore=store)
                for name, type_name in (
                    ("/carla/hero/lidar", "sensor_msgs/msg/PointCloud2"),
                    ("/labels", "vision_msgs/msg/Detection3DArray"),
                    ("/tf", "tf2_msgs/msg/TFMessage"),
                )
            }
            for frame in range(3):
                stamp_ns = START_NS + frame * STEP_NS
                tf = build.transforms(stamp_ns, [("map", "hero/lidar", se3_from_yaw([frame, 0, 2], 0))])
                labels = build.detections_message(stamp_ns, "map", CAR)
                for delay, name, cdr in (
                    (0, "/tf", serialise(tf, "tf2_msgs/msg/TFMessage")),
                    (1, "/carla/hero/lidar", carla_cloud(cloud_of(frame), stamp_ns)),
                    (2, "/labels", serialise(labels, "vision_msgs/msg/Detection3DArray")),
                ):
                    writer.write(connections[name], stamp_ns + delay * log_delay_ns, cdr)
        return path

    return record_foreign


def carla_cloud(cloud: Cloud, stamp_ns: int) -> bytes:
    """The cloud in CARLA's layout of 16 bytes a point, serialised by rosbags."""
    PointField = message_class("sensor_msgs/msg/PointField")
    points = np.stack([cloud[name] for name in ("x", "y", "z", "intensity")], axis=-1)
    message = message_class("sensor_msgs/msg/PointCloud2")(
        header=build.message_header(stamp_ns, "hero/lidar"),
        height=1,
        width=len(cloud),
        fields=[
            PointField(name=name, offset=4 * place, datatype=7, count=1)
            for place, name in enumerate(("x", "y", "z", "intensity"))
        ],
        is_bigendian=False,
        point_step=16,
        row_step=16 * len(cloud),
        data=points.astype("<f4").view(np.uint8).ravel(),
        is_dense=True,
    )
    return serialise(message, "sensor_msgs/msg/PointCloud2")


@pytest.fixture
def record_fleet() -> Callable[..., Path]:
    def record_fleet(path: Path) -> Path:
        """Two LiDARs on the ego and one on a bus; each vehicle has its own place, LiDARs and truth.

        The ego stands at (0, 0) with `lidar` 1 m up and `roof` 3 m up, the bus at (100, 0) with `front` 5 m
        ahead. The car on the map is at (20, 0, 0); the bus knows only itself: a truck at its place.
        """
        static = [
            (EGO.base_frame, EGO.lidar_frame, se3_from_yaw([0, 0, 1], 0)),
            (ROOF.base_frame, ROOF.lidar_frame, se3_from_yaw([0, 0, 3], 0)),
            (BUS.base_frame, BUS.lidar_frame, se3_from_yaw([5, 0, 0], 0)),
        ]
        car = Boxes(np.array([[20.0, 0, 0, 4, 2, 1.5, 0]]), np.array([0]), ("car1",), np.zeros((1, 3)))
        truck = Boxes(np.array([[100.0, 0, 0, 9, 2.5, 3, 0]]), np.array([1]), ("truck1",), np.zeros((1, 3)))
        with BagWriter(path, provenance={}) as bag:
            bag.write(topics.TF_STATIC, build.transforms(0, static), 0)
            for stamp_ns in (0, 10**8):
                for points, lidar in enumerate((EGO, ROOF, BUS), start=1):
                    cloud = np.zeros(points, POINT_DTYPE)
                    bag.write_cdr(
                        lidar.lidar_points, cloud_to_cdr(cloud, stamp_ns, lidar.lidar_frame), stamp_ns
                    )
                for vehicle, x_m, boxes in ((EGO, 0.0, car), (BUS, 100.0, truck)):
                    pose = se3_from_yaw([x_m, 0, 0], 0)
                    odometry = build.odometry(
                        stamp_ns, pose, [0] * 3, [0] * 3, child_frame_id=vehicle.base_frame
                    )
                    bag.write(vehicle.true_odometry, odometry, stamp_ns)
                    bag.write(vehicle.objects, build.detections_message(stamp_ns, "map", boxes), stamp_ns)
        return path

    return record_fleet


CamTree = dict[str, Any]

CAM_VECTOR = bytes.fromhex(
    "020200cafe01d431405a56bd962cbb361f2064050708431d4a5c4d2122b68402c08a501bda61f7f8903d6054e0d402810025"
    "fff58000b1ce001b6ffc8c00738e7001b77fcb60070c7380149bfd930053e39c00db80"
)
"""A CAM that pycrate, asn1tools, asn1c and tshark read alike."""


@pytest.fixture
def cam_vector() -> bytes:
    return CAM_VECTOR


@pytest.fixture
def random_cam_tree() -> Callable[..., CamTree]:
    def random_cam_tree(rng: np.random.Generator, vehicle: bool = False) -> CamTree:
        """Any values that the ASN.1 allows, often at the ends of ranges; optionally only of a vehicle."""
        tree: CamTree = _random_value(asn1_cam(), rng)
        tree["header"] |= {"protocolVersion": 2, "messageID": 2}
        while vehicle and tree["cam"]["camParameters"]["highFrequencyContainer"][0].startswith("rsu"):
            tree = random_cam_tree(rng)
        return tree

    return random_cam_tree


def _random_value(asn1: Any, rng: np.random.Generator) -> Any:
    match asn1.TYPE:
        case "SEQUENCE":
            return {
                name: _random_value(part, rng)
                for name, part in asn1._cont.items()
                if not part._opt or rng.random() < 0.5
            }
        case "CHOICE":
            name = str(rng.choice(list(asn1._cont)))
            return name, _random_value(asn1._cont[name], rng)
        case "SEQUENCE OF":
            bounds = asn1._const_sz.root[0]
            most = min(bounds.ub, 23)
            return [_random_value(asn1._cont, rng) for _ in range(rng.integers(bounds.lb, most + 1))]
        case "ENUMERATED":
            return str(rng.choice(list(asn1._cont)))
        case "BIT STRING":
            size = asn1._const_sz.root[0]
            length = size if isinstance(size, int) else int(rng.integers(size.lb, size.ub + 1))
            return int(rng.integers(1 << length)), length
        case "OCTET STRING":
            bounds = asn1._const_sz.root[0]
            return rng.bytes(int(rng.integers(bounds.lb, bounds.ub + 1)))
        case "BOOLEAN":
            return bool(rng.integers(2))
    bounds = asn1._const_val.root[0]
    return int(rng.choice([bounds.lb, bounds.ub, rng.integers(bounds.lb, bounds.ub, endpoint=True)]))
