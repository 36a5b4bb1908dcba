"""The attacks on cameras by name."""

from __future__ import annotations

from advpipe.stages.attack.camera.base import CameraAttack
from advpipe.stages.attack.family_registry import Add, FamilyRegistry


def _fill(add: Add[CameraAttack]) -> None:
    from advpipe.stages.attack.camera.blind import CameraBlind
    from advpipe.stages.attack.camera.delay import CameraDelay
    from advpipe.stages.attack.camera.drop import CameraDrop
    from advpipe.stages.attack.camera.freeze import CameraFreeze
    from advpipe.stages.attack.camera.patch import CameraPatch

    add("camera-patch", CameraPatch)
    add("camera-blind", CameraBlind)
    add("camera-drop", CameraDrop)
    add("camera-freeze", CameraFreeze)
    add("camera-delay", CameraDelay)


CAMERA_ATTACKS = FamilyRegistry[CameraAttack]("camera", _fill)
