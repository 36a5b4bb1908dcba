"""What one process does: it attacks clouds of a bag one by one, and keeps what it made of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.attack.clouds import AttackedCloud
from advpipe.stages.attack.job import Job
from advpipe.stages.attack.lidar.refusal import refuse_wrong
from advpipe.stages.attack.parameters import build_lidar_attack, resolved_recipe


def cloud_attacker(
    clean: Path,
    attacks: Sequence[AttackSpec],
    clouds: Sequence[AttackedCloud],
    seed: int,
    job: Job,
    device: str = CPU,
) -> Callable[[int], None]:
    """Attacks one of the clouds, named by its place in the sequence, and stores the result in the job.

    Several processes may share a GPU: each is started anew and has a CUDA context of its own.
    """
    detectors = {spec.detector: load_detector(spec.detector, device) for spec in attacks}
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
        refuse_wrong(spec.type, frame.cloud, result)
        job.store(place, result)

    return attack_cloud
