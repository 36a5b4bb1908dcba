"""What a sweep is run on, looked at before hours are spent."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.frames import FrameSlice, count_frames, has_ground_truth
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.versions import installed
from advpipe.stages.evaluate.sweep.cell import Cell, Settings


def sweep_settings(
    clean: Path,
    detector: str,
    frames: str | None,
    seed: int,
    baseline_tries: int,
    lidar_topic: str | None,
    usual_frames: int,
) -> Settings:
    """The settings of a sweep; without `frames`, at most `usual_frames` equally spaced ones.

    Raises AdvpipeError for an adversarial bag, one without clouds or ground truth, frames that it does not
    have, and an unknown detector.
    """
    if BagReader(clean).provenance.get("kind") == "attack":
        raise AdvpipeError(f"{clean} is an adversarial bag; give the clean bag that it was made from")
    count = count_frames(clean, lidar_topic)
    step = max(1, -(-count // usual_frames))
    chosen = FrameSlice(step=step) if frames is None else FrameSlice.parse(frames)
    chosen.indices(count)
    if not has_ground_truth(clean, lidar_topic):
        raise AdvpipeError(f"{clean} has no ground truth; give the clean bag that holds it")
    load_detector(detector)
    return Settings(
        clean_sha256=parent_sha256(clean),
        detector=Path(detector).name,
        detector_sha256=detector_sha256(detector),
        frames=str(chosen),
        seed=seed,
        baseline_tries=baseline_tries,
        lidar_topic=lidar_topic,
        advpipe=installed("advpipe"),
    )


def refuse_other_work(cell: Cell, clean: Path, detector: str) -> None:
    """Raises AdvpipeError if a cell was made of another bag or detector than these."""
    for what, mine, theirs in (
        ("bag", parent_sha256(clean), cell.settings.clean_sha256),
        ("detector", detector_sha256(detector), cell.settings.detector_sha256),
    ):
        if mine != theirs:
            raise AdvpipeError(
                f"{cell.name} was made with another {what} (SHA-256 {theirs[:12]}…, not {mine[:12]}…); "
                "it cannot be checked with this one"
            )
