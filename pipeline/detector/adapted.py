"""A detector that sees clouds as it expects them, and answers in the LiDAR's frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.core.plugins import plugin_errors, user_class
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.detector_frame import AS_RECORDED, DetectorFrame
from advpipe.pipeline.detector.ensemble import DetectorEnsemble, ensemble_of
from advpipe.pipeline.detector.protocol import (
    Detections,
    ObjectDetector,
    OccupancyLoss,
    Range,
    VoxelDetector,
    VoxelGrid,
)
from advpipe.pipeline.messages.cloud import xyz


def adapted_detector(detector: ObjectDetector, adaptation: Adaptation) -> ObjectDetector:
    """The detector as it sees a recording: levelled, it fits the ground in each cloud, attacked ones too, as
    the victim would."""
    if adaptation.level:
        return LevellingDetector(detector, adaptation)
    return detector_for_cloud(detector, adaptation, np.zeros((0, 3), np.float32), detector)[0]


def detector_for_cloud(
    detector: ObjectDetector,
    adaptation: Adaptation,
    places: npt.NDArray[np.float32],
    declared_by: ObjectDetector,
) -> tuple[ObjectDetector, str]:
    """The detector, adapted once to a cloud (N, 3) for all of its changed versions, and the note of
    `Adaptation.frame`.

    An attack keeps the frame of the clean cloud: its search needs one fixed grid of voxels, and the points
    that it changes hardly move a plane through all the ground. declared_by: the detector that says what is
    expected, where `detector` stands for it. Of an ensemble, each member is adapted by itself.
    """
    if adaptation.is_none:
        return detector, ""
    if isinstance(detector, DetectorEnsemble):
        adapted = [detector_for_cloud(each, adaptation, places, each) for each in detector.members]
        return ensemble_of([each for each, _ in adapted]), adapted[0][1]
    frame, note = adaptation.frame(declared_by, places)
    return placed_detector(detector, frame, adaptation.scale_intensity), note


def placed_detector(
    detector: ObjectDetector, frame: DetectorFrame, scale_intensity: float = 1.0
) -> ObjectDetector:
    """The detector in a fixed frame; one on voxels stays one on voxels."""
    if isinstance(detector, VoxelDetector):
        return PlacedVoxelDetector(detector, frame, scale_intensity)
    return PlacedDetector(detector, frame, scale_intensity)


class PlacedDetector:
    """A detector that sees each cloud in one other frame, with scaled intensities.

    Clouds, boxes and losses are in the LiDAR's frame; losses can be differentiated with respect to the
    LiDAR's points.
    """

    def __init__(self, inner: ObjectDetector, frame: DetectorFrame, scale_intensity: float = 1.0) -> None:
        self._inner, self._frame, self._scale = inner, frame, scale_intensity
        self._own = user_class(inner)

    @property
    def classes(self) -> tuple[str, ...]:
        return self._inner.classes

    @property
    def range_m(self) -> Range:
        """The inner range, at the LiDAR's height; a tilt of a few degrees is left aside."""
        return _shifted(self._inner.range_m, -self._frame.shift_m)

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        seen = cloud.copy()
        if self._frame != AS_RECORDED:
            seen["x"], seen["y"], seen["z"] = self._frame.columns(cloud["x"], cloud["y"], cloud["z"])
        if self._scale != 1.0:
            seen["intensity"] = cloud["intensity"] * np.float32(self._scale)
        with plugin_errors(self._own):
            return self._back(self._inner.detect(seen))

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        return self._inner.loss(self._points(points), self._boxes(boxes), labels)

    def _back(self, found: Detections) -> Detections:
        return Detections(self._frame.boxes_back(found.boxes), found.scores, found.labels)

    def _points(self, points: Tensor) -> Tensor:
        seen = self._frame.points(points)
        if self._scale == 1.0:
            return seen
        return torch.cat([seen[:, :3], seen[:, 3:4] * self._scale, seen[:, 4:]], dim=1)

    def _boxes(self, boxes: Tensor) -> Tensor:
        if self._frame == AS_RECORDED:
            return boxes
        moved = self._frame.boxes(boxes.detach().cpu().double().numpy())
        return torch.from_numpy(moved).to(boxes.device, boxes.dtype)


class PlacedVoxelDetector(PlacedDetector):
    """A `VoxelDetector` in a fixed frame; its grid finds the voxel of a point in the LiDAR's frame."""

    def __init__(self, inner: VoxelDetector, frame: DetectorFrame, scale_intensity: float = 1.0) -> None:
        super().__init__(inner, frame, scale_intensity)
        self._voxels = inner

    @property
    def voxel_grid(self) -> VoxelGrid:
        grid = self._voxels.voxel_grid
        return VoxelGrid(grid.low_m, grid.size_m, grid.shape, self._frame)

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        seen = None if probes is None else self._points(probes)
        computed = self._voxels.occupancy_loss(self._points(points), self._boxes(boxes), labels, seen)
        return replace(computed, found=None if computed.found is None else self._back(computed.found))


class LevellingDetector:
    """A detector that fits the ground of each cloud by itself, see `Adaptation`."""

    def __init__(self, inner: ObjectDetector, adaptation: Adaptation) -> None:
        self._inner, self._adaptation = inner, adaptation

    @property
    def classes(self) -> tuple[str, ...]:
        return self._inner.classes

    @property
    def range_m(self) -> Range:
        """The inner range, along z as if the LiDAR had the expected height."""
        return self._inner.range_m

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        return self._for(xyz(cloud)).detect(cloud)

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        return self._for(points.detach().cpu().numpy()[:, :3]).loss(points, boxes, labels)

    def _for(self, places: npt.NDArray[np.float32]) -> ObjectDetector:
        return detector_for_cloud(self._inner, self._adaptation, places, self._inner)[0]


def _shifted(inner: Range, z_m: float) -> Range:
    return Range(
        inner.x_min_m, inner.y_min_m, inner.z_min_m + z_m, inner.x_max_m, inner.y_max_m, inner.z_max_m + z_m
    )
