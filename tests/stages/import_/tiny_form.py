"""A form of three frames that the tests change: what it says is what is recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.options import ImportOptions

STEP_NS = 100_000_000
BEHIND = ConvexRegion("behind the vehicle", np.array([[-1.0, 0.0, 0.0, 0.0]]))


def a_cloud(seed: int, points: int = 400) -> Cloud:
    """Points on three cars at x = 10, 20 and -10 m, and on the ground around."""
    rng = np.random.default_rng(seed)
    cloud = np.zeros(points, POINT_DTYPE)
    cloud["x"], cloud["y"] = rng.uniform(-30, 30, points), rng.uniform(-20, 20, points)
    cloud["z"], cloud["intensity"] = -1.8, rng.uniform(0, 1, points)
    for k, x in enumerate((10.0, 20.0, -10.0)):
        mine = slice(20 * k, 20 * k + 20)
        cloud["x"][mine] = x + rng.uniform(-1.9, 1.9, 20)
        cloud["y"][mine] = rng.uniform(-0.8, 0.8, 20)
        cloud["z"][mine] = rng.uniform(-1.6, -0.4, 20)
    return cloud


def some_boxes(*xs: float) -> Boxes:
    """Cars at these x."""
    geometry = np.array([[x, 0.0, -1.0, 4.0, 1.8, 1.6, 0.1] for x in xs]).reshape(-1, 7)
    labels = np.full(len(xs), CLASSES.index("car"), np.int64)
    return Boxes(geometry, labels, tuple(f"car.{x:g}" for x in xs), np.full((len(xs), 3), np.nan))


@dataclass
class TinyDrive:
    """Three frames; changes: by index, what a frame is instead. fails_at: where reading breaks off."""

    count: int = 3
    changes: dict[int, DriveFrame] = field(default_factory=dict)
    fails_at: int | None = None
    read: list[int] = field(default_factory=list)
    name: str = "tiny"
    are_related: bool = True
    notes: Sequence[str] = ("Read by a test.",)

    @property
    def frame_count(self) -> int:
        return self.count

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        return [("ego/base_link", "ego/lidar", se3_from_yaw((0.0, 0.0, 1.73), 0.0))]

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        for index in range(first, self.count):
            if index == self.fails_at:
                raise RuntimeError("the power fails")
            self.read.append(index)
            yield self.changes.get(index) or a_frame(index)


def a_frame(index: int, **changed: object) -> DriveFrame:
    """A frame with two cars that count, one where nothing is labelled, and a van that does not count."""
    vehicle: dict[str, object] = {
        "clouds": {"lidar": a_cloud(index)},
        "boxes": some_boxes(10.0, 20.0, -10.0),
        "ignored": IgnoredBoxes(some_boxes(15.0).geometry, ("Van",), ("v",)),
        "coverage": LabelCoverage((ConvexRegion("the front", -BEHIND.planes),)),
        "map_SE3_base": se3_from_yaw((float(index), 0.0, 0.0), 0.0),
    }
    stamp_ns = int(changed.pop("stamp_ns", (index + 1) * STEP_NS))  # type: ignore[call-overload]
    reading = VehicleFrame(**{**vehicle, **changed})  # type: ignore[arg-type]
    return DriveFrame(f"frame {index}", stamp_ns, {"ego": reading})


DRIVE = TinyDrive()


class TinyForm(DriveForm):
    """The drive that the test has put into `DRIVE`."""

    title = "a test's frames"
    licence = "CC0-1.0"
    citation = "Nobody, 2026"

    def open(self, source: Path, options: ImportOptions) -> TinyDrive:
        return DRIVE
