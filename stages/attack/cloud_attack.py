"""What one process does: it attacks clouds of a bag one by one, and keeps what it made of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from advpipe.pipeline.bag.cloud import POINT_DTYPE, Cloud
from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.attack.clouds import AttackedCloud
from advpipe.stages.attack.job import Job
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.parameters import build_lidar_attack, resolved_recipe


def cloud_attacker(
    clean: Path, attacks: Sequence[AttackSpec], clouds: Sequence[AttackedCloud], seed: int, job: Job
) -> Callable[[int], None]:
    """Attacks one of the clouds, named by its place in the sequence, and stores the result in the job."""
    detectors = {spec.detector: load_detector(spec.detector) for spec in attacks}
    attackers = [build_lidar_attack(spec) for spec in attacks]

    def attack_cloud(place: int) -> None:
        cloud = clouds[place]
        spec = attacks[cloud.attack]
        only = FrameSlice(cloud.frame, cloud.frame + 1)
        (frame,) = read_frames(clean, only, lidar_topic=cloud.topic)
        named = filter(None, [spec.victim, spec.lidar, spec.seed_name])  # two LiDARs draw apart
        rng = named_generator(seed, "attack", spec.type, resolved_recipe(spec), cloud.frame, *named)
        with fixed_torch_threads():
            result = attackers[cloud.attack](frame.cloud, frame.boxes, detectors[spec.detector], rng)
        _refuse_wrong(spec.type, frame.cloud, result)
        job.store(place, result)

    return attack_cloud


def _refuse_wrong(attack: str, clean: Cloud, result: LidarResult) -> None:
    """Raises AdvpipeError where what a user's attack returned is none, or its labels do not tell it."""
    if not isinstance(result, LidarResult):
        raise AdvpipeError(f"{attack} returned {type(result).__name__}, no LidarResult")
    if result.cloud.dtype != POINT_DTYPE or result.cloud.ndim != 1:
        raise AdvpipeError(f"{attack} returned no cloud of the fields {', '.join(POINT_DTYPE.names or ())}")
    actions = result.labels.action
    removed, added = int((actions == "removed").sum()), int((actions == "added").sum())
    if len(result.cloud) != len(clean) - removed + added:
        raise AdvpipeError(
            f"{attack} made {len(clean)} points {len(result.cloud)}, but labels {removed} as removed and "
            f"{added} as added"
        )
