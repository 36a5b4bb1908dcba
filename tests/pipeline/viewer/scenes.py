"""Two small scenes: one from which an attack removes points, and one in which it moves some."""

import numpy as np

from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.viewer.scene import (
    ATTACKED,
    CLEAN,
    FOUND,
    HIT,
    LOST,
    PREDICTION,
    TRUTH,
    Fact,
    SceneBox,
    SceneLine,
    ViewerScene,
)

LOST_CAR = SceneBox(
    TRUTH,
    (12.0, 3.0, -1.0, 4.5, 1.9, 1.6, 0.3),
    "car ego.7",
    LOST,
    id="ego.7",
    lead="Found on the clean cloud only.",
    facts=(Fact("range", "12.4 m"), Fact("score", "0.83", "0.21"), Fact("LiDAR points", "143", "97")),
)
FOUND_CAR = SceneBox(TRUTH, (9.0, -6.0, -1.0, 4.2, 1.8, 1.5, 0.0), "car ego.8", FOUND, id="ego.8")
PREDICTIONS = (
    SceneBox(PREDICTION, (12.1, 3.0, -1.0, 4.4, 1.9, 1.6, 0.3), "predicted car, 0.83", HIT, CLEAN),
    SceneBox(PREDICTION, (9.1, -6.0, -1.0, 4.2, 1.8, 1.5, 0.0), "predicted car, 0.91", HIT, ATTACKED),
)


def cloud(count=3000, seed=0):
    rng = np.random.default_rng(seed)
    points = np.zeros(count, POINT_DTYPE)
    points["x"], points["y"] = rng.uniform(-30, 30, (2, count))
    points["z"] = rng.uniform(-1.8, 0.5, count)
    points["intensity"] = rng.uniform(0, 1, count)
    points["ring"] = np.arange(count) % 32
    return points


def removing_scene():
    """An attack takes the points of the lost car away, and puts some above it."""
    clean = cloud()
    near = np.flatnonzero(np.hypot(clean["x"] - 12, clean["y"] - 3) < 4)
    added = cloud(25, seed=1)
    added["x"] = 12 + added["x"] / 30
    added["y"] = 3 + added["y"] / 30
    attacked = np.concatenate([np.delete(clean, near), added])
    return ViewerScene(
        "detach-000003",
        "detach, frame 3: 1 lost",
        clean,
        attacked,
        boxes=(LOST_CAR, FOUND_CAR, *PREDICTIONS),
        lines=(SceneLine("lane", np.array([[-20.0, 4, -1.8], [0, 4, -1.8], [20, 5, -1.8]])),),
        note="Predictions with a score of at least 0.30.",
        label="3: 1 lost",
    )


def moving_scene():
    """An attack moves every tenth point by a few centimetres, and one only reflects otherwise."""
    clean = cloud()
    attacked = clean.copy()
    attacked["x"][::10] += 0.04
    attacked["z"][::10] -= 0.02
    attacked["intensity"][5] = 0.0
    return ViewerScene("perturb-000004", "perturb, frame 4", clean, attacked, boxes=(FOUND_CAR,), label="4")
