"""The detector runs on every cloud: frame after frame, in one process or several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, FrameSlice, count_frames, find_lidar_topic
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.jobs import map_jobs
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference, cloud_difference
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.stages.evaluate.detection.baseline import attack_query_budget, random_baselines
from advpipe.stages.evaluate.detection.comparison import (
    CloudResult,
    Comparison,
    FrameResult,
    under,
)
from advpipe.stages.evaluate.detection.displacement import Displacement, finite_xyz
from advpipe.stages.evaluate.detection.occlusion import Occlusion
from advpipe.stages.evaluate.detection.pairing import pair_frames
from advpipe.stages.evaluate.detection.random_change import SpentBudget
from advpipe.stages.evaluate.detection.scoring import CachedDetector, Truth, ground_truth, match, worth

RANDOM_RECIPES = ("random", "random-near", "random-best")
"""A bag of this recipe is a random baseline itself and is given none."""


@dataclass(frozen=True)
class DetectionRun:
    """What is evaluated: a clean bag and adversarial versions of it, with the provenance of each.

    baseline: whether random changes of the same budget are evaluated too, drawn from `seed`; and of how many
    tries the best, None for the query budget of the attack itself. defences: as `parse_defences` reads
    them; the clean and the adversarial clouds are evaluated under each. frames: of the clean bag; those of
    the adversarial bags are scored that are among them.
    device: where the detector computes; several processes may share a GPU, each with a context of its own.
    """

    detector: str
    clean: Path
    adversarial: tuple[Path, ...] = ()
    provenances: tuple[Provenance, ...] = ()
    lidar_topic: str | None = None
    seed: int = 0
    baseline: bool = True
    baseline_tries: int | None = 1
    defences: tuple[str, ...] = ()
    frames: FrameSlice = ALL_FRAMES
    device: str = CPU

    def comparisons(self, workers: int | None = None) -> list[Comparison]:
        """Each adversarial bag beside the clean one, or the clean bag alone where there is none.

        Frame by frame nothing depends on another frame, nor on the number of worker processes.
        """
        frames = self._chosen.indices(count_frames(self.clean, self.lidar_topic))
        results_of_frames = map_jobs(self.prepare, frames, "detecting", workers)
        bags: list[tuple[Path | None, Provenance]] = [(None, Provenance({}))]
        if self.adversarial:
            bags = list(zip(self.adversarial, self.provenances, strict=True))
        name, sha256 = Path(self.detector).name, detector_sha256(self.detector)
        defences = tuple(parse_defences(self.defences))
        comparisons = [
            Comparison(
                bag,
                about,
                tuple(frame for frame in results if frame),
                name,
                sha256,
                defences,
                self._tries(about),
            )
            for (bag, about), results in zip(bags, zip(*results_of_frames, strict=True), strict=True)
        ]
        for each in comparisons:
            if not each.frames:
                raise UsageError(f"{each.bag} holds none of the frames {self.frames}; choose others")
        return comparisons

    def _tries(self, about: Provenance) -> int:
        """Of how many random tries the best is scored beside an attack; 0 without baselines."""
        if not self.baseline or about.get("recipe") in RANDOM_RECIPES:
            return 0
        return attack_query_budget(about) if self.baseline_tries is None else self.baseline_tries

    @property
    def _chosen(self) -> FrameSlice:
        """Frames of the clean bag that hold those of all adversarial bags, where none were chosen.

        Only a short cut: what all of them name is that choice, and all frames are right in any case.
        """
        if self.frames != ALL_FRAMES:
            return self.frames
        named = {about.get("frames") for about in self.provenances}
        return FrameSlice.parse(name) if len(named) == 1 and (name := named.pop()) else ALL_FRAMES

    def prepare(self) -> Callable[[int], list[FrameResult | None]]:
        """What one process does: a frame, named by its index in the clean bag, in every adversarial bag.

        The indices must rise: the bags are read once, from front to back.
        """
        cached = CachedDetector(load_detector(self.detector, self.device))
        reader = BagReader(self.clean)
        occlusion = Occlusion(reader, find_lidar_topic(reader, self.lidar_topic))
        is_part = self.frames != ALL_FRAMES
        pairs = pair_frames(self.clean, self.adversarial, self._chosen, self.lidar_topic, is_part=is_part)
        last = self._chosen.indices(count_frames(self.clean, self.lidar_topic))[-1]

        def detect_frame(index: int) -> list[FrameResult | None]:
            before, afters = next(pair for pair in pairs if pair[0].index == index)
            if index == last:
                next(pairs, None)  # refuses adversarial frames that come after all clean ones
            cached.forget()
            if self.adversarial and all(after is None for after in afters):
                return [None] * len(afters)
            truth = ground_truth(before, cached.classes, cached.range_m, occlusion.at(before.stamp_ns))
            with fixed_torch_threads():
                clean = _cloud_result(cached, truth, before.cloud, before.cloud)
                defended = self._defended(cached, truth, "clean", before.index, before.cloud)
                alone = FrameResult(before.index, -1, before.stamp_ns, truth, clean, defended=defended)
                if not self.adversarial:
                    return [alone]
                return [
                    self._compare(cached, alone, before, after, about) if after else None
                    for after, about in zip(afters, self.provenances, strict=True)
                ]

        return detect_frame

    def _compare(
        self, cached: CachedDetector, alone: FrameResult, before: Frame, after: Frame, provenance: Provenance
    ) -> FrameResult:
        truth, result_of = alone.truth, partial(_cloud_result, cached, alone.truth, before.cloud)
        change = cloud_difference(before.cloud, after.cloud)
        random = {}
        if tries := self._tries(provenance):
            clouds = random_baselines(
                before.cloud,
                truth.boxes.geometry[truth.is_evaluated],
                SpentBudget.of(before.cloud, after.cloud, change, provenance.parameters),
                lambda cloud: worth(truth, match(truth, cached.detect(cloud), cached.classes))[
                    truth.is_evaluated
                ],
                tries=tries,
                seed=self.seed,
                index=before.index,
            )
            random = {
                condition: result_of(cloud, cloud_difference(before.cloud, cloud))
                for condition, cloud in clouds
            }
        defended = self._defended(cached, truth, "adv", before.index, after.cloud)
        return FrameResult(
            before.index,
            after.index,
            before.stamp_ns,
            truth,
            alone.clean,
            result_of(after.cloud, change),
            random,
            {**alone.defended, **defended},
        )

    def _defended(
        self, cached: CachedDetector, truth: Truth, condition: str, index: int, cloud: Cloud
    ) -> dict[str, CloudResult]:
        """A cloud under every defence, which draws the same for each cloud of a frame."""
        results = {}
        for name, defence in parse_defences(self.defences).items():
            defended = defence(cloud, named_generator(self.seed, "evaluate", "defence", name, index))
            found = cached.detect(defended.cloud, defended.placement)
            box_points = count_points(xyz(cloud), found.boxes)
            results[under(condition, name)] = CloudResult(
                found, match(truth, found, cached.classes), box_points, len(defended.cloud)
            )
        return results


def _cloud_result(
    cached: CachedDetector, truth: Truth, clean: Cloud, cloud: Cloud, change: CloudDifference | None = None
) -> CloudResult:
    """The result of a cloud; without a change it is the clean cloud itself."""
    detections = cached.detect(cloud)
    matches = match(truth, detections, cached.classes)
    box_points = count_points(xyz(cloud), detections.boxes)
    if change is None:
        return CloudResult(detections, matches, box_points, len(cloud), np.zeros(len(truth.boxes), bool))
    is_changed = bool(len(change.removed) or len(change.added) or len(change.moved))
    recounted = truth.counted_on(cloud)
    is_alike = np.array_equal(recounted.is_evaluated, truth.is_evaluated)
    return CloudResult(
        detections,
        matches,
        box_points,
        points=len(cloud),
        emptied=truth.is_evaluated & ~recounted.is_evaluated,
        recounted=None if is_alike else match(recounted, detections, cached.classes, ("strict",)),
        points_removed=len(change.removed),
        points_added=len(change.added),
        points_moved=len(change.moved),
        displacement=Displacement.of(clean, cloud, change),
        # Of a cloud that is as it was, there is no distance to ask for; it may have no points at all.
        chamfer_distance_m2=chamfer_distance(finite_xyz(clean), finite_xyz(cloud)) if is_changed else 0.0,
    )
