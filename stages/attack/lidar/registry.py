"""The attacks on clouds by name."""

from __future__ import annotations

from advpipe.stages.attack.family_registry import Add, FamilyRegistry
from advpipe.stages.attack.lidar.base import LidarAttack


def _fill(add: Add[LidarAttack]) -> None:
    from advpipe.stages.attack.lidar.attach import Attach
    from advpipe.stages.attack.lidar.detach import Detach
    from advpipe.stages.attack.lidar.perturb import Perturb

    add("perturb", Perturb)
    add("detach", Detach)
    add("attach", Attach)


LIDAR_ATTACKS = FamilyRegistry[LidarAttack]("lidar", _fill)
