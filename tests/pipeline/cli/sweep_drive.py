"""A drive for sweeps of one car, and a detector whose answer to each budget is clear beforehand."""

import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "stages" / "attack")]

from linear_detector import LinearVoxelDetector  # noqa: E402

from advpipe.pipeline.bag.provenance import clean_provenance  # noqa: E402
from advpipe.pipeline.bag.writer import BagWriter  # noqa: E402
from advpipe.pipeline.geometry.boxes import Boxes  # noqa: E402
from advpipe.pipeline.geometry.transforms import se3_from_yaw  # noqa: E402
from advpipe.pipeline.messages import build  # noqa: E402
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr  # noqa: E402
from advpipe.pipeline.messages.topics import TF_STATIC, VehicleTopics  # noqa: E402

DETECTOR = "sweep_drive:OneVoxel"
BOX = [4.5, 5.5, 5.5, 1.0, 1.0, 1.0, 0.0]
FRAMES, PERIOD_NS, EPOCH_NS = 12, 1_000_000_000, 1_700_000_000_000_000_000
POINTS, ON_THE_CAR = 600, 7


class OneVoxel(LinearVoxelDetector):
    """Finds the car while any point is left in the one voxel that it fills."""

    def __init__(self):
        weights = np.zeros((10, 10, 10))
        weights[4, 5, 5] = 0.8
        super().__init__(weights, [BOX])


def write_drive(path: Path, seed: int = 11) -> Path:
    """Twelve clouds of 600 points, a second apart; seven lie on the car, in the middle of its voxel."""
    ego, draw = VehicleTopics("ego"), np.random.default_rng(seed)
    base_SE3_lidar = se3_from_yaw([0.5, 0.0, 1.8], 0.2)
    with BagWriter(path, provenance=clean_provenance("test", "simulation: {}\n", 7, "0" * 64)) as bag:
        static = [(ego.base_frame, ego.lidar_frame, base_SE3_lidar)]
        bag.write(TF_STATIC, build.transforms(EPOCH_NS, static), EPOCH_NS)
        for frame in range(FRAMES):
            stamp_ns = EPOCH_NS + frame * PERIOD_NS
            map_SE3_base = se3_from_yaw([10.0 + frame, 5.0, 0.0], 0.3)
            car = Boxes(np.array([BOX]), np.zeros(1, np.int64), ("car0",), np.zeros((1, 3)))
            boxes = car.transformed(map_SE3_base @ base_SE3_lidar)
            points = draw.uniform(0, 10, (POINTS, 3))
            points[np.floor(points[:, 0]) == 4, 0] += 1.0  # nothing else in the car's voxel
            points[:ON_THE_CAR] = np.array(BOX[:3]) + draw.uniform(-0.2, 0.2, (ON_THE_CAR, 3))
            cloud = np.zeros(POINTS, POINT_DTYPE)
            cloud["x"], cloud["y"], cloud["z"] = points.T.astype(np.float32)
            cloud["ring"] = np.arange(POINTS) % 64
            bag.write(ego.objects, build.detections_message(stamp_ns, "map", boxes), stamp_ns)
            odometry = build.odometry(stamp_ns, map_SE3_base, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0])
            bag.write(ego.true_odometry, odometry, stamp_ns)
            bag.write_cdr(ego.lidar_points, cloud_to_cdr(cloud, stamp_ns, ego.lidar_frame), stamp_ns)
    return path
