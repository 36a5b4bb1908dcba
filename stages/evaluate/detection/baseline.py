"""The random baseline of an attacked cloud: as many points touched, as far, but by chance."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from advpipe.pipeline.bag.cloud import Cloud, xyz
from advpipe.pipeline.baselines import add_random_points, move_random_points, remove_random_points
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.evaluate.detection.cloud_difference import CloudDifference


def random_baseline(
    clean: Cloud, adversarial: Cloud, change: CloudDifference, boxes: Boxes, rng: np.random.Generator
) -> Cloud:
    """The clean cloud after random changes of the attack's budget.

    As many points go as the attack removed, from anywhere. As many move as it moved, in random
    directions by the same distances. As many come as it added, near objects, as far from a point
    of the clean cloud as its farthest.
    """
    cloud = clean
    if len(change.moved):
        distance_m = np.zeros(len(cloud))
        chosen = rng.choice(len(cloud), size=len(change.moved), replace=False)
        distance_m[chosen] = change.displacement_m
        cloud = move_random_points(cloud, distance_m, rng)
    if len(change.removed):
        cloud = cloud[remove_random_points(cloud, len(change.removed), rng)]
    if len(change.added):
        reach_m, _ = cKDTree(xyz(clean)).query(xyz(adversarial[change.added]))
        cloud = add_random_points(cloud, len(change.added), float(np.max(reach_m)), rng, boxes)
    return cloud
