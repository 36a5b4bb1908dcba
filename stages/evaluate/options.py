"""What an evaluation is asked to do, checked before anything is read or written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.device import CPU, open_device


@dataclass(frozen=True)
class Options:
    """How a clean bag and adversarial ones are scored.

    detectors: what `load_detector` takes; the first one is shown in pictures. seed: of the bootstrap, the
    baselines and the defences. baseline: whether the same budget is spent at random beside each attack; and
    the best of how many tries, None for as many as the attack itself looked at. defences: as
    `parse_defences` reads them. frames: of the clean bag; those of the adversarial bags that are among them
    are scored, and of all else the time that they span. lidar_topic: the clouds, where a bag has those of
    several LiDARs. detections, with_clouds: bags to view for the first detector, and the clouds in them.
    device: where detectors compute, as `open_device` takes it.
    """

    detectors: tuple[str, ...] = ("small",)
    seed: int = 0
    baseline: bool = True
    baseline_tries: int | None = 1
    defences: tuple[str, ...] = ()
    frames: FrameSlice = ALL_FRAMES
    bootstrap_draws: int = 1000
    lidar_topic: str | None = None
    detections: bool = False
    with_clouds: bool = False
    device: str = CPU

    def __post_init__(self) -> None:
        parse_defences(self.defences)
        open_device(self.device)
        if not self.detectors:
            raise UsageError("no detector is given; name one")
        if self.baseline_tries is not None and self.baseline_tries < 1:
            raise UsageError(f"baseline tries are {self.baseline_tries}, but must be 1 or more")
        names = [Path(detector).name for detector in self.detectors]
        for name in names:
            if names.count(name) > 1:
                raise UsageError(f"two detectors are named {name}; reports tell them by name")
