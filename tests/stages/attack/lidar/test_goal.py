"""What an attack is after: objects lost, decoys, ghosts, hiding; by `perturb`."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from cloud_moves import rng
from linear_detector import BOX, LinearVoxelDetector

from advpipe.pipeline.adversary.constraints import GOALS, Constraints
from advpipe.pipeline.adversary.goal import FALSE_WEIGHT, goal_of, known_boxes, with_decoys
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import Detections, OccupancyLoss
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyz
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb


def test_decoys_are_what_the_detector_finds_beside_the_truth(scene, make_boxes):
    cloud, boxes, detector = scene
    detector.anchors = np.array([BOX, [1.0, 1.0, 1.0, 1.5, 1.5, 1.5, 0.0]])  # the second stands in free space
    plain_goal = goal_of(Constraints(), detector, cloud, boxes)
    goal = with_decoys(plain_goal, detector.detect(cloud), boxes)
    assert goal.regions.tolist() == detector.anchors.tolist()
    clean = goal.success(detector.detect(cloud))
    assert clean.tolist() == [-1.0, pytest.approx(FALSE_WEIGHT)]  # scores are cut off at 1
    assert plain_goal.success(detector.detect(cloud)).tolist() == [pytest.approx(FALSE_WEIGHT - 1)]


def test_success_counts_what_the_map_counts(scene):
    cloud, boxes, detector = scene
    goal = goal_of(Constraints(), detector, cloud, boxes)
    box = np.array([BOX])
    aside = box + [[1.5, 0, 0, 0, 0, 0, 0]]  # IoU 4.5 / 7.5: too little for a car

    def success(*found):
        geometry = np.concatenate([b for b, _ in found]) if found else np.zeros((0, 7))
        scores = np.array([s for _, s in found])
        return goal.success(Detections(geometry, scores, np.zeros(len(found), np.int64))).tolist()

    assert success() == [0.0]
    assert success((box, 0.9)) == [-0.9]
    assert success((aside, 0.8)) == [pytest.approx(0.8 * FALSE_WEIGHT)]
    assert success((box, 0.9), (aside, 0.8)) == [pytest.approx(0.8 * FALSE_WEIGHT - 0.9)]


class Contrasting(LinearVoxelDetector):
    """Its loss falls with the scores of what is loss_targets and rises with those of what is not."""

    def occupancy_loss(self, points, boxes, labels, probes=None):
        places = torch.as_tensor(self.anchors, dtype=torch.float32)
        probes = torch.zeros(0, 4) if probes is None else probes
        scores, occupancy, voxel = self._scores(points, places, probes)
        loss_targets = (places[:, None] == boxes[None]).all(2).any(1)
        loss = torch.where(loss_targets, -scores, scores).sum()
        return OccupancyLoss(loss, occupancy, voxel)

    def loss(self, points, boxes, labels):
        return self.occupancy_loss(points, boxes, labels).loss


def test_one_object_is_hidden_and_the_others_left_alone(make_cloud, make_boxes):
    cars = [[1.5, 0.5, 0.5, 3.0, 1.0, 1.0, 0.0], [1.5, 7.5, 0.5, 3.0, 1.0, 1.0, 0.0]]
    points = [[x + 0.5, y, 0.6] for x in range(3) for y in (0.6, 7.6) for _ in range(2)]
    boxes, detector = make_boxes(*cars), Contrasting(np.ones((10, 10, 10)), cars)
    cloud = make_cloud(points)
    for name, hidden in (("car1", 1), ("car0", 0)):
        result = Perturb(eps_cm=60, objects=(name,))(cloud, boxes, detector, rng())
        assert detector.detect(result.cloud).boxes.tolist() == [cars[1 - hidden]]
        assert np.isin(result.labels.point, points_in_boxes(points, boxes.geometry)[hidden]).all()
    assert "no object" in Perturb(eps_cm=60, objects=("bus7",))(cloud, boxes, detector, rng()).note


def test_a_ghost_object_is_created_from_points_nearby(make_cloud, make_boxes, make_detector):
    # Fifty points just below the voxels of a car that is not there.
    draw = np.random.default_rng(2)
    cloud = make_cloud(np.column_stack([draw.uniform(3, 7, (50, 2)), np.full(50, 0.97)]))
    detector = make_detector(np.full((10, 10, 10), 0.2), [[5.0, 5.0, 1.745, 4.5, 1.85, 1.55, 0.0]])
    detector.weights[:, :, 0] = 0
    assert len(detector.detect(cloud)) == 0
    result = Perturb(eps_cm=5, ghost="car:5:5")(cloud, make_boxes(), detector, rng())
    assert len(detector.detect(result.cloud)) == 1
    assert result.loss_after < result.loss_before


def test_every_other_gradient_is_that_of_a_false_loss(scene, monkeypatch):
    loss_targets, ask = [], LinearVoxelDetector.occupancy_loss

    def watched(self, points, boxes, labels, probes=None):
        loss_targets.append(len(boxes))
        return ask(self, points, boxes, labels, probes)

    monkeypatch.setattr(LinearVoxelDetector, "occupancy_loss", watched)
    Perturb(eps_cm=10, steps=5)(*scene, rng())
    assert loss_targets == [1, *(1, 0, 1, 0), 1]  # before, rounds, after; one try is the combination


def test_hiding_asks_for_no_box_at_all(make_boxes, make_detector):
    """Of two boxes over one car, a tight and a loose one: to break one is not to hide it."""
    truth, off = [4.0, 5.0, 5.0, 6.0, 6.0, 6.0, 0.0], [4.9, 5.0, 5.0, 6.0, 6.0, 6.0, 0.0]
    detector, boxes = make_detector(np.ones((10, 10, 10)), [truth]), make_boxes(truth)
    cloud = np.zeros(50, POINT_DTYPE)
    for name in "xyz":
        cloud[name] = np.linspace(2, 7, 50)
    goals = {name: goal_of(Constraints(goal=name), detector, cloud, boxes) for name in GOALS}
    seen = Detections(np.array([off]), np.array([0.8]), np.zeros(1, np.int64))  # an IoU of 5.1 / 6.9 = 0.74
    far = Detections(np.array([[5.5, *off[1:]]]), np.array([0.8]), np.zeros(1, np.int64))  # 4.5 / 7.5 = 0.6
    none = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
    assert goals["break"].success(seen) == goals["hide"].success(seen) == pytest.approx([-0.8])
    assert goals["break"].success(far) == pytest.approx([FALSE_WEIGHT * 0.8])  # misplaced: broken
    assert goals["hide"].success(far) == pytest.approx([-0.8])  # but still seen
    assert goals["hide"].success(none) == goals["break"].success(none) == 0


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (Detach, {"ratio": 0.3}),
        (Attach, {"eps_m": 0.5, "points": 5}),
        (Perturb, {"eps_cm": 40, "recipe": "random-near"}),
    ],
)
def test_without_labels_the_attacker_takes_the_clean_detections(scene, kind, options):
    """The car that the detector finds is attacked as with its true box; nothing is where it finds none."""
    cloud, boxes, detector = scene
    attack, blind = kind(**options), kind(**options, truth="detections")
    assert not blind.needs_ground_truth
    assert attack.needs_ground_truth
    known = known_boxes(blind.constraints, detector, cloud, boxes)
    assert known.geometry.tolist() == detector.detect(cloud).boxes.tolist()
    labelled, unlabelled = attack(cloud, boxes, detector, rng()), blind(cloud, Boxes(), detector, rng())
    assert unlabelled.cloud.tobytes() == labelled.cloud.tobytes()
    assert len(unlabelled.labels)
    detector.weights = detector.weights * 0  # it finds nothing
    assert len(blind(cloud, boxes, detector, rng()).labels) == 0


class TwiceDetector(LinearVoxelDetector):
    """Finds its first anchor with a score of 0.31, its second with one of 0.29."""

    def detect(self, cloud):
        return Detections(self.anchors[:2], np.array([0.31, 0.29]), np.zeros(2, np.int64))


def test_detections_stand_for_true_boxes_from_a_score_on(scene):
    cloud, boxes, _ = scene
    detector = TwiceDetector(np.ones((10, 10, 10)), [BOX, [1.0, 1.0, 1.0, 1.5, 1.5, 1.5, 0.0]])
    assert known_boxes(Constraints(truth="detections"), detector, cloud, boxes).geometry.tolist() == [BOX]
    assert known_boxes(Constraints(), detector, cloud, boxes) is boxes
    with pytest.raises(AdvpipeError, match="truth is 'labels'; "):
        Perturb(eps_cm=1, truth="labels")
    with pytest.raises(AdvpipeError, match="objects are chosen by the ids of true boxes"):
        Perturb(eps_cm=1, truth="detections", objects=("car0",))


def test_hiding_hides(hand_worked):
    cloud, boxes, detector = hand_worked
    assert len(detector.detect(cloud)) == 1
    result = Perturb(eps_cm=51, goal="hide")(cloud, boxes, detector, rng())
    assert len(detector.detect(result.cloud)) == 0


def test_intensity_alone_needs_no_reach(scene):
    """Points stay where they are, to the bit."""
    for recipe in ("random", "random-near", "random-best", "best"):
        attack = Perturb(eps_cm=0, recipe=recipe, steps=2, intensity=True)
        result = attack(*scene, rng())
        assert xyz(result.cloud).tobytes() == xyz(scene[0]).tobytes()
        assert not result.labels.displacement_m.any()
        if recipe.startswith("random") and recipe != "random-best":
            assert (result.cloud["intensity"] != scene[0]["intensity"]).any()
    with pytest.raises(AdvpipeError, match="eps_cm is 0, but must lie above 0"):
        Perturb(eps_cm=0)
