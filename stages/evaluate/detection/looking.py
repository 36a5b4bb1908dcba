"""A detector looks at every cloud: frame after frame, in one process or several."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.cloud import Cloud, xyz
from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, FrameSlice, find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.jobs import map_jobs
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.evaluate.detection.baseline import random_baseline
from advpipe.stages.evaluate.detection.cloud_difference import CloudDifference, cloud_difference
from advpipe.stages.evaluate.detection.comparison import CloudResult, Comparison, FrameResult
from advpipe.stages.evaluate.detection.occlusion import Occlusion
from advpipe.stages.evaluate.detection.pairing import attacked_frames, chosen_indices, pair_frames
from advpipe.stages.evaluate.detection.scoring import Eye, Truth, ground_truth, match

RANDOM_RECIPE = "random"
"""A bag of this recipe is a random baseline itself and is given none."""


@dataclass(frozen=True)
class Looking:
    """What is looked at: a clean bag and adversarial versions of it, with the provenance of each.

    baseline: whether random changes of the same budget are looked at too, drawn from `seed`.
    """

    detector: str
    clean: Path
    adversarial: tuple[Path, ...] = ()
    provenances: tuple[Mapping[str, str], ...] = ()
    lidar_topic: str | None = None
    seed: int = 0
    baseline: bool = True

    def comparisons(self, workers: int | None = None) -> list[Comparison]:
        """Each adversarial bag beside the clean one, or the clean bag alone where there is none.

        Frame by frame nothing depends on another frame, nor on the number of worker processes.
        """
        frames = chosen_indices(self.clean, self._chosen, self.lidar_topic)
        looked = map_jobs(self.prepare, frames, "detecting", workers)
        bags: list[tuple[Path | None, Mapping[str, str]]] = [(None, {})]
        if self.adversarial:
            bags = list(zip(self.adversarial, self.provenances, strict=True))
        return [
            Comparison(bag, about, tuple(frame for frame in results if frame is not None))
            for (bag, about), results in zip(bags, zip(*looked, strict=True), strict=True)
        ]

    @property
    def _chosen(self) -> FrameSlice:
        return attacked_frames(
            [
                FrameSlice.parse(about["frames"]) if "frames" in about else ALL_FRAMES
                for about in self.provenances
            ]
        )

    def prepare(self) -> Callable[[int], list[FrameResult | None]]:
        """What one process does: a frame, named by its index in the clean bag, in every adversarial bag.

        The indices must rise: the bags are read once, from front to back.
        """
        eye = Eye(load_detector(self.detector))
        reader = BagReader(self.clean)
        occlusion = Occlusion(reader, find_lidar_topic(reader, self.lidar_topic))
        pairs = pair_frames(self.clean, self.adversarial, self._chosen, self.lidar_topic)
        last = chosen_indices(self.clean, self._chosen, self.lidar_topic)[-1]

        def look_at(index: int) -> list[FrameResult | None]:
            before, afters = next(pair for pair in pairs if pair[0].index == index)
            if index == last:
                next(pairs, None)  # refuses adversarial frames that come after all clean ones
            eye.forget()
            if self.adversarial and all(after is None for after in afters):
                return [None] * len(afters)
            truth = ground_truth(before, eye.classes, eye.range_m, occlusion.at(before.stamp_ns))
            with fixed_torch_threads():
                clean = _look(eye, truth, before.cloud, before.cloud)
                if not self.adversarial:
                    return [FrameResult(before.index, -1, before.stamp_ns, truth, clean)]
                return [
                    self._compare(eye, truth, clean, before, after, about) if after else None
                    for after, about in zip(afters, self.provenances, strict=True)
                ]

        return look_at

    def _compare(
        self,
        eye: Eye,
        truth: Truth,
        clean: CloudResult,
        before: Frame,
        after: Frame,
        provenance: Mapping[str, str],
    ) -> FrameResult:
        change = cloud_difference(before.cloud, after.cloud)
        random = None
        if self.baseline and provenance.get("recipe") != RANDOM_RECIPE:
            rng = named_generator(self.seed, "evaluate", "baseline", before.index)
            cloud = random_baseline(before.cloud, after.cloud, change, before.boxes, rng)
            random = _look(eye, truth, before.cloud, cloud, cloud_difference(before.cloud, cloud))
        attacked = _look(eye, truth, before.cloud, after.cloud, change)
        return FrameResult(before.index, after.index, before.stamp_ns, truth, clean, attacked, random)


def _look(
    eye: Eye, truth: Truth, clean: Cloud, cloud: Cloud, change: CloudDifference | None = None
) -> CloudResult:
    """The result of a cloud; without a change it is the clean cloud itself."""
    detections = eye.detect(cloud)
    matches = match(truth, detections, eye.classes)
    box_points = count_points(xyz(cloud), detections.boxes)
    if change is None:
        return CloudResult(detections, matches, box_points, len(cloud))
    return CloudResult(
        detections,
        matches,
        box_points,
        points=len(cloud),
        points_removed=len(change.removed),
        points_added=len(change.added),
        points_moved=len(change.moved),
        max_displacement_m=change.max_displacement_m,
        chamfer_distance_m2=chamfer_distance(_finite(clean), _finite(cloud)),
        objects_below_min_points=int((truth.is_evaluated & ~truth.enough_points(cloud)).sum()),
    )


def _finite(cloud: Cloud) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """The coordinates (N, 3) of the points that have some: other sensors mark lost returns by NaN."""
    points = xyz(cloud)
    return points[np.isfinite(points).all(axis=1)]
