"""The goal of an attack on a cloud: which objects it targets, which loss it optimises, and how it scores.

The attacker knows the true boxes, or takes the clean detections for them, and scores its candidates by the
overlaps and the matching of the evaluation: it knows more than the detector's weights.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.constraints import HIDE, Constraints
from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.adversary.targets import AttackTargets, find_targets
from advpipe.pipeline.detector.ensemble import EnsembleDetections
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, points_in_boxes
from advpipe.pipeline.geometry.iou import iou_3d, iou_bev
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU
from advpipe.pipeline.metrics.matching import match_overlaps

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

FALSE_WEIGHT = 0.3
"""The weight of a false detection near an object: it costs precision, not recall."""

DETECTED_SCORE = 0.3
"""Detections with this score or more are the objects of an attacker without the true boxes."""

NO_TARGETS = "no object to hide that the detector could find"


@dataclass(frozen=True)
class AttackGoal:
    """The M objects that an attack targets, in the cloud's frame.

    targets: their boxes and labels. loss_targets: the targets of the detector's loss; none where the attack
    hides all objects. sign: +1 where the attack raises that loss, -1 where it lowers it.
    aim: "break" detections, "hide" the objects, or "create" ghost objects.
    classes: the detector's. note: what the user must know about the targets. decoys: D false detections of
    the clean cloud, however faint; raising their scores counts as success, too.
    """

    targets: AttackTargets
    loss_targets: AttackTargets
    sign: float
    aim: str
    classes: tuple[str, ...]
    note: str = ""
    decoys: AttackTargets = field(
        default_factory=lambda: AttackTargets(torch.zeros(0, 7), torch.zeros(0).long())
    )

    @property
    def regions(self) -> Float64:
        """The boxes (M + D, 7) of the objects and the decoys: where moving points can have an effect."""
        regions: Float64 = torch.cat([self.targets.boxes, self.decoys.boxes]).double().numpy()
        return regions

    @property
    def reported_targets(self) -> AttackTargets:
        """Those whose loss is reported: an attack that hides all objects lowers a loss without any."""
        return self.loss_targets if len(self.loss_targets) else self.targets

    def success(self, found: Detections) -> Float64:
        """The success (M + D,) on each object and decoy, given these detections: higher is better.

        "break" succeeds if no detection overlaps the object strictly, and more so with false detections near
        it; "hide", if none overlaps it loosely; "create", the more, the better a detection overlaps it.
        Against an ensemble, it succeeds on an object that no member finds, see `joint_success`.
        """
        if isinstance(found, EnsembleDetections):
            return joint_success(np.array([self.success(each) for each in found.of_members()]))
        truth, labels = self.targets.boxes.double().numpy(), self.targets.labels.numpy()
        on_decoys = iou_bev(found.boxes, self.decoys.boxes.double().numpy()) > 0
        seen_decoys = FALSE_WEIGHT * (on_decoys * found.scores[:, None]).max(axis=0, initial=0.0)
        away = ~on_decoys.any(axis=1)
        here = Detections(found.boxes[away], found.scores[away], found.labels[away])
        overlap = iou_3d(here.boxes, truth) * (here.labels[:, None] == labels[None])
        if self.aim == "create":
            on_objects = np.asarray((overlap * here.scores[:, None]).max(axis=0, initial=0.0), np.float64)
        elif self.aim == "hide":
            loose = np.array([LOOSE_IOU[self.classes[label]] for label in labels.tolist()])
            on_objects = -np.asarray(((overlap >= loose) * here.scores[:, None]).max(axis=0, initial=0.0))
        else:
            kept, false = np.zeros(len(truth)), np.zeros(len(truth))
            for label in np.unique(np.concatenate([labels, here.labels])).tolist():
                mine, theirs = np.flatnonzero(labels == label), np.flatnonzero(here.labels == label)
                least = STRICT_IOU[self.classes[label]]
                everyone = np.ones(len(mine), bool)
                matches = match_overlaps(overlap[np.ix_(theirs, mine)], everyone, here.scores[theirs], least)
                hit = matches.found_by >= 0
                kept[mine[hit]] = matches.scores[matches.found_by[hit]]
                wrong = theirs[matches.is_false_positive()]
                if len(wrong) and len(truth):  # counted for the nearest object
                    away_m = np.linalg.norm(here.boxes[wrong, None, :2] - truth[None, :, :2], axis=2)
                    np.maximum.at(false, away_m.argmin(axis=1), here.scores[wrong])
            on_objects = FALSE_WEIGHT * false - kept
        return np.concatenate([on_objects, seen_decoys])

    def is_done(self, success: Float64) -> Bool:
        """Which objects and decoys (M + D,) need nothing more: objects that are lost. A ghost object and a
        false detection can always become more certain."""
        done: Bool = np.zeros(len(success), bool)
        if self.aim != "create":
            done[: len(self.targets)] = success[: len(self.targets)] >= 0
        return done


def joint_success(successes: Float64) -> Float64:
    """The success (M,) against an ensemble, of those against its members (E, M): their mean, of which those
    of members that do not find an object count 0 as long as another one finds it."""
    is_found = (successes < 0).any(axis=0)
    joint: Float64 = np.where(is_found, np.minimum(successes, 0).mean(axis=0), successes.mean(axis=0))
    return joint


def known_boxes(constraints: Constraints, detector: ObjectDetector, cloud: Cloud, boxes: Boxes) -> Boxes:
    """The objects that the attacker knows: the true boxes, or what the detector finds in the clean cloud."""
    if constraints.truth == "boxes":
        return boxes
    found = detector.detect(cloud)
    if isinstance(found, EnsembleDetections):
        found = found.merged()
    sure = found.scores >= DETECTED_SCORE
    label_of = np.array([CLASSES.index(name) for name in detector.classes], np.int64)
    count = int(sure.sum())
    labels = label_of[found.labels[sure]]
    return Boxes(found.boxes[sure], labels, ("",) * count, np.full((count, 3), np.nan))


def goal_of(constraints: Constraints, detector: ObjectDetector, cloud: Cloud, boxes: Boxes) -> AttackGoal:
    """The goal under these constraints; without objects and with a note if there is nothing to attack.

    By default the attack breaks all objects by raising the loss of the ground truth. It hides objects, all or
    chosen ones, by lowering the loss of a ground truth without them: that loss is steep where a detection is
    sure, while the focal loss of a true object is flat there. It creates a ghost object by lowering the loss
    of a ground truth with it. Raises AdvpipeError for a ghost object outside the detector's classes
    or range.
    """
    everyone, classes = find_targets(detector, cloud, boxes), detector.classes
    if constraints.ghost:
        constraints.ghost.check(detector)
        ghost = _detectable(constraints.attacked(boxes, xyz(cloud)), detector)
        note = "" if len(ghost) else "no ground for the ghost to stand on"
        return AttackGoal(ghost, _joined(everyone, ghost), -1.0, "create", classes, note)
    if constraints.objects:
        chosen = find_targets(detector, cloud, constraints.attacked(boxes, xyz(cloud)))
        absent = constraints.absent(boxes)
        note = join_notes(
            f"not in the ground truth: {', '.join(absent)}" if absent else "",
            "" if len(chosen) else NO_TARGETS,
        )
        return AttackGoal(chosen, _without(everyone, chosen), -1.0, "hide", classes, note)
    note = "" if len(everyone) else NO_TARGETS
    if constraints.goal == HIDE:
        return AttackGoal(everyone, _without(everyone, everyone), -1.0, HIDE, classes, note)
    return AttackGoal(everyone, everyone, 1.0, constraints.goal, classes, note)


def with_decoys(goal: AttackGoal, found: Detections, boxes: Boxes) -> AttackGoal:
    """The goal with the false detections among those `found` in the clean cloud as decoys; only for
    "break"."""
    if goal.aim != "break":
        return goal
    away = iou_bev(found.boxes, boxes.geometry).max(axis=1, initial=0.0) <= 0
    places = torch.from_numpy(found.boxes[away].astype(np.float32))
    return replace(goal, decoys=AttackTargets(places, torch.from_numpy(found.labels[away])))


def owners(points: npt.NDArray[np.float32], boxes: Float64, margin_m: float) -> Int64:
    """The box (M, 7), grown by a margin, that each point (N, 3) belongs to: indices (N,), -1 for none.

    A point in several boxes belongs to the one that it lies deepest in, or least far outside of.
    """
    owner = np.full(len(points), -1, np.int64)
    nearest_m = np.full(len(points), np.inf)
    for index, inside in enumerate(points_in_boxes(points, boxes, margin_m)):
        x, y, z, length, width, height, yaw = boxes[index]
        dx, dy, dz = (points[inside].astype(np.float64) - (x, y, z)).T
        along, across = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        outside_m = np.maximum.reduce(
            [np.abs(along) - length / 2, np.abs(across) - width / 2, np.abs(dz) - height / 2]
        )
        nearer = outside_m < nearest_m[inside]
        owner[inside[nearer]], nearest_m[inside[nearer]] = index, outside_m[nearer]
    return owner


def _detectable(boxes: Boxes, detector: ObjectDetector) -> AttackTargets:
    """The boxes of the detector's classes, however few points they hold."""
    names = [CLASSES[label] for label in boxes.labels]
    wanted = [i for i, name in enumerate(names) if name in detector.classes]
    labels = [detector.classes.index(names[i]) for i in wanted]
    geometry = boxes.geometry[wanted].reshape(-1, 7).astype(np.float32)
    return AttackTargets(torch.from_numpy(geometry), torch.tensor(labels, dtype=torch.int64))


def _joined(a: AttackTargets, b: AttackTargets) -> AttackTargets:
    return AttackTargets(torch.cat([a.boxes, b.boxes]), torch.cat([a.labels, b.labels]))


def _without(everyone: AttackTargets, chosen: AttackTargets) -> AttackTargets:
    rest = ~(everyone.boxes[:, None] == chosen.boxes[None]).all(2).any(1)
    return AttackTargets(everyone.boxes[rest], everyone.labels[rest])
