"""The work of one process: it attacks clouds of a bag, one by one or in batches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path

from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.bag.frame_reader import FrameReader
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.attacked import load_attacked
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.protocol import BatchDetector, ObjectDetector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.clouds import AttackedCloud
from advpipe.stages.attack.lidar.base import LidarAttack, LidarResult
from advpipe.stages.attack.lidar.build import adaptation_of, build_lidar_attack
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.lidar.result_checks import refuse_invalid, refuse_out_of_bounds
from advpipe.stages.attack.lidar.scan_placement import in_scan_order
from advpipe.stages.attack.lidar.surrogate import with_surrogate
from advpipe.stages.attack.parameters import resolved_recipe

Group = tuple[int, ...]
"""Clouds that are attacked at once, by their places in the plan."""

GroupResults = list[tuple[int, LidarResult]]
"""The results of a group's clouds, each with its place in the plan."""


def groups_of(clouds: Sequence[AttackedCloud], at_once: int) -> list[Group]:
    """The clouds in groups of at most `at_once`, each under one attack.

    The groups depend on the plan alone, not on what is done already, as the clouds of a batch affect each
    other's last bits.
    """
    groups: list[Group] = []
    for _, same in groupby(range(len(clouds)), key=lambda place: clouds[place].attack):
        places = tuple(same)
        groups += [places[first : first + at_once] for first in range(0, len(places), at_once)]
    return groups


def unfinished(groups: Sequence[Group], done: frozenset[int]) -> list[int]:
    """The groups that hold a cloud that is not done, by their places."""
    return [n for n, group in enumerate(groups) if not done.issuperset(group)]


def cloud_attacker(
    clean: Path,
    attacks: Sequence[AttackSpec],
    clouds: Sequence[AttackedCloud],
    groups: Sequence[Group],
    seed: int,
    done: frozenset[int],
    device: str = CPU,
) -> Callable[[int], GroupResults]:
    """Attacks one of the groups, named by its place in the sequence; of several clouds, those not `done`.

    A group of several is done as a whole, also where some of it was done before, if the detector takes
    batches; else cloud by cloud. Several processes may share a GPU: each is started anew and has a CUDA
    context of its own.
    """
    bag = BagReader(clean)
    readers = {topic: FrameReader(bag, topic) for topic in {cloud.topic for cloud in clouds}}
    detectors = {spec.detector: load_attacked(spec.detector, device) for spec in attacks}

    @cache
    def attacker(attack: int, member: int) -> LidarAttack:
        """One instance for each member: members run in threads, and a user's attack may have state."""
        return build_lidar_attack(attacks[attack])

    def attack_cloud(place: int, attack: LidarAttack, detector: ObjectDetector) -> LidarResult:
        cloud = clouds[place]
        spec = attacks[cloud.attack]
        frame = readers[cloud.topic].frame(cloud.frame)
        named = filter(None, [spec.victim, spec.lidar, spec.seed_name])  # two LiDARs draw apart
        recipe = resolved_recipe(spec, LIDAR_ATTACKS.find(spec.type))
        rng = named_generator(seed, "attack", spec.type, recipe, cloud.frame, *named)
        declared_by = detectors[spec.detector]  # in a batch, a proxy stands for it
        adapted, note = detector_for_cloud(detector, adaptation_of(spec), xyz(frame.cloud), declared_by)
        victim = with_surrogate(attack, adapted, adaptation_of(spec), xyz(frame.cloud), device)
        result = attack(frame.cloud, frame.boxes, victim, rng)
        result = replace(result, note=join_notes(note, result.note)) if note else result
        refuse_invalid(spec.type, frame.cloud, result)
        refuse_out_of_bounds(spec.type, attack, frame.cloud, result)
        return in_scan_order(frame.cloud, result)

    def attack_group(number: int) -> GroupResults:
        places = groups[number]
        attack = clouds[places[0]].attack
        detector = detectors[attacks[attack].detector]
        with fixed_torch_threads():
            if len(places) > 1 and isinstance(detector, BatchDetector):
                works = [
                    partial(attack_cloud, place, attacker(attack, member))
                    for member, place in enumerate(places)
                ]
                return [*zip(places, run_batched(detector, works), strict=True)]
            return [
                (place, attack_cloud(place, attacker(attack, 0), detector))
                for place in places
                if place not in done
            ]

    return attack_group
