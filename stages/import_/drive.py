"""A drive as another data set holds it: what a form reads, and what is recorded as a clean bag."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.labels import IgnoredBoxes, ImageLabel


@dataclass(frozen=True)
class CameraView:
    """A camera's calibration at one instant.

    matrix_K: (3, 3) in pixels. rectification_R: (3, 3) from the camera to its rectified frame. projection_P:
    (3, 4) from the rectified frame of the first camera to pixels. base_SE3_camera: (4, 4), or None where
    only the projection is known.
    """

    width_px: int
    height_px: int
    matrix_K: Float64
    projection_P: Float64
    rectification_R: Float64 = field(default_factory=lambda: np.eye(3))
    distortion: tuple[float, ...] = ()
    labels: tuple[ImageLabel, ...] | None = None


@dataclass(frozen=True)
class VehicleFrame:
    """What one vehicle measured and what is labelled around it at one instant.

    clouds: by the LiDAR's name. boxes: in the frame `boxes_frame`; None where the instant is not labelled.
    ignored, coverage: in the same frame. map_SE3_base: pose of `<vehicle>/base_link`, None where unknown.
    cameras: by name. transforms: parent, child, parent_SE3_child of frames that differ from instant to
    instant, besides the pose. lidar_points: (M,), on each box as the source counts them; None where it does
    not.
    """

    clouds: Mapping[str, Cloud]
    boxes: Boxes | None = None
    boxes_frame: str = "ego/lidar"
    ignored: IgnoredBoxes = field(default_factory=IgnoredBoxes)
    coverage: LabelCoverage = field(default_factory=LabelCoverage)
    map_SE3_base: Float64 | None = None
    cameras: Mapping[str, CameraView] = field(default_factory=dict)
    transforms: Sequence[tuple[str, str, Float64]] = ()
    lidar_points: npt.NDArray[np.int64] | None = None


@dataclass(frozen=True)
class DriveFrame:
    """One instant of a drive.

    name: by which errors and notices call it, such as its cloud's file. stamp_ns: since the epoch of the
    source's clock. vehicles: by name, which is their namespace; one is `ego`. source_name: what the source
    calls it, such as 000008, which is kept; "" for none.
    """

    name: str
    stamp_ns: int
    vehicles: Mapping[str, VehicleFrame]
    source_name: str = ""


class DriveSource(Protocol):
    """An opened drive of another data set."""

    @property
    def name(self) -> str:
        """The name that the source gives the drive."""

    @property
    def frame_count(self) -> int:
        """How many instants it has."""

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        """Parent frame, child frame and parent_SE3_child of what does not move, such as mounts of sensors."""

    @property
    def notes(self) -> Sequence[str]:
        """What a user should know of how the source was understood, in sentences."""

    @property
    def are_related(self) -> bool:
        """Whether neighbouring frames show the same drive; pictures drawn from many drives are not."""

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The instants from the index `first` on, in time order, one in memory at a time.

        Raises AdvpipeError, one line with the file's name and a way out, for what cannot be read.
        """


@runtime_checkable
class ClassifiedSource(DriveSource, Protocol):
    """A source that can list the classes of its labels."""

    def class_names(self) -> Collection[str]:
        """The classes, in the source's spelling; reads all labels, and so is asked for only where needed."""


@runtime_checkable
class LicensedSource(DriveSource, Protocol):
    """A source that states a licence of its own, other than that of its form."""

    @property
    def licence(self) -> str | None:
        """SPDX identifier; None where it is unknown."""

    @property
    def citation(self) -> str:
        """What its authors ask to be cited; "" where that is unknown."""


@runtime_checkable
class FingerprintedSource(DriveSource, Protocol):
    """A source that can tell cheaply whether it is the one that was read before."""

    @property
    def fingerprint(self) -> str:
        """Changes where the source's files do."""
