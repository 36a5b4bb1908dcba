"""A detector that sees clouds shifted, levelled and with scaled intensities."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.adapted import adapted_detector, detector_for_cloud, placed_detector
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.detector_frame import AS_RECORDED, DetectorFrame
from advpipe.pipeline.detector.expected_input import ExpectedInput, expected_input_of
from advpipe.pipeline.detector.protocol import (
    BatchDetector,
    Detections,
    ObjectDetector,
    Range,
    VoxelDetector,
)
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.ground_plane import GroundPlane
from advpipe.pipeline.geometry.transforms import invert, transform_points
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, xyz

TILT = GroundPlane(0.04, -0.03, 2.2)
TILTED = DetectorFrame.of(TILT.level_SE3_lidar()[:3, :3], 0.4)
RAISED = DetectorFrame(shift_m=0.4)
BOX = np.array([[10.0, 3.0, -1.0, 4.5, 1.8, 1.6, 0.7]])


def scene(seed: int = 0) -> Cloud:
    """Level ground 1.8 m below, and a box of points."""
    draw = np.random.default_rng(seed)
    ground = draw.uniform((-25, -25, -1.8), (25, 25, -1.8), (6000, 3))
    car = draw.uniform((8, 2, -1.8), (12, 4, -0.3), (400, 3))
    cloud = np.zeros(6400, POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = np.concatenate([ground, car]).T
    cloud["intensity"] = draw.uniform(0, 0.5, len(cloud))
    return cloud


def moved(cloud: Cloud, frame: DetectorFrame) -> Cloud:
    """The cloud of a LiDAR whose detector's frame is that one, where the detector sees this cloud."""
    other = cloud.copy()
    points = transform_points(invert(frame.detector_SE3_lidar), xyz(cloud))
    other["x"], other["y"], other["z"] = points.T
    return other


class Nearest:
    """Finds the box over the points above the ground, and declares what it expects."""

    classes = ("car",)
    range_m = Range(-30, -30, -3, 30, 30, 1)
    expected_input = ExpectedInput(lidar_height_m=1.8, max_intensity=1.0)

    def detect(self, cloud: Cloud) -> Detections:
        points = xyz(cloud)[(cloud["z"] > -1.6) & (cloud["z"] < 0.5)].astype(float)
        box = np.array([[*points.mean(axis=0), 4.0, 2.0, 1.5, 0.3]])
        return Detections(box, np.array([float(cloud["intensity"].max())]), np.zeros(1, np.int64))

    def loss(self, points: torch.Tensor, boxes: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
        return ((points[:, :3] - boxes[0, :3]) ** 2).sum() + points[:, 3].sum()


def test_numpy_and_torch_bring_points_to_the_same_bits() -> None:
    points = np.random.default_rng(1).uniform(-40, 40, (5000, 4)).astype(np.float32)
    for frame in (AS_RECORDED, RAISED, TILTED):
        by_torch = frame.points(torch.from_numpy(points)).numpy()
        assert (by_torch[:, :3] == frame.xyz(points[:, :3])).all()
        assert (by_torch[:, 3] == points[:, 3]).all()
        assert by_torch[:, :3] == pytest.approx(frame.places(points[:, :3].astype(float)), abs=1e-5)


def test_boxes_go_there_and_back() -> None:
    for frame in (AS_RECORDED, RAISED, TILTED):
        assert frame.boxes_back(frame.boxes(BOX)) == pytest.approx(BOX, abs=5e-3)
        assert frame.boxes(BOX)[:, :3] == pytest.approx(
            transform_points(frame.detector_SE3_lidar, BOX[:, :3])
        )
    assert RAISED.boxes(BOX)[0, 6] == BOX[0, 6]  # to the bit


@pytest.mark.parametrize("frame", [RAISED, TILTED])
def test_detections_are_those_of_the_expected_cloud(frame: DetectorFrame) -> None:
    plain, cloud = Nearest().detect(scene()), moved(scene(), frame)
    found = placed_detector(Nearest(), frame).detect(cloud)
    assert frame.boxes(found.boxes) == pytest.approx(plain.boxes, abs=5e-3)
    assert found.scores == plain.scores


def test_the_gradient_reaches_the_points_as_recorded() -> None:
    points = torch.from_numpy(np.array([[1.0, 2, 3, 0.5], [-4, 5, 6, 10.0]], np.float32)).requires_grad_()
    box = torch.from_numpy(BOX.astype(np.float32))
    loss = placed_detector(Nearest(), TILTED, 0.1).loss(points, box, torch.zeros(1).long())
    (gradient,) = torch.autograd.grad(loss, points)
    # Distances do not depend on the frame; intensities are scaled.
    expected = 2 * (points[:, :3] - box[0, :3])
    assert gradient[:, :3].detach().numpy() == pytest.approx(expected.detach().numpy(), abs=1e-3)
    assert gradient[:, 3].tolist() == pytest.approx([0.1, 0.1])


def test_intensities_are_scaled_for_the_detector_alone() -> None:
    bright = scene()
    bright["intensity"] *= 255
    before = bright.copy()
    found = adapted_detector(Nearest(), Adaptation(scale_intensity=1 / 255)).detect(bright)
    assert found.scores == pytest.approx(Nearest().detect(scene()).scores)
    assert (bright == before).all()


def test_a_range_is_that_of_the_lidars_frame() -> None:
    placed = placed_detector(Nearest(), RAISED)
    assert placed.range_m == Range(-30, -30, -3.4, 30, 30, 0.6)


@pytest.mark.parametrize("adaptation", [Adaptation(2.2), Adaptation(level=True), Adaptation(2.2, level=True)])
def test_a_higher_lidar_is_made_good(adaptation: Adaptation) -> None:
    found = adapted_detector(Nearest(), adaptation).detect(moved(scene(), RAISED))
    assert RAISED.boxes(found.boxes) == pytest.approx(Nearest().detect(scene()).boxes, abs=0.01)


def test_each_cloud_is_levelled_by_itself() -> None:
    levelling = adapted_detector(Nearest(), Adaptation(level=True))
    plain = Nearest().detect(scene()).boxes
    for frame in (AS_RECORDED, RAISED, TILTED):
        found = levelling.detect(moved(scene(), frame))
        assert frame.boxes(found.boxes) == pytest.approx(plain, abs=0.02)


def test_an_attack_keeps_the_fit_of_the_clean_cloud() -> None:
    cloud = moved(scene(), TILTED)
    fixed, note = detector_for_cloud(Nearest(), Adaptation(level=True), xyz(cloud), Nearest())
    assert note == ""
    without_ground = cloud[6000:]
    assert TILTED.boxes(fixed.detect(without_ground).boxes) == pytest.approx(
        Nearest().detect(scene()).boxes, abs=0.02
    )


def test_without_ground_the_height_counts_and_the_reason_is_told() -> None:
    cloud = moved(scene(), RAISED)[6000:]
    placed, note = detector_for_cloud(Nearest(), Adaptation(2.2, level=True), xyz(cloud), Nearest())
    assert note.startswith("not levelled: only ")
    assert placed.range_m.z_min_m == pytest.approx(-3.4)
    placed, _ = detector_for_cloud(Nearest(), Adaptation(level=True), xyz(cloud), Nearest())
    assert placed.range_m == Nearest.range_m


def test_without_options_the_detector_is_itself() -> None:
    detector = Nearest()
    assert adapted_detector(detector, Adaptation()) is detector
    assert detector_for_cloud(detector, Adaptation(), np.zeros((0, 3), np.float32), detector) == (
        detector,
        "",
    )


@pytest.mark.parametrize("frame", [RAISED, TILTED])
def test_a_voxel_detectors_grid_finds_the_voxels_of_recorded_points(frame: DetectorFrame) -> None:
    """Points have one voxel exactly where the shipped network gives them one row."""
    placed = placed_detector(load_detector("small"), frame)
    assert isinstance(placed, VoxelDetector)
    cloud = moved(scene(), frame)
    points = torch.from_numpy(np.column_stack([xyz(cloud), cloud["intensity"]]).astype(np.float32))
    probes = points[:50] + torch.tensor([0.0, 0.0, 0.3, 0.0])
    box, label = torch.from_numpy(BOX.astype(np.float32)), torch.zeros(1).long()
    computed = placed.occupancy_loss(points, box, label, probes)
    loss, occupancy, rows = computed.loss, computed.occupancy, computed.rows
    grid = placed.voxel_grid
    keys = grid.keys(grid.cells(torch.cat([points, probes]).numpy()))
    assert ((keys >= 0) == (rows.numpy() >= 0)).all()
    pairs = {*zip(keys[keys >= 0].tolist(), rows[rows >= 0].tolist(), strict=True)}
    assert len(pairs) == len({key for key, _ in pairs}) == len({row for _, row in pairs}) == len(occupancy)
    # Cells far from all voxels are those of an empty map, see `tiles`.
    assert loss.item() == pytest.approx(placed.loss(points, box, label).item(), rel=1e-3)


def test_a_batch_stays_a_batch_of_the_inner_detector() -> None:
    """Members of a batch wrap the proxy, each in the frame of its own cloud."""
    inner = load_detector("small")
    assert isinstance(inner, BatchDetector)

    def task(frame: DetectorFrame):
        return lambda proxy: placed_detector(proxy, frame).detect(moved(scene(), frame))

    alone = [task(frame)(inner) for frame in (RAISED, TILTED)]
    together = run_batched(inner, [task(RAISED), task(TILTED)])
    for one, other in zip(alone, together, strict=True):
        assert one.boxes == pytest.approx(other.boxes, abs=1e-3)


def test_what_shipped_detectors_expect() -> None:
    assert expected_input_of(load_detector("small")) == ExpectedInput(1.8, 1.0, 0.4, 0.035)


class Silent(Nearest):
    """Says nothing of what it expects."""

    expected_input = None  # type: ignore[assignment]


class Wrong(Nearest):
    """Says it in another type."""

    expected_input = 1.8  # type: ignore[assignment]


class Failing(Nearest):
    """Finds boxes of no shape."""

    def detect(self, cloud: Cloud) -> Detections:
        return Detections(np.zeros(3), np.zeros(1), np.zeros(1, np.int64))


def test_mistakes() -> None:
    with pytest.raises(UsageError, match="level=True: the detector mine does not say at which height"):
        Adaptation(level=True).check(Silent(), "mine")
    with pytest.raises(UsageError, match="lidar_height_m: the detector mine"):
        Adaptation(2.0).check(Silent(), "mine")
    Adaptation(scale_intensity=0.1).check(Silent(), "mine")
    with pytest.raises(UsageError, match=r"Wrong.expected_input is 1.8"):
        Adaptation(level=True).check(Wrong(), "mine")
    with pytest.raises(UsageError, match=r"lidar_height_m is 0, but must be 0\.3 to 10"):
        Adaptation(0.0)
    with pytest.raises(UsageError, match="scale_intensity is -1"):
        Adaptation(scale_intensity=-1.0)
    with pytest.raises(AdvpipeError, match="Failing failed: IndexError"):
        placed_detector(Failing(), RAISED).detect(scene())


def test_a_wrapped_detector_is_still_one() -> None:
    assert isinstance(placed_detector(Nearest(), RAISED), ObjectDetector)
    assert isinstance(adapted_detector(Nearest(), Adaptation(level=True)), ObjectDetector)
