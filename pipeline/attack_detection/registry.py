"""The attack checks by name; a user's own is named `module:Class`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from advpipe.pipeline.attack_detection.base import AttackCheck, DefenderKnowledge, Suspicion
from advpipe.pipeline.attack_detection.carlo import CarloCheck
from advpipe.pipeline.attack_detection.density import DensityCheck
from advpipe.pipeline.attack_detection.names import ALL, NONE, SEQUENCE_CHECKS
from advpipe.pipeline.attack_detection.occlusion_order import OcclusionOrderCheck
from advpipe.pipeline.attack_detection.ray import RayCheck
from advpipe.pipeline.attack_detection.shadow_catcher import ShadowCatcherCheck
from advpipe.pipeline.attack_detection.voxel_face import VoxelFaceCheck
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud

MakeCheck = Callable[[DefenderKnowledge], AttackCheck]

ATTACK_CHECKS: Mapping[str, MakeCheck] = {
    "ray": RayCheck,
    "voxel-face": VoxelFaceCheck,
    "density": DensityCheck,
    "occlusion-order": OcclusionOrderCheck,
    "carlo": CarloCheck,
    "shadow-catcher": ShadowCatcherCheck,
}


def parse_attack_checks(names: Sequence[str]) -> dict[str, MakeCheck]:
    """The checks of single clouds by their names; `all` are those of advpipe, `none` (alone) is no check.

    Those of `chosen_sequence_checks` may be among the names. Raises UsageError for an unknown name, a class
    that cannot be loaded, and a check that is given twice.
    """
    if NONE in names:
        if len(names) > 1:
            raise UsageError(f"attack check {NONE} stands alone; leave out the others")
        return {}
    every = [
        one for name in names for one in ((*ATTACK_CHECKS, *SEQUENCE_CHECKS) if name == ALL else (name,))
    ]
    if twice := [one for one in every if every.count(one) > 1]:
        raise UsageError(f"attack check {twice[0]} is given twice")
    return {
        one: ATTACK_CHECKS[one] if one in ATTACK_CHECKS else _own(one)
        for one in every
        if one not in SEQUENCE_CHECKS
    }


def chosen_sequence_checks(names: Sequence[str]) -> tuple[str, ...]:
    """The checks of consecutive clouds among the names."""
    return tuple(one for one in SEQUENCE_CHECKS if one in names or ALL in names)


def _own(name: str) -> MakeCheck:
    """The class of a user's check, whose mistakes become one-line errors."""
    if ":" not in name:
        known = known_names(name, [*ATTACK_CHECKS, *SEQUENCE_CHECKS, ALL, NONE])
        raise UsageError(f"unknown attack check {name!r}; {known} (or your own module:Class)")
    own_class: MakeCheck = import_object(name, f"attack check {name} cannot be loaded")
    if not callable(own_class):
        raise UsageError(f"attack check {name} is not a class")

    def make(knowledge: DefenderKnowledge) -> AttackCheck:
        with plugin_errors(plugin_names([name])):
            check = own_class(knowledge)

        def judged(cloud: Cloud, detections: Detections) -> Suspicion:
            with plugin_errors(plugin_names([name])):
                found = check(cloud, detections)
                _refuse_invalid(found, len(cloud), len(detections))
            return found

        return judged

    return make


def _refuse_invalid(found: Suspicion, points: int, detections: int) -> None:
    """Raises TypeError or ValueError for what is no suspicion on a cloud of so many points."""
    if not isinstance(found, Suspicion):
        raise TypeError(f"returned {type(found).__name__} instead of a Suspicion")
    if found.points is not None and (found.points.shape != (points,) or found.points.dtype != np.bool_):
        raise ValueError(f"points has the shape {found.points.shape}, not ({points},) of bool")
    if found.detections is not None and found.detections.shape != (detections,):
        raise ValueError(f"detections has the shape {found.detections.shape}, not ({detections},)")
    if found.fake is not None and (found.fake.shape != (detections,) or found.fake.dtype != np.bool_):
        raise ValueError(f"fake has the shape {found.fake.shape}, not ({detections},) of bool")
