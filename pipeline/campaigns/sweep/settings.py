"""The settings of a sweep, checked before hours are spent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.frames import FrameSlice, count_frames, refuse_without_ground_truth
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
from advpipe.pipeline.campaigns.sweep.options import USUAL_FRAMES, SweepOptions
from advpipe.pipeline.core.code import code_sha256
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.defences.registry import NONE
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.stages.evaluate.provenance import SCORING

CODE = (
    *(*SCORING, "pipeline/scenario/attacks.py"),
    *(f"stages/attack/{part}" for part in ("lidar", "cloud_attack.py", "clouds.py", "recording.py")),
)
"""The code that decides a cell's figures and its bag, from the attack to the score."""


def sweep_settings(clean: Path, options: SweepOptions) -> Settings:
    """The settings of a sweep; without frames, at most `USUAL_FRAMES` equally spaced ones.

    Raises AdvpipeError for an adversarial bag, one without clouds or ground truth, frames that it does not
    have, and an unknown detector or device.
    """
    if BagReader(clean).provenance.is_attack:
        raise UsageError(f"{clean} is an adversarial bag; give the clean bag that it was made from")
    count = count_frames(clean, options.lidar_topic)
    step = max(1, -(-count // USUAL_FRAMES))
    chosen = FrameSlice(step=step) if options.frames is None else FrameSlice.parse(options.frames)
    chosen.indices(count)
    refuse_without_ground_truth(clean, options.lidar_topic)
    detector = load_detector(options.detector, options.device)
    options.adaptation.check(detector, options.detector)
    settings = Settings(
        clean_sha256=parent_sha256(clean),
        detector=Path(options.detector).name,
        detector_sha256=detector_sha256(options.detector),
        frames=str(chosen),
        seed=options.seed,
        baseline_tries=options.baseline_tries,
        lidar_topic=options.lidar_topic,
        advpipe="",
        code_sha256="",
        device=options.device.partition(":")[0],
        **vars(options.adaptation),
        defences=_asked(options.defences),
        detect_attacks=_asked(options.detect_attacks),
    )
    return with_this_code(settings)


def _asked(texts: Sequence[str]) -> tuple[str, ...]:
    """The texts, but for `none`."""
    return tuple(text for text in texts if text != NONE)


def with_this_code(settings: Settings) -> Settings:
    """The settings of a cell that the code of this process makes."""
    return replace(settings, advpipe=installed("advpipe"), code_sha256=code_sha256(*CODE))


def refuse_other_work(cell: Cell, clean: Path, detector: str, device: str = CPU) -> None:
    """Raises AdvpipeError if a cell was made of another bag or detector than these, or on another device."""
    for what, mine, theirs in (
        ("bag", parent_sha256(clean), cell.settings.clean_sha256),
        ("detector", detector_sha256(detector), cell.settings.detector_sha256),
    ):
        if mine != theirs:
            raise UsageError(
                f"{cell.name} was made with another {what} (SHA-256 {theirs[:12]}…, not {mine[:12]}…); "
                "it cannot be checked with this one"
            )
    if device.partition(":")[0] != cell.settings.device:
        raise UsageError(
            f"{cell.name} was made on another device; check it with --device {cell.settings.device}"
        )
