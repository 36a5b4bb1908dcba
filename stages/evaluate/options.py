"""What an evaluation is asked to do, checked before anything is read or written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.attack_detection.names import BOX_CHECKS, POINT_CHECKS, SEQUENCE_CHECKS
from advpipe.pipeline.core import options
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.options import check_bounds, option

if TYPE_CHECKING:
    from advpipe.pipeline.detector.adaptation import Adaptation
    from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector


@dataclass(frozen=True)
class Options:
    """How a clean bag and adversarial ones are scored; the command line takes its options from here.

    detectors: the first one is shown in pictures. baseline_tries: None for the query budget of the
    attack itself. defences: as `parse_defences` reads them. defence_frames: None for the rule of
    `most_defended`. detect_attacks: as `parse_attack_checks` reads them.
    misbehaviour_detectors: as `misbehaviour_detectors` reads them. lidar_topic: None where a bag has
    one LiDAR. bootstrap_draws: what the intervals are made of.
    """

    detectors: tuple[str, ...] = option(
        ("small",),
        "small, pointpillars, centerpoint, a .safetensors file, or module:Class; repeat it for a matrix of "
        "transfer.",
    )
    image_detector: str = option(
        "small", "For the pictures of cameras: small, a .safetensors file, module:Class, or none."
    )
    seed: int = option(0, "Seed of the bootstrap, the baselines and the defences.", least=0)
    baseline: bool = option(True, "Also score random baselines of equal budget.")
    baseline_tries: int | None = options.baseline_tries()
    defences: tuple[str, ...] = option(
        ("default",),
        "NAME[:parameters], before the detector: sample, outliers, quantise, jitter, shift, flip, "
        "scale, or your own module:Class; such as jitter:0.02. Repeatable. Or default (all of these but "
        "scale), all, or none.",
    )
    defence_frames: int | None = option(
        None,
        "Score defences on at most so many frames, evenly spread. [default: a third of the frames and at "
        "most 10; all for defences that you name]",
        least=1,
    )
    detect_attacks: tuple[str, ...] = option(
        POINT_CHECKS,
        "Check that tries to tell attacked clouds from clean ones: "
        f"{', '.join((*POINT_CHECKS, *BOX_CHECKS, *SEQUENCE_CHECKS))}, your own module:Class, all, or "
        "none. Repeatable.",
    )
    misbehaviour_detectors: tuple[str, ...] = option(
        (),
        "Your own detector of false V2X messages, module:Class, beside ours and the baselines. Repeatable.",
    )
    frames: FrameSlice = option(
        ALL_FRAMES,
        "start:stop:step, counted in the clean bag: which clouds detection and cooperative "
        "perception use. Localisation, V2X and coordinated attacks are scored over the whole time "
        "span of these clouds; a step thins only the clouds.",
    )
    bootstrap_draws: int = 1000
    lidar_topic: str | None = options.lidar_topic()
    lidar_height_m: float | None = options.lidar_height_m()
    level: bool = options.level()
    scale_intensity: float = options.scale_intensity()
    detections: bool = option(False, "Also write bags that show the detections.")
    with_clouds: bool = option(False, "Keep the clouds in those bags (implies them).")
    device: str = options.device()
    scene: bool = option(True, "Show frames in 3D in the report's page, which takes up to 2 MB for each.")

    def __post_init__(self) -> None:
        from advpipe.pipeline.attack_detection.registry import parse_attack_checks
        from advpipe.pipeline.defences.registry import parse_defences
        from advpipe.pipeline.detector.device import open_device

        parse_defences(self.defences)
        parse_attack_checks(self.detect_attacks)
        _ = self.misbehaviour  # refuses what cannot be loaded
        open_device(self.device)
        if not self.detectors:
            raise UsageError("no detector is given; name one")
        check_bounds(self)
        _ = self.adaptation  # refuses what is out of bounds
        names = [Path(detector).name for detector in self.detectors]
        for name in names:
            if names.count(name) > 1:
                raise UsageError(f"two detectors are named {name}; reports identify them by name")

    def most_defended(self, frames: int) -> int:
        """On how many of so many frames defences are scored; each takes as long as it does without them."""
        if self.defence_frames is not None:
            return self.defence_frames
        return min(10, -(-frames // 3)) if self.defences == Options.defences else frames

    @property
    def misbehaviour(self) -> Mapping[str, MisbehaviourDetector]:
        """The detectors of false V2X messages, by name."""
        from advpipe.pipeline.misbehaviour.detectors import misbehaviour_detectors

        return misbehaviour_detectors(self.misbehaviour_detectors)

    @property
    def adaptation(self) -> Adaptation:
        """How clouds are presented to detectors."""
        from advpipe.pipeline.detector.adaptation import Adaptation

        return Adaptation(self.lidar_height_m, self.level, self.scale_intensity)
