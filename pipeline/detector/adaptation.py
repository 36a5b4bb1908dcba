"""How clouds are presented to a detector: at the height, level and intensity that it expects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.lidar_height import check_lidar_height
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.detector.detector_frame import AS_RECORDED, DetectorFrame
from advpipe.pipeline.detector.expected_input import expected_input_of
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.ground_plane import fit_ground


@dataclass(frozen=True)
class Adaptation:
    """How clouds are presented to a detector; by default as they are.

    lidar_height_m: the LiDAR's height above the ground: clouds are shifted so that the ground lies where the
    detector expects it. level: the ground is fitted in each cloud, which is turned and shifted accordingly;
    where no ground is found, `lidar_height_m` shifts it, if given. scale_intensity: intensities are
    multiplied by this.
    """

    lidar_height_m: float | None = None
    level: bool = False
    scale_intensity: float = 1.0

    def __post_init__(self) -> None:
        check_lidar_height(self.lidar_height_m)
        scale = self.scale_intensity
        if not 0 < scale < float("inf"):
            raise UsageError(
                f"{option_name('scale_intensity')} is {scale:g}, but must be a finite number above 0"
            )

    @property
    def is_none(self) -> bool:
        """Whether clouds stay as they are."""
        return self == AS_THEY_ARE

    @property
    def text(self) -> str:
        """What is done to clouds, for readers of a report; "" where nothing is."""
        parts = []
        if self.level:
            parts.append("levelled by the ground fitted in each, and shifted to the expected height")
        if self.lidar_height_m is not None:
            where = ", where no ground is found," if self.level else ""
            parts.append(
                f"shifted{where} from a LiDAR {self.lidar_height_m:g} m above the ground to the expected "
                "height"
            )
        if self.scale_intensity != 1.0:
            parts.append(f"given intensities times {self.scale_intensity:g}")
        return f"before the detector sees them, clouds are {'; '.join(parts)}" if parts else ""

    def check(self, detector: ObjectDetector, name: str) -> None:
        """Raises UsageError for a detector, named as the user has it, that does not say at which height it
        expects the LiDAR, where that is needed."""
        if (self.level or self.lidar_height_m is not None) and expected_input_of(detector) is None:
            option = option_name("level", True) if self.level else option_name("lidar_height_m")
            raise UsageError(
                f"{option}: the detector {name} does not say at which height it expects the LiDAR; give its "
                "class the attribute expected_input = advpipe.ExpectedInput(lidar_height_m=...)"
            )

    def frame(self, detector: ObjectDetector, xyz: npt.NDArray[np.float32]) -> tuple[DetectorFrame, str]:
        """The detector's frame for a cloud (N, 3), and why it was not levelled, if it was to be: else "".

        The detector declares what it expects, see `check`.
        """
        expected = expected_input_of(detector)
        if expected is None:
            return AS_RECORDED, ""
        given_m = expected.lidar_height_m if self.lidar_height_m is None else self.lidar_height_m
        shifted = DetectorFrame(shift_m=given_m - expected.lidar_height_m)
        if not self.level:
            return shifted, ""
        plane = fit_ground(xyz)
        if isinstance(plane, str):
            return shifted, f"not levelled: {plane}"
        level_SE3_lidar = plane.level_SE3_lidar()
        return DetectorFrame.of(level_SE3_lidar[:3, :3], plane.height_m - expected.lidar_height_m), ""


AS_THEY_ARE = Adaptation()
