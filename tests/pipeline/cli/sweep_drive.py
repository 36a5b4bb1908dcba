"""A drive for sweeps: eight clouds of one car, one second apart, and a detector that others can load."""

import sys
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.topics import TF_STATIC, VehicleTopics
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw

DETECTOR_FOLDER = Path(__file__).parents[2] / "stages" / "attack"
sys.path.insert(0, str(DETECTOR_FOLDER))

from linear_detector import BOX  # noqa: E402

DETECTOR = "linear_detector:Shipped"
FRAMES, PERIOD_NS, EPOCH_NS, POINTS = 8, 1_000_000_000, 1_700_000_000_000_000_000, 600


def write_drive(path: Path, seed: int = 11) -> Path:
    ego, draw = VehicleTopics("ego"), np.random.default_rng(seed)
    base_SE3_lidar = se3_from_yaw([0.5, 0.0, 1.8], 0.2)
    with BagWriter(path, provenance=clean_provenance("test", "simulation: {}\n", 7, "0" * 64)) as bag:
        static = [(ego.base_frame, ego.lidar_frame, base_SE3_lidar)]
        bag.write(TF_STATIC, messages.transforms(EPOCH_NS, static), EPOCH_NS)
        for frame in range(FRAMES):
            stamp_ns = EPOCH_NS + frame * PERIOD_NS
            map_SE3_base = se3_from_yaw([10.0 + frame, 5.0, 0.0], 0.3)
            car = Boxes(np.array([BOX]), np.zeros(1, np.int64), ("car0",), np.zeros((1, 3)))
            boxes = car.transformed(map_SE3_base @ base_SE3_lidar)
            cloud = np.zeros(POINTS, POINT_DTYPE)
            cloud["x"], cloud["y"], cloud["z"] = draw.uniform(0, 10, (3, POINTS)).astype(np.float32)
            cloud["ring"] = np.arange(POINTS) % 64
            bag.write(ego.objects, messages.detections(stamp_ns, "map", boxes), stamp_ns)
            odometry = messages.odometry(stamp_ns, map_SE3_base, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0])
            bag.write(ego.true_odometry, odometry, stamp_ns)
            bag.write_cdr(ego.lidar_points, cloud_to_cdr(cloud, stamp_ns, ego.lidar_frame), stamp_ns)
    return path
