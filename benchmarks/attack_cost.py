"""What an attack on a cloud costs, and whether what makes it cheap changes its effect.

The detector is shown the part of a cloud around the objects that it still finds (`focus`), computes tiles of
its map alone (`tiles`), and one pass gives the detections and the gradient. The bound is what the attack
would take without: a forward and a backward pass on the whole cloud, and a detection in it, for each of the
clouds that it shows the detector.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.adversary import focus
from advpipe.pipeline.adversary.targets import AttackTargets, find_targets
from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.common import tiles
from advpipe.pipeline.detector.protocol import Detections, LossInput, OccupancyLoss
from advpipe.pipeline.detector.second.model import Second
from advpipe.pipeline.messages.cloud import Cloud, xyzi
from advpipe.pipeline.metrics.average_precision import average_precision, mean_average_precision
from advpipe.pipeline.metrics.matching import FrameMatches
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.evaluate.detection.scoring import CachedDetector, ground_truth, known_classes, match

MOST_OF_BOUND = 0.4
MOST_POINTS = 1.0
"""By how many percentage points the mAP ratio may differ from that of the exact attack."""

ENOUGH_BOXES = 50
"""Classes with fewer are not in the mAP, unless all have fewer."""

KINDS = ("strict", "loose")


@dataclass(frozen=True)
class Shown:
    """One pass that an attack asked a detector for: a detection without `labels`."""

    given: LossInput
    is_detection: bool
    wants_gradient: bool

    def ask(self, detector: Second) -> None:
        """The same of another detector, whose classes may be fewer."""
        if self.is_detection:
            detector.detect_batch([self.given.points])
            return
        labels = self.given.labels.clamp(max=len(detector.classes) - 1)
        with torch.set_grad_enabled(self.wants_gradient):
            computed = detector.occupancy_loss(self.given.points, self.given.boxes, labels, self.given.probes)
        if self.wants_gradient:
            torch.autograd.grad(computed.loss, computed.occupancy)


class RecordingSecond(Second):
    """Notes what it is asked."""

    def __init__(self, detector: Second) -> None:
        super().__init__(detector.net, detector.provenance)
        self.asked: list[Shown] = []

    def detect_batch(self, clouds: Sequence[Tensor]) -> list[Detections]:
        none = torch.zeros(0, 7), torch.zeros(0, dtype=torch.int64)
        self.asked += [Shown(LossInput(cloud, *none), True, False) for cloud in clouds]
        return super().detect_batch(clouds)

    def occupancy_loss_batch(self, inputs: Sequence[LossInput]) -> list[OccupancyLoss]:
        for each in inputs:
            given = LossInput(each.points.detach(), each.boxes, each.labels, each.probes)
            self.asked.append(Shown(given, False, torch.is_grad_enabled()))
        return super().occupancy_loss_batch(inputs)


def ask_all(asked: Sequence[Shown], detector: Second) -> None:
    for each in asked:
        each.ask(detector)


def spent(work: Callable[[], Any]) -> tuple[float, float]:
    """Processor and wall seconds."""
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - cpu_s, time.perf_counter() - wall_s


def report_cost(name: str, attack: LidarAttack, frame: Frame, detectors: Mapping[str, Second]) -> bool:
    """Print a line for each detector; whether the cost reaches the mark, for those that have one.

    The first detector is attacked. The others, of random weights, find nothing, and are shown the same.
    """
    first, *_ = detectors
    passed = True
    asked: list[Shown] = []
    for preset, detector in detectors.items():
        targets = find_targets(detector, frame.cloud, frame.boxes)
        before_s = bare_s(detector, frame.cloud, targets)
        if preset == first:
            recording = RecordingSecond(detector)
            rng = named_generator(0, name, frame.index)
            cpu_s, wall_s = spent(partial(attack, frame.cloud, frame.boxes, recording, rng))
            asked = recording.asked
        else:
            cpu_s, wall_s = spent(partial(ask_all, asked, detector))
        bound_s = len(asked) * (before_s + bare_s(detector, frame.cloud, targets)) / 2
        is_marked = preset != "kitti"
        is_fast = cpu_s <= MOST_OF_BOUND * bound_s
        verdict = f"  mark {MOST_OF_BOUND:.2f}  {'ok' if is_fast else 'ABOVE'}" if is_marked else ""
        print(
            f"{preset + ': ' + name:<16} {cpu_s:6.1f} CPU-s {wall_s:6.1f} s a frame, {len(asked)} clouds "
            f"shown; bound {bound_s:6.1f} CPU-s  ratio {cpu_s / bound_s:.2f}{verdict}",
            flush=True,
        )
        passed &= is_fast or not is_marked
    return passed


def bare_s(detector: Second, cloud: Cloud, targets: AttackTargets) -> float:
    """Processor seconds of a step without any saving: forward and backward on all of the cloud, and a
    detection."""
    points = torch.from_numpy(xyzi(cloud))

    def step() -> None:
        leaf = points.clone().requires_grad_()
        torch.autograd.grad(detector.loss(leaf, targets.boxes, targets.labels), leaf)
        detector.detect(cloud)

    return spent(step)[0]


@contextmanager
def exact() -> Iterator[None]:
    """Attacks show the detector all of a cloud, and it computes all of its map."""
    with patch.object(tiles, "MOST_TILES", 0.0), patch.object(focus, "SURROUNDINGS_M", 300.0):
        yield


def report_effect(attacks: Mapping[str, LidarAttack], frames: Sequence[Frame], detector: Second) -> bool:
    """Print the mAP ratio of each attack, as it is and exact; whether both differ by at most the mark."""
    clean = precisions(frames, [frame.cloud for frame in frames], detector)
    passed = True
    for name, attack in attacks.items():
        ratios = {}
        for how in ("as it is", "exact"):
            clouds = [attacked(name, attack, frame, detector, how == "exact") for frame in frames]
            found = precisions(frames, clouds, detector)
            ratios[how] = {kind: 100 * found[kind] / clean[kind] for kind in KINDS}
        for kind in KINDS:
            as_is, whole = ratios["as it is"][kind], ratios["exact"][kind]
            is_same = abs(as_is - whole) <= MOST_POINTS
            print(
                f"{name}: {kind} mAP ratio {as_is:6.2f} %, exact {whole:6.2f} %, change "
                f"{as_is - whole:+.2f} points  mark {MOST_POINTS:.0f}  {'ok' if is_same else 'ABOVE'}",
                flush=True,
            )
            passed &= is_same
    return passed


def attacked(name: str, attack: LidarAttack, frame: Frame, detector: Second, is_exact: bool) -> Cloud:
    rng = named_generator(0, name, frame.index)
    if not is_exact:
        return attack(frame.cloud, frame.boxes, detector, rng).cloud
    with exact():
        return attack(frame.cloud, frame.boxes, detector, rng).cloud


def precisions(frames: Sequence[Frame], clouds: Sequence[Cloud], detector: Second) -> dict[str, float]:
    """The mAP of the frames with these clouds, by the evaluation's rules."""
    classes, seen = known_classes(detector), CachedDetector(detector)
    matches: dict[tuple[str, str], list[FrameMatches]] = {}
    for frame, cloud in zip(frames, clouds, strict=True):
        truth = ground_truth(frame, classes, detector.range_m)
        for key, found in match(truth, seen.detect(cloud), classes, KINDS).items():
            matches.setdefault(key, []).append(found)
    boxes = {name: sum(each.n_truth for each in matches["strict", name]) for name in classes}
    enough = [name for name in classes if boxes[name] >= ENOUGH_BOXES] or list(classes)
    return {
        kind: float(mean_average_precision(np.array([average_precision(matches[kind, n]) for n in enough])))
        for kind in KINDS
    }
