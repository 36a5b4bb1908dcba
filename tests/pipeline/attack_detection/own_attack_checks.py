"""Attack checks of a user's own."""

import numpy as np

from advpipe.pipeline.attack_detection.base import Suspicion


class Bright:
    def __init__(self, knowledge):
        self.limit = max(cloud["intensity"].max() for cloud in knowledge.clean)

    def __call__(self, cloud, detections):
        return Suspicion(float(cloud["intensity"].max()), points=cloud["intensity"] > self.limit)


class Wrong(Bright):
    def __call__(self, cloud, detections):
        return Suspicion(0.0, points=np.zeros(3, bool))
