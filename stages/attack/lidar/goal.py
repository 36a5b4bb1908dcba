"""What an attack on a cloud is after: whom it fights, which loss it follows, and how well an attempt did.

The attacker is given the true boxes and judges its tries by the overlaps and the matching that evaluation
scores with: it knows more than the detector's weights.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, points_in_boxes
from advpipe.pipeline.geometry.iou import iou_3d, iou_bev
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU
from advpipe.pipeline.metrics.matching import match_overlaps
from advpipe.stages.attack.lidar.base import join_notes
from advpipe.stages.attack.lidar.constraints import Constraints
from advpipe.stages.attack.lidar.targets import AttackTargets, find_targets

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

FALSE_WEIGHT = 0.3
"""What a false detection near an object is worth beside the object's own: it costs precision, not recall."""

NOBODY = "no object to hide that the detector could find"


@dataclass(frozen=True)
class Goal:
    """The M objects that an attack fights over, in the cloud's frame.

    targets: their boxes and labels. loss_targets: what the detector's loss is asked for.
    sign: +1 where the attack raises that loss, -1 where it lowers it.
    kind: "break" detections at all, "hide" the objects, or "create" them.
    classes: the detector's. note: what the user must know about whom it fights. decoys: D places without
    an object where the detector sees one already, if faintly; to make it surer is worth something, too.
    """

    targets: AttackTargets
    loss_targets: AttackTargets
    sign: float
    kind: str
    classes: tuple[str, ...]
    note: str = ""
    decoys: AttackTargets = field(
        default_factory=lambda: AttackTargets(torch.zeros(0, 7), torch.zeros(0).long())
    )

    @property
    def regions(self) -> Float64:
        """The boxes (M + D, 7) of the objects and the decoys: where points are worth moving."""
        regions: Float64 = torch.cat([self.targets.boxes, self.decoys.boxes]).double().numpy()
        return regions

    def success(self, found: Detections) -> Float64:
        """How well the attack did on each object and decoy (M + D,) by these detections: higher is better.

        To break one: no detection of strict overlap, and false ones beside it. To hide one: no detection
        of loose overlap. To create one: a detection of it, and short of that a box that nearly is one.
        """
        truth, labels = self.targets.boxes.double().numpy(), self.targets.labels.numpy()
        on_decoys = iou_bev(found.boxes, self.decoys.boxes.double().numpy()) > 0
        seen_decoys = FALSE_WEIGHT * (on_decoys * found.scores[:, None]).max(axis=0, initial=0.0)
        away = ~on_decoys.any(axis=1)
        here = Detections(found.boxes[away], found.scores[away], found.labels[away])
        overlap = iou_3d(here.boxes, truth) * (here.labels[:, None] == labels[None])
        if self.kind == "create":
            on_objects = np.asarray((overlap * here.scores[:, None]).max(axis=0, initial=0.0), np.float64)
        elif self.kind == "hide":
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
                if len(wrong) and len(truth):  # it counts for the nearest object
                    away_m = np.linalg.norm(here.boxes[wrong, None, :2] - truth[None, :, :2], axis=2)
                    np.maximum.at(false, away_m.argmin(axis=1), here.scores[wrong])
            on_objects = FALSE_WEIGHT * false - kept
        return np.concatenate([on_objects, seen_decoys])


def goal_of(constraints: Constraints, detector: ObjectDetector, cloud: Cloud, boxes: Boxes) -> Goal:
    """The goal under these constraints; of no objects, with a note, where there is nothing to fight over.

    Every object's detection is broken or, on demand, hidden: the loss of the truth goes up. Chosen objects
    are hidden as the loss of a truth without them goes down; a ghost is created likewise. Raises
    AdvpipeError for a ghost that the detector cannot find, wherever it stood.
    """
    everyone, classes = find_targets(detector, cloud, boxes), detector.classes
    if constraints.ghost:
        constraints.ghost.check(detector)
        ghost = _known(constraints.attacked(boxes, xyz(cloud)), detector)
        note = "" if len(ghost) else "no ground for the ghost to stand on"
        return Goal(ghost, _joined(everyone, ghost), -1.0, "create", classes, note)
    if constraints.objects:
        chosen = find_targets(detector, cloud, constraints.attacked(boxes, xyz(cloud)))
        absent = constraints.absent(boxes)
        note = join_notes(
            f"not in the ground truth: {', '.join(absent)}" if absent else "",
            "" if len(chosen) else NOBODY,
        )
        return Goal(chosen, _without(everyone, chosen), -1.0, "hide", classes, note)
    note = "" if len(everyone) else NOBODY
    return Goal(everyone, everyone, 1.0, constraints.goal, classes, note)


def with_decoys(goal: Goal, detector: ObjectDetector, cloud: Cloud, boxes: Boxes) -> Goal:
    """The goal with what the detector finds in the clean cloud where none of the true boxes is."""
    if goal.kind != "break":
        return goal
    found = detector.detect(cloud)
    away = iou_bev(found.boxes, boxes.geometry).max(axis=1, initial=0.0) <= 0
    places = torch.from_numpy(found.boxes[away].astype(np.float32))
    return replace(goal, decoys=AttackTargets(places, torch.from_numpy(found.labels[away])))


def owners(points: npt.NDArray[np.float32], boxes: Float64, margin_m: float) -> Int64:
    """Which of the boxes (M, 7), grown by a margin, each point (N, 3) belongs to: (N,), -1 for none.

    Where boxes share a point, it is the one with the point farthest inside, or least far outside.
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


def _known(boxes: Boxes, detector: ObjectDetector) -> AttackTargets:
    """The boxes of classes that the detector has, however few points they hold."""
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
