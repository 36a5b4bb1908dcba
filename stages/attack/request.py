"""The attacks that a user requests, as given and with all defaults."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.detector.attacked import attacked_name, attacked_sha256
from advpipe.pipeline.detector.device import device_record, frames_at_once, open_device
from advpipe.pipeline.image_detector.registry import image_detector_sha256
from advpipe.pipeline.labels.declaration import Family
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.attack.camera.base import CameraAttack
from advpipe.stages.attack.declared import declaration_of
from advpipe.stages.attack.parameters import resolved_parameters, resolved_recipe
from advpipe.stages.attack.plugin import source_sha256
from advpipe.stages.attack.registry import BASES, find_attack, refuse_foreign_keys, resolved_name

ADAPTING_KEYS = ("lidar_height_m", "level", "scale_intensity")
"""The keys that say how clouds are presented to the detector."""


@dataclass(frozen=True)
class AttackRequest:
    """One or several attacks on one bag; several are one coordinated attack.

    device: where detectors compute, as `open_device` takes it. debug: whether the bag has debug topics, which
    show viewers what was attacked.
    """

    attacks: tuple[AttackSpec, ...]
    seed: int = AttackOptions.seed
    device: str = AttackOptions.device
    debug: bool = AttackOptions.debug

    def __post_init__(self) -> None:
        object.__setattr__(self, "attacks", tuple(map(resolved_name, self.attacks)))

    def of(self, family: Family) -> tuple[AttackSpec, ...]:
        """Its attacks of a family. Raises AdvpipeError for an unknown attack."""
        return tuple(spec for spec in self.attacks if find_attack(spec.type).family == family)

    @property
    def lidar(self) -> tuple[AttackSpec, ...]:
        """Its attacks that change clouds."""
        return self.of("lidar")

    @property
    def has_messages(self) -> bool:
        """Whether any attack changes messages, so that all of the drive is kept."""
        return len(self.lidar) < len(self.attacks)

    @property
    def frames(self) -> FrameSlice:
        """The clouds that the adversarial bag holds, counted in the clean bag."""
        slices = {spec.frames for spec in self.lidar} or {"::"}
        if len(slices) > 1:
            raise UsageError(f"frames: one bag cannot hold both {' and '.join(sorted(slices))}; give one")
        return FrameSlice.parse(slices.pop())

    def check(self) -> None:
        """Raises AdvpipeError for an attack, a parameter or a device that is invalid for any bag."""
        if not self.attacks:
            raise UsageError("no attack is given; name one")
        open_device(self.device)
        chosen = self.frames
        if chosen.stop is not None and chosen.stop <= chosen.start:
            raise UsageError(f"frames {chosen} choose none: the stop, excluded, is not after the start")
        for spec in self.attacks:
            refuse_foreign_keys(spec)
            declaration_of(spec)

    def refuse_without_v2x(self, name: str, scenario: Scenario) -> None:
        """Raises AdvpipeError if the attacks of this name need V2X and the scenario does not record it."""
        for spec in self.of("v2x") if not scenario.v2x.enabled else ():
            raise UsageError(f"attacks.{name}: {spec.type} attacks V2X, but v2x.enabled is false")

    def resolved(self) -> list[dict[str, Any]]:
        """The attacks with all defaults, and the checksums of their detectors and code."""
        return [_resolved(spec, self.device) for spec in self.attacks]

    def headline(self) -> dict[str, Any]:
        """Attack, recipe and parameters in short; of several attacks, those of the one on clouds."""
        leading = (self.lidar or self.attacks)[0]
        alone = len(self.lidar or self.attacks) == 1
        attack_class = find_attack(leading.type)
        return {
            "attack": "+".join(spec.type for spec in self.attacks),
            "recipe": resolved_recipe(leading, attack_class) if alone else "",
            "parameters": resolved_parameters(leading, attack_class) if alone else {},
        }


def image_detectors_of(spec: AttackSpec) -> tuple[str, ...]:
    """The names of the image detectors that an attack on cameras attacks; none for any other."""
    attack_class = find_attack(spec.type)
    if not issubclass(attack_class, CameraAttack):
        return ()
    return attack_class(**resolved_parameters(spec, attack_class)).image_detectors


def _resolved(spec: AttackSpec, device: str) -> dict[str, Any]:
    attack_class = find_attack(spec.type)
    foreign = {key for base in BASES for key in base.own_keys} - set(attack_class.own_keys)
    plain = spec.model_dump(mode="json", exclude=foreign)
    plain["declared"] = declaration_of(spec).plain()
    plain["attack_sha256"] = source_sha256(attack_class)
    try:
        plain["parameters"] = plain_json.load_json(json.dumps(resolved_parameters(spec, attack_class)))
    except (TypeError, ValueError) as error:  # of a user's own attack
        raise AdvpipeError(f"{spec.type}: parameters cannot be written as JSON: {error}") from None
    if detectors := image_detectors_of(spec):
        plain["image_detector_sha256"] = {name: image_detector_sha256(name) for name in detectors}
    if attack_class.family != "lidar":
        for key in ("credentials", "network"):
            if plain.get(key) == AttackSpec.model_fields[key].default:
                del plain[key]  # the record of an insider's attack through our radio does not mention it
        return plain
    for key in ADAPTING_KEYS:
        if plain[key] == AttackSpec.model_fields[key].default:
            del plain[key]  # the record of an attack on clouds as they are does not mention it
    plain["recipe"] = resolved_recipe(spec, attack_class)
    plain["detector"] = attacked_name(spec.detector)
    plain["detector_sha256"] = attacked_sha256(spec.detector)
    count = frames_at_once(device)
    batch = {"frames_at_once": str(count)} if count > 1 else {}
    return {**plain, **device_record(device), **batch}
