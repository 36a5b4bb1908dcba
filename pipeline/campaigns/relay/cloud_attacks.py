"""The attacks on clouds of a relay, each under its schedule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.attacked import load_attacked
from advpipe.pipeline.detector.no_detector import NoDetector
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import StampedCloud, cloud_from_cdr, cloud_to_cdr, xyz
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.base import LidarAttack, LidarResult
from advpipe.stages.attack.lidar.build import adaptation_of, build_lidar_attack
from advpipe.stages.attack.lidar.result_checks import refuse_invalid, refuse_out_of_bounds
from advpipe.stages.attack.lidar.scan_placement import in_scan_order
from advpipe.stages.attack.parameters import known_parameters

_PACKAGE = "advpipe.pipeline.campaigns.relay"
RELAY_ATTACKS = {
    "remove-sector": f"{_PACKAGE}.remove_sector:RemoveSector",
    "insert-ghost": f"{_PACKAGE}.insert_ghost:InsertGhost",
}
"""Attacks on clouds beside those of `advpipe attacks`, where they are `module:Class`."""


def relay_spec(spec: AttackSpec) -> AttackSpec:
    """The attack under the name by which it is found."""
    return spec.model_copy(update={"type": RELAY_ATTACKS.get(spec.type, spec.type)})


class AttackedCloud(NamedTuple):
    """cdr: the message with the adversarial points, the one that came where no point was touched."""

    clean: StampedCloud
    result: LidarResult
    cdr: bytes


@dataclass(frozen=True)
class ScheduledCloudAttack:
    """One attack, built; name: the one in the file."""

    name: str
    spec: AttackSpec
    attack: LidarAttack
    detector: ObjectDetector
    is_active: Acting

    def from_time(self, start_ns: int, seed: int) -> ScheduledCloudAttack:
        """The same whose schedule counts from here."""
        spec = self.spec.model_copy(update={"type": self.name})
        return replace(self, is_active=acting_on_messages(spec, start_ns, seed))

    def __call__(self, number: int, cdr: bytes, seed: int) -> AttackedCloud:
        """Attack the cloud with this number in the stream. Raises AdvpipeError for an invalid message."""
        stamped = cloud_from_cdr(cdr)
        rng = named_generator(seed, "attack", self.name, number, self.spec.seed_name)
        with fixed_torch_threads():
            detector, note = detector_for_cloud(
                self.detector, adaptation_of(self.spec), xyz(stamped.cloud), self.detector
            )
            result = self.attack(stamped.cloud, Boxes(), detector, rng)
        if note:
            result = replace(result, note=join_notes(note, result.note))
        refuse_invalid(self.name, stamped.cloud, result)
        refuse_out_of_bounds(self.name, self.attack, stamped.cloud, result)
        if len(result.labels):
            result = in_scan_order(stamped.cloud, result)
            cdr = cloud_to_cdr(result.cloud, stamped.stamp_ns, stamped.frame_id)
        return AttackedCloud(stamped, result, cdr)


def scheduled_cloud_attacks(
    specs: Sequence[AttackSpec], start_ns: int, seed: int
) -> tuple[ScheduledCloudAttack, ...]:
    """Raises UsageError for an attack that needs true boxes, which a graph does not publish."""
    built = []
    for spec in specs:
        found = relay_spec(spec)
        attack = build_lidar_attack(found).without_losses()
        if attack.needs_ground_truth and getattr(attack, "truth", "") != "detections":
            known = known_parameters(type(attack))
            hint = "set truth: detections in its parameters" if "truth" in known else "take another attack"
            raise UsageError(f"{spec.type} needs true boxes, which a relay does not have; {hint}")
        queries_none = spec.type in RELAY_ATTACKS or getattr(attack, "recipe", "") == "random"
        detector = NoDetector() if queries_none else load_attacked(spec.detector)
        is_active = acting_on_messages(spec, start_ns, seed)
        built.append(ScheduledCloudAttack(spec.type, found, attack, detector, is_active))
    return tuple(built)
