"""What benchmarks of attacks share: detections in attacked clouds, kept in files, and mAP ratios of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import Frame, FrameSlice, count_frames, read_frames
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.metrics.average_precision import RankedMatches, mean_average_precision
from advpipe.pipeline.metrics.matching import FrameMatches
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.evaluate.detection.scoring import Truth, ground_truth, known_classes, match

Float64 = npt.NDArray[np.float64]

KINDS = ("strict", "loose")
ENOUGH_BOXES = 50
ENOUGH_SHARE = 1 / 3
"""A class counts from so many boxes in the chosen clouds on, or so many as this share of the class with most:
few clouds have few boxes, and the precision of a single one is 0 or 1."""
DRAWS = 1000


def spread_frames(bag: Path, count: int) -> FrameSlice:
    """So many clouds of a bag, evenly. Raises UsageError where it has fewer."""
    there = count_frames(bag)
    if not 0 < count <= there:
        raise UsageError(f"--frames is {count}, but {bag} has {there} clouds")
    step = there // count
    return FrameSlice(step // 2, step // 2 + step * count, step)


def truths_of(frames: Iterable[Frame], detector: ObjectDetector) -> list[Truth]:
    classes = known_classes(detector)
    return [ground_truth(frame, classes, detector.range_m) for frame in frames]


def mean_precisions(
    truth: Sequence[Truth], found: Sequence[Detections], classes: Sequence[str]
) -> dict[str, Float64]:
    """Mean average precision (1 + DRAWS,), strict and loose: of all frames, and of each bootstrap draw of
    frames. The draws of as many frames are the same, so that differences are paired."""
    rng = named_generator(0, "convergence", "bootstrap")
    weights = [np.ones(len(truth), np.int64)]
    weights += [rng.multinomial(len(truth), [1 / len(truth)] * len(truth)) for _ in range(DRAWS)]
    matches: dict[tuple[str, str], list[FrameMatches]] = {}
    for of_truth, each in zip(truth, found, strict=True):
        for key, matched in match(of_truth, each, tuple(classes), KINDS).items():
            matches.setdefault(key, []).append(matched)
    boxes = {name: sum(each.n_truth for each in matches["strict", name]) for name in classes}
    least = min(ENOUGH_BOXES, ENOUGH_SHARE * max(boxes.values()))
    enough = [name for name in classes if boxes[name] >= least]
    means = {}
    for kind in KINDS:
        ranked = [RankedMatches.of(matches[kind, name]) for name in enough]
        means[kind] = np.array(
            [mean_average_precision(np.array([r.average_precision(w) for r in ranked])) for w in weights],
            np.float64,
        )
    return means


def ratios(attacked: Mapping[str, Float64], clean: Mapping[str, Float64]) -> dict[str, Float64]:
    """mAP ratios in percent, of `mean_precisions`."""
    return {kind: 100 * attacked[kind] / clean[kind] for kind in KINDS}


def with_interval(values: Float64, sign: str = "") -> str:
    """A figure with the 95 % interval of its draws, such as `12.3 (8.1…15.0)`; sign: "+" to show it."""
    low, high = np.nanpercentile(values[1:], [2.5, 97.5])
    return f"{values[0]:{sign}.1f} ({low:{sign}.1f}…{high:{sign}.1f})".replace("-", "−")


@dataclass(frozen=True)
class AttackedClouds:
    """Detections in the clouds of a drive under attacks, kept in a folder: a stopped run goes on.

    frames: of the drive. evaluated: the detectors that are shown each cloud, by a name that identifies them.
    """

    folder: Path
    frames: Sequence[Frame]
    evaluated: Mapping[str, ObjectDetector]
    seed: int
    _known: dict[str, dict[str, dict[str, Float64]]] = field(default_factory=dict)

    def found(
        self, key: str, attack: LidarAttack | None = None, victim: ObjectDetector | None = None
    ) -> dict[str, list[Detections]]:
        """What each detector finds in each cloud under an attack on a victim; in the clean ones without.

        key: of attack, parameters and victim, in the names of files.
        """
        found: dict[str, list[Detections]] = {name: [] for name in self.evaluated}
        for frame in self.frames:
            paths = {
                name: self.folder / f"{key}-{self.seed}-{frame.index}-on-{name}.npz"
                for name in self.evaluated
            }
            missing = [name for name, path in paths.items() if not path.is_file()]
            if missing:
                cloud = frame.cloud
                if attack is not None and victim is not None:
                    rng = named_generator(self.seed, "attack", key, frame.index)
                    cloud = attack(cloud, frame.boxes, victim, rng).cloud
                for name in missing:
                    _save(paths[name], self.evaluated[name].detect(cloud))
            for name, path in paths.items():
                found[name].append(_load(path))
        return found

    @cached_property
    def truths(self) -> dict[str, list[Truth]]:
        """The ground truth for each evaluated detector."""
        return {name: truths_of(self.frames, each) for name, each in self.evaluated.items()}

    @cached_property
    def clean(self) -> dict[str, dict[str, Float64]]:
        """The precision in clean clouds, see `mean_precisions`."""
        return self.precisions(self.found("clean"))

    def precisions(self, found: Mapping[str, Sequence[Detections]]) -> dict[str, dict[str, Float64]]:
        """By the name of the detector."""
        return {
            name: mean_precisions(self.truths[name], each, known_classes(self.evaluated[name]))
            for name, each in found.items()
        }

    def ratios(self, key: str, attack: LidarAttack, victim: ObjectDetector) -> dict[str, dict[str, Float64]]:
        """mAP ratios in percent by the name of the detector and by `KINDS`, with their draws."""
        if key not in self._known:
            attacked = self.precisions(self.found(key, attack, victim))
            self._known[key] = {name: ratios(attacked[name], self.clean[name]) for name in self.evaluated}
        return self._known[key]


def attack_with(type_: str, recipe: str, parameters: Mapping[str, object]) -> LidarAttack:
    """The attack of a recipe."""
    return build_lidar_attack(attack_spec({"type": type_, "recipe": recipe, "parameters": dict(parameters)}))


def frames_of(bag: Path, count: int) -> tuple[Frame, ...]:
    return tuple(read_frames(bag, spread_frames(bag, count)))


def _save(path: Path, found: Detections) -> None:
    stream = BytesIO()
    np.savez(stream, boxes=found.boxes, scores=found.scores, labels=found.labels)
    write_atomically(path, stream.getvalue())


def _load(path: Path) -> Detections:
    with np.load(path) as stored:
        return Detections(stored["boxes"], stored["scores"], stored["labels"])
