"""A clean bag against one adversarial bag, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.cloud import Cloud, xyz
from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, FrameSlice, count_frames, read_frames
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.progress import track
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.evaluate.detection.baseline import random_baseline
from advpipe.stages.evaluate.detection.cloud_difference import CloudDifference, cloud_difference
from advpipe.stages.evaluate.detection.scoring import Eye, Matches, Truth, ground_truth, match

RANDOM_RECIPE = "random"
"""A bag of this recipe is a random baseline itself and is given none."""


@dataclass(frozen=True)
class CloudResult:
    """What the detector made of one cloud, and how far the cloud is from the clean one."""

    detections: Detections
    matches: Matches
    points: int
    points_removed: int = 0
    points_added: int = 0
    points_moved: int = 0
    max_displacement_m: float = 0.0
    chamfer_distance_m2: float = 0.0
    objects_below_min_points: int = 0


@dataclass(frozen=True)
class FrameResult:
    """One frame: its ground truth and up to three clouds of it. Indices count in their own bag."""

    index: int
    adversarial_index: int
    stamp_ns: int
    truth: Truth
    clean: CloudResult
    adversarial: CloudResult | None = None
    baseline: CloudResult | None = None

    def clouds(self) -> dict[str, CloudResult]:
        """The clouds that there are, by the word that reports use."""
        given = {"clean": self.clean, "adv": self.adversarial, "baseline": self.baseline}
        return {word: result for word, result in given.items() if result is not None}


@dataclass(frozen=True)
class Comparison:
    """The frames of one adversarial bag, or of the clean bag alone."""

    bag: Path | None
    provenance: Mapping[str, str]
    frames: tuple[FrameResult, ...]

    @property
    def name(self) -> str:
        return bag_name(self.bag) if self.bag else "clean"


def bag_name(bag: Path) -> str:
    """The folder of a bag, or its file without `.mcap`."""
    return bag.stem if bag.suffix == ".mcap" else bag.name


def look_at_clean(clean: Path, eye: Eye) -> Comparison:
    """The clean bag alone."""
    frames = []
    for frame in track(read_frames(clean), "clean", count_frames(clean)):
        truth = ground_truth(frame, eye.classes, eye.range_m)
        frames.append(
            FrameResult(frame.index, -1, frame.stamp_ns, truth, _look(eye, truth, frame.cloud, frame.cloud))
        )
    return Comparison(None, {}, tuple(frames))


def compare(
    clean: Path, adversarial: Path, provenance: Mapping[str, str], eye: Eye, seed: int, baseline: bool
) -> Comparison:
    """The frames of an adversarial bag beside the same frames of the clean one, and the baseline."""
    wants_baseline = baseline and provenance.get("recipe") != RANDOM_RECIPE
    attacked = FrameSlice.parse(provenance["frames"]) if "frames" in provenance else ALL_FRAMES
    pairs = pair_frames(clean, adversarial, attacked)
    frames = []
    for before, after in track(pairs, bag_name(adversarial), count_frames(adversarial)):
        truth = ground_truth(before, eye.classes, eye.range_m)
        change = cloud_difference(before.cloud, after.cloud)
        random = None
        if wants_baseline:
            rng = named_generator(seed, "evaluate", "baseline", before.index)
            cloud = random_baseline(before.cloud, after.cloud, change, before.boxes, rng)
            random = _look(eye, truth, before.cloud, cloud, cloud_difference(before.cloud, cloud))
        frames.append(
            FrameResult(
                before.index,
                after.index,
                before.stamp_ns,
                truth,
                _look(eye, truth, before.cloud, before.cloud),
                _look(eye, truth, before.cloud, after.cloud, change),
                random,
            )
        )
    return Comparison(adversarial, provenance, tuple(frames))


def pair_frames(
    clean: Path, adversarial: Path, attacked: FrameSlice = ALL_FRAMES
) -> Iterator[tuple[Frame, Frame]]:
    """Each frame of an adversarial bag with the frame of the same stamp in the clean bag.

    attacked: where in the clean bag those frames are; only a short cut.
    """
    before = read_frames(clean, attacked)
    candidate = next(before, None)
    for after in read_frames(adversarial):
        while candidate is not None and candidate.stamp_ns < after.stamp_ns:
            candidate = next(before, None)
        if candidate is None or candidate.stamp_ns != after.stamp_ns:
            raise AdvpipeError(
                f"{adversarial} has a cloud of {after.stamp_ns} ns and {clean} has none: "
                "it was made from another bag; give the clean bag that was attacked"
            )
        yield candidate, after
        candidate = next(before, None)


def _look(
    eye: Eye, truth: Truth, clean: Cloud, cloud: Cloud, change: CloudDifference | None = None
) -> CloudResult:
    """The result of a cloud; without a change it is the clean cloud itself."""
    detections = eye.detect(cloud)
    matches = match(truth, detections, eye.classes)
    if change is None:
        return CloudResult(detections, matches, len(cloud))
    return CloudResult(
        detections,
        matches,
        points=len(cloud),
        points_removed=len(change.removed),
        points_added=len(change.added),
        points_moved=len(change.moved),
        max_displacement_m=change.max_displacement_m,
        chamfer_distance_m2=chamfer_distance(_finite(clean), _finite(cloud), workers=-1),
        objects_below_min_points=int((truth.is_evaluated & ~truth.enough_points(cloud)).sum()),
    )


def _finite(cloud: Cloud) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """The coordinates (N, 3) of the points that have some: other sensors mark lost returns by NaN."""
    points = xyz(cloud)
    return points[np.isfinite(points).all(axis=1)]
