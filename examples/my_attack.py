"""A LiDAR attack of your own: a laser dazzles the sensor; --type my_attack:Dazzle --set width_deg=10."""

import numpy as np

import advpipe
from advpipe import Budget, LidarAttack, LidarResult, LidarTraits, PointLabels


class Dazzle(LidarAttack):
    """Hides the nearest object that the detector could find: no echoes from `width_deg` around its centre."""

    traits = LidarTraits(budget=Budget(title="Dazzled sector in °", parameter="width_deg", unit="°"))

    @property
    def bounds(self):  # least and most of each cloud, which `verify` measures again
        return {"points_moved": (0, 0), "points_added": (0, 0)}

    def __init__(self, *, width_deg: float) -> None:  # by keyword: the parameters of --set, and their types
        if not 0 < width_deg < 360:
            raise advpipe.AdvpipeError(f"Dazzle: width_deg is {width_deg}, but must lie between 0 and 360")
        self.half_rad = np.radians(width_deg) / 2

    def __call__(self, cloud, boxes, detector, rng):
        """The cloud (N,) with the fields x, y, z, intensity, ring, time, and what was done to which point."""
        targets = advpipe.find_targets(detector, cloud, boxes)
        if not len(targets):
            return advpipe.unchanged(cloud, "no object to hide")
        x_m, y_m = targets.boxes[:, :2].double().numpy().T  # in the LiDAR's frame
        nearest = np.argmin(np.hypot(x_m, y_m))
        centre_rad = np.arctan2(y_m[nearest], x_m[nearest])
        off_rad = np.arctan2(cloud["y"], cloud["x"]) - centre_rad
        dazzled = np.flatnonzero(np.cos(off_rad) > np.cos(self.half_rad))
        adversarial = np.delete(cloud, dazzled)
        before, after = (advpipe.detection_loss(detector, each, targets) for each in (cloud, adversarial))
        return LidarResult(adversarial, PointLabels.removed(dazzled), before, after)
