"""Messages about labels that do not count or do not cover all: boxes to be ignored, regions, image labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.boxes import no_boxes
from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle, yaw_of
from advpipe.pipeline.messages.build import boxes_message, message_header
from advpipe.pipeline.messages.types import message_class


@dataclass(frozen=True)
class IgnoredBoxes:
    """I labelled objects that count neither way, such as those of classes that no detector is trained for.

    geometry: (I, 7) float64, columns `BOX_COLUMNS`. class_names: the source's own. ids: "" where unknown.
    """

    geometry: Float64 = field(default_factory=no_boxes)
    class_names: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.geometry)

    def joined(self, others: IgnoredBoxes) -> IgnoredBoxes:
        """These boxes, and others in the same frame behind them."""
        return IgnoredBoxes(
            np.concatenate([self.geometry, others.geometry]),
            (*self.class_names, *others.class_names),
            (*self.ids, *others.ids),
        )

    def transformed(self, a_SE3_b: Float64) -> IgnoredBoxes:
        """Transform these boxes from frame b to frame a, as `Boxes.transformed` does."""
        geometry = self.geometry.copy()
        geometry[:, :3] = transform_points(a_SE3_b, geometry[:, :3])
        geometry[:, 6] = wrap_angle(geometry[:, 6] + yaw_of(a_SE3_b))
        return IgnoredBoxes(geometry, self.class_names, self.ids)


@dataclass(frozen=True)
class ImageLabel:
    """An object as a data set labels it in an image; the fields are those of advpipe_msgs/ImageLabel.

    id: of the same object's 3D box; "" for none. class_name: the data set's own. edges_px: left, top, right,
    bottom. truncation: share outside the image, negative where unknown. occlusion: 0 visible, 1 partly,
    2 largely occluded, else unknown.
    """

    id: str
    class_name: str
    edges_px: tuple[float, float, float, float]
    truncation: float = -1.0
    occlusion: int = -1
    observation_angle_rad: float = 0.0


def ignored_message(stamp_ns: int, frame_id: str, ignored: IgnoredBoxes) -> Any:
    """vision_msgs/Detection3DArray of the ignored boxes, in the frame `frame_id`."""
    return boxes_message(stamp_ns, frame_id, ignored.geometry, ignored.class_names, ignored.ids)


def coverage_message(stamp_ns: int, frame_id: str, coverage: LabelCoverage) -> Any:
    """advpipe_msgs/LabelCoverage of regions in the frame `frame_id`."""
    return message_class("advpipe_msgs/msg/LabelCoverage")(
        header=message_header(stamp_ns, frame_id),
        labelled=[_region_message(region) for region in coverage.labelled],
        ignored=[_region_message(region) for region in coverage.ignored],
    )


def coverage_from_message(message: Any) -> LabelCoverage:
    """The regions of an advpipe_msgs/LabelCoverage. Raises ValueError for incomplete planes."""
    return LabelCoverage(
        tuple(_region(each) for each in message.labelled), tuple(_region(each) for each in message.ignored)
    )


def image_labels_message(stamp_ns: int, frame_id: str, labels: Sequence[ImageLabel]) -> Any:
    """advpipe_msgs/ImageLabelArray; frame_id: the camera's."""
    Label = message_class("advpipe_msgs/msg/ImageLabel")
    return message_class("advpipe_msgs/msg/ImageLabelArray")(
        header=message_header(stamp_ns, frame_id),
        labels=[
            Label(
                id=label.id,
                class_id=label.class_name,
                **dict(zip(("left", "top", "right", "bottom"), map(float, label.edges_px), strict=True)),
                truncation=float(label.truncation),
                occlusion=int(label.occlusion),
                observation_angle=float(label.observation_angle_rad),
            )
            for label in labels
        ],
    )


def image_labels_from_message(message: Any) -> tuple[ImageLabel, ...]:
    """The labels of an advpipe_msgs/ImageLabelArray."""
    return tuple(
        ImageLabel(
            each.id,
            each.class_id,
            (each.left, each.top, each.right, each.bottom),
            each.truncation,
            each.occlusion,
            each.observation_angle,
        )
        for each in message.labels
    )


def _region_message(region: ConvexRegion) -> Any:
    return message_class("advpipe_msgs/msg/LabelRegion")(
        name=region.name,
        planes=np.ascontiguousarray(region.planes, np.float64).ravel(),
        max_range=float(region.max_range_m) if np.isfinite(region.max_range_m) else 0.0,
    )


def _region(message: Any) -> ConvexRegion:
    planes = np.asarray(message.planes, np.float64).reshape(-1, 4)
    return ConvexRegion(message.name, planes, message.max_range if message.max_range > 0 else np.inf)
