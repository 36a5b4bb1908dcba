"""The detector runs on every cloud: frame after frame, in one process or several."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.registry import chosen_sequence_checks
from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, FrameSlice, count_frames, find_lidar_topic
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.jobs import map_jobs
from advpipe.pipeline.core.plugins import plugin_errors, user_class
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.adapted import adapted_detector, detector_for_cloud
from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector, VoxelGrid
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference, cloud_difference
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.detection.attack_checks import AttackChecks
from advpipe.stages.evaluate.detection.baseline import RandomBaselines, attack_query_budget
from advpipe.stages.evaluate.detection.checked_cloud import CheckedCloud, CheckedFrame
from advpipe.stages.evaluate.detection.comparison import (
    CloudResult,
    Comparison,
    FrameResult,
)
from advpipe.stages.evaluate.detection.defence_run import DefenceRun, evenly_spread
from advpipe.stages.evaluate.detection.displacement import Displacement, finite_xyz
from advpipe.stages.evaluate.detection.occlusion import Occlusion
from advpipe.stages.evaluate.detection.pairing import NO_FRAME, FramePairs, PairReader
from advpipe.stages.evaluate.detection.point_traces import PointTraces
from advpipe.stages.evaluate.detection.random_change import SpentBudget
from advpipe.stages.evaluate.detection.scoring import (
    CachedDetector,
    Truth,
    ground_truth,
    known_classes,
    match,
)
from advpipe.stages.evaluate.options import Options

RANDOM_RECIPES = ("random", "random-near", "random-best")
"""A bag of this recipe is a random baseline itself and is given none."""


@dataclass(frozen=True)
class DetectionRun:
    """A detector on the clouds of a clean bag and of adversarial versions of it, with the provenance of each.

    Of the options it follows those on frames, LiDAR, baselines, defences, attack checks, seed and device;
    several processes may share a GPU, each with a context of its own.
    """

    detector: str
    clean: Path
    adversarial: Mapping[Path, Provenance] = field(default_factory=dict)
    options: Options = field(default_factory=Options)

    def comparisons(self, workers: int | None = None) -> list[Comparison]:
        """Each adversarial bag beside the clean one, or the clean bag alone where there is none.

        Frame by frame nothing depends on another frame, nor on the number of worker processes. Raises
        UsageError for an adversarial bag that holds none of the chosen frames.
        """
        pairs = self._pairs()
        results_of_frames = map_jobs(partial(self.prepare, pairs), pairs.chosen, "detecting", workers)
        bags: list[tuple[Path | None, Provenance]] = [*self.adversarial.items()] or [(None, Provenance({}))]
        results_of_bags = zip(*results_of_frames, strict=True)
        detector = load_detector(self.detector, self.options.device)
        comparisons = []
        for (bag, provenance), results in zip(bags, results_of_bags, strict=True):
            comparison = Comparison(
                bag,
                provenance,
                tuple(frame for frame in results if frame),
                detector=Path(self.detector).name,
                detector_sha256=detector_sha256(self.detector),
                classes=known_classes(detector),
                defences=tuple(parse_defences(self.options.defences)),
                baseline_tries=self._baseline_tries(provenance),
                sequence_checks=chosen_sequence_checks(self.options.detect_attacks),
            )
            comparisons.append(comparison)
        return comparisons

    def _baseline_tries(self, provenance: Provenance) -> int:
        """How many random tries `random_best` judges beside an attack; 0 without baselines."""
        if not self.options.baseline or provenance.get("recipe") in RANDOM_RECIPES:
            return 0
        if self.options.baseline_tries is None:
            return attack_query_budget(provenance)
        return self.options.baseline_tries

    @property
    def _frames_to_read(self) -> FrameSlice:
        """The chosen frames of the clean bag; where none were chosen, those that all attacks were made of.

        The latter only saves time: frames that no adversarial bag holds are not scored in any case.
        """
        if self.options.frames != ALL_FRAMES:
            return self.options.frames
        attacked = {provenance.get("frames") for provenance in self.adversarial.values()}
        return FrameSlice.parse(name) if len(attacked) == 1 and (name := attacked.pop()) else ALL_FRAMES

    def _pairs(self) -> FramePairs:
        topic, is_part = self.options.lidar_topic, self.options.frames != ALL_FRAMES
        chosen = self._frames_to_read.indices(count_frames(self.clean, topic))
        pairs = FramePairs.of(self.clean, tuple(self.adversarial), chosen, topic, is_part=is_part)
        for bag, frames in pairs.adversarial.items():
            if not (frames != NO_FRAME).any():
                raise UsageError(f"{bag} holds none of the frames {self.options.frames}; choose others")
        return pairs

    @property
    def _defence_run(self) -> DefenceRun:
        return DefenceRun(self.options.defences, self.options.seed)

    def _defended_frames(self) -> list[frozenset[int]]:
        """The frames of each adversarial bag that defences are scored on, or of the clean bag alone.

        A frame of a bag has its clean cloud's log time; where no time agrees, any frame may be the bag's.
        """
        topic = self.options.lidar_topic
        indices = self._frames_to_read.indices(count_frames(self.clean, topic))
        times_ns = _log_times_ns(self.clean, topic)
        chosen = []
        for bag in self.adversarial or (self.clean,):
            held = np.isin(times_ns, _log_times_ns(bag, topic))
            frames = [index for index in indices if held[index]] or indices
            chosen.append(evenly_spread(frames, self.options.most_defended(len(frames))))
        return chosen

    def prepare(self, pairs: FramePairs) -> Callable[[int], list[FrameResult | None]]:
        """What one process does: score a frame, by its index in the clean bag, of every adversarial bag."""
        adaptation = self.options.adaptation
        loaded = load_detector(self.detector, self.options.device)
        detector = CachedDetector(adapted_detector(loaded, adaptation))
        reader, lidar_topic = BagReader(self.clean), self.options.lidar_topic
        occlusion = Occlusion(reader, find_lidar_topic(reader, lidar_topic))
        checks = AttackChecks.learnt(self.options, self.clean, loaded, detector) if self.adversarial else None
        frames = PairReader(pairs)
        defended_frames = self._defended_frames()

        def score_frame(index: int) -> list[FrameResult | None]:
            # Read the clean frame and its adversarial versions.
            frame, versions = frames.frames(index)
            # The ground truth, and what the detector finds of it in the clean cloud.
            truth = ground_truth(frame, detector.classes, detector.range_m, occlusion.at(frame.stamp_ns))
            with fixed_torch_threads():
                found = _cloud_result(detector, truth, frame.cloud, frame.cloud)
                in_bag = [index in chosen for chosen in defended_frames]
                under_defences = self._defence_run.results(
                    detector, truth, index, {"clean": frame.cloud} if any(in_bag) else {}
                )
                known, note = detector_for_cloud(loaded, adaptation, xyz(frame.cloud), loaded)
                clean = FrameResult(frame.index, -1, frame.stamp_ns, truth, found, note=note)
                defended = replace(clean, defended=under_defences)
                if checks is None:
                    return [defended]
                checked = checks.on_clean(frame.cloud, found.detections)
                # What it finds in each adversarial cloud, and in clouds changed randomly as much.
                drawn: dict[Any, Cloud] = {}
                attacked = [
                    self._attacked(
                        (detector, known),
                        defended if here else clean,
                        frame.cloud,
                        version,
                        provenance,
                        drawn,
                    )
                    if version
                    else None
                    for here, version, provenance in zip(
                        in_bag, versions, self.adversarial.values(), strict=True
                    )
                ]
                return [
                    _with_checks(result, checks, checked, frame.cloud, version.cloud)
                    if result and version
                    else None
                    for result, version in zip(attacked, versions, strict=True)
                ]

        return score_frame

    def _attacked(
        self,
        victims: tuple[CachedDetector, ObjectDetector],
        clean: FrameResult,
        clean_cloud: Cloud,
        version: Frame,
        provenance: Provenance,
        drawn: dict[Any, Cloud],
    ) -> FrameResult:
        """The result of a frame with an adversarial version of it and the random baselines.

        Where the clean cloud was scored under defences, so are the attacked one and that of random-best.
        victims: the detector as it is scored, and as an attack knows it, in the clean cloud's frame. drawn:
        the clouds of random-best of the frame, which attacks of equal budgets have in common.
        """
        detector, known = victims
        truth, grid = clean.truth, known.voxel_grid if isinstance(known, VoxelDetector) else None
        result_of = partial(_cloud_result, detector, truth, clean_cloud, grid=grid)
        change = cloud_difference(clean_cloud, version.cloud)
        baselines, compared = {}, {"adv": version.cloud}
        if n_tries := self._baseline_tries(provenance):
            spent = SpentBudget.of(clean_cloud, version.cloud, change, provenance.parameters)
            random = RandomBaselines(provenance, known, n_tries, self.options.seed, drawn)
            evaluated = truth.boxes.geometry[truth.is_evaluated]
            with plugin_errors(user_class(known)):
                clouds = dict(random.clouds(clean_cloud, truth.boxes, evaluated, spent, clean.index))
            compared[RANDOM_BEST] = clouds[RANDOM_BEST]
            baselines = {
                name: result_of(cloud, cloud_difference(clean_cloud, cloud)) for name, cloud in clouds.items()
            }
        defended = self._defence_run.results(detector, truth, clean.index, compared if clean.defended else {})
        return replace(
            clean,
            adversarial_index=version.index,
            adversarial=result_of(version.cloud, change),
            baselines=baselines,
            defended={**clean.defended, **defended},
        )


def _log_times_ns(bag: Path, lidar_topic: str | None) -> npt.NDArray[np.int64]:
    """When each cloud of a bag was logged (F,), from the bag's index."""
    reader = BagReader(bag)
    return reader.log_times_ns(find_lidar_topic(reader, lidar_topic))


def _with_checks(
    result: FrameResult,
    checks: AttackChecks,
    clean_checks: Mapping[str, CheckedCloud],
    clean: Cloud,
    cloud: Cloud,
) -> FrameResult:
    """The result with what the attack checks say of both clouds."""
    change, found = cloud_difference(clean, cloud), result.adversarial
    judged: Mapping[str, CheckedCloud] = {}
    if found and (len(change.removed) or len(change.added) or len(change.moved)):
        judged = checks.on_attacked(cloud, change, found.detections, result.clean.detections)
    both = {name: CheckedFrame(each, judged.get(name)) for name, each in clean_checks.items()}
    return replace(result, attack_checks=both, checks_not_run=checks.not_run)


def _cloud_result(
    detector: CachedDetector,
    truth: Truth,
    clean: Cloud,
    cloud: Cloud,
    change: CloudDifference | None = None,
    grid: VoxelGrid | None = None,
) -> CloudResult:
    """The result of a cloud; without a change it is the clean cloud itself. grid: the detector's voxels."""
    detections = detector.detect(cloud)
    matches = match(truth, detections, detector.classes)
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
        recounted=None if is_alike else match(recounted, detections, detector.classes, ("strict",)),
        points_removed=len(change.removed),
        points_added=len(change.added),
        points_moved=len(change.moved),
        intensities_changed=len(change.intensity_changed),
        displacement=Displacement.of(clean, cloud, change),
        traces=PointTraces.of(clean, cloud, change, grid),
        # Of a cloud that is as it was, there is no distance to ask for; it may have no points at all.
        chamfer_distance_m2=chamfer_distance(finite_xyz(clean), finite_xyz(cloud)) if is_changed else 0.0,
    )
