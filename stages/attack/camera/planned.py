"""One attack on the cameras of a victim: what they share, and its start on each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.labels.quantity import Range
from advpipe.pipeline.scenario.acting import Acting
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.camera.base import CameraAttack, ImageAttacker
from advpipe.stages.attack.camera.drive import RecordedDrive


class PlannedAttack:
    """An attack with its parameters and its seed. drives: of all its cameras, by their images' topics."""

    def __init__(
        self,
        spec: AttackSpec,
        attack: CameraAttack,
        acts: Acting,
        drives: Mapping[str, RecordedDrive],
        seed: int,
    ) -> None:
        self.spec, self.attack, self.is_active = spec, attack, acts
        self.bounds: Mapping[str, Range] = attack.bounds
        self._drives, self._names = drives, ("attack", spec.type, spec.seed_name)
        self._seed = seed

    @cached_property
    def _plan(self) -> Any:
        return self.attack.plan(named_generator(self._seed, *self._names), list(self._drives.values()))

    def begin(self, topic: str) -> ImageAttacker:
        """Start on one camera; the plan is made before the first one."""
        drive = replace(self._drives[topic], plan=self._plan)
        return self.attack.begin(named_generator(self._seed, *self._names, topic), drive)
