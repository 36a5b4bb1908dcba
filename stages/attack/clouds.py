"""The clouds of a bag that are attacked, and the attack on each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import FrameSlice, find_lidar_topic, refuse_without_ground_truth
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.recording import RecordedTimes


@dataclass(frozen=True)
class AttackedCloud:
    """A cloud, by its topic and its index there in the clean bag, and the attack on it by its place."""

    topic: str
    frame: int
    attack: int


@dataclass(frozen=True)
class CloudPlan:
    """The clouds that the adversarial bag holds, by topic and index, and those that are attacked.

    frames: those of the first attack's topic. times_ns: log times of all clouds of that topic.
    """

    topics: tuple[str, ...]
    frames: range
    times_ns: npt.NDArray[np.int64]
    attacked: tuple[AttackedCloud, ...]

    def keeps(self, topic: str, frame: int | None, log_time_ns: int) -> bool:
        """Whether a message belongs to a frame that is kept: to the latest cloud at or before it.

        frame: which cloud of its topic it is, if it is one. What comes before the first cloud belongs to
        that one.
        """
        if len(self.frames) == len(self.times_ns):
            return True
        if topic == self.topics[0]:
            return frame in self.frames
        cloud = int(np.searchsorted(self.times_ns, log_time_ns, side="right")) - 1
        return max(cloud, 0) in self.frames


def plan_clouds(
    reader: BagReader, attacks: Sequence[AttackSpec], frames: FrameSlice, recording: RecordedTimes, seed: int
) -> CloudPlan:
    """The clouds that each attack changes; at most one attack for each cloud.

    Raises AdvpipeError for a bag without the clouds or the ground truth that an attack needs, frames that it
    does not have, a schedule that meets none, and two attacks on the same clouds at the same time.
    """
    topics = [topic_of(reader, spec) for spec in attacks]
    for (topic, spec), (other_topic, other) in combinations(zip(topics, attacks, strict=True), 2):
        if topic == other_topic and spec.schedule.overlaps(other.schedule):
            raise UsageError(
                f"{spec.type} and {other.type} attack the same clouds of {topic} at the same time; "
                "give them schedules that do not overlap"
            )
    for topic, spec in zip(topics, attacks, strict=True):
        if build_lidar_attack(spec).needs_ground_truth:
            refuse_without_ground_truth(reader.path, topic, fix=_without_truth(spec))
    times_ns = reader.log_times_ns(topics[0])
    if not len(times_ns):
        raise UsageError(f"{reader.path} holds no LiDAR clouds ({topics[0]} is empty)")
    plan = CloudPlan(tuple(dict.fromkeys(topics)), frames.indices(len(times_ns)), times_ns, ())
    attacked: list[AttackedCloud] = []
    for place, (topic, spec) in enumerate(zip(topics, attacks, strict=True)):
        active = [
            AttackedCloud(topic, frame, place)
            for frame, log_time_ns in enumerate(reader.log_times_ns(topic).tolist())
            if plan.keeps(topic, frame, log_time_ns)
            and is_active(spec, frame, recording.time_s(log_time_ns), seed)
        ]
        if not active:
            raise UsageError(f"{spec.type}: {_no_cloud(reader, plan, topic, spec, recording)}")
        attacked += active
    return CloudPlan(plan.topics, plan.frames, times_ns, tuple(attacked))


def _without_truth(spec: AttackSpec) -> str:
    """What to do where the ground truth is missing that an attack needs."""
    random = ", or take the recipe random, which picks points anywhere" if spec.type in LIDAR_ATTACKS else ""
    return f"{spec.type} attacks the objects in it: give a bag that holds it{random}"


def _no_cloud(
    reader: BagReader, plan: CloudPlan, topic: str, spec: AttackSpec, recording: RecordedTimes
) -> str:
    """Why no cloud is attacked, and what to do."""
    times_s = [
        recording.time_s(time_ns)
        for frame, time_ns in enumerate(reader.log_times_ns(topic).tolist())
        if plan.keeps(topic, frame, time_ns)
    ]
    until = "" if spec.schedule.to_s is None else f" to {spec.schedule.to_s:g} s"
    clouds = f"; those are at {times_s[0]:g} to {times_s[-1]:g} s" if times_s else ""
    return (
        f"its schedule, from {spec.schedule.from_s:g} s{until}, meets none of the {len(times_s)} chosen "
        f"clouds of {topic}{clouds}: choose other frames or other times"
    )


def is_active(spec: AttackSpec, frame: int, time_s: float, seed: int) -> bool:
    """Whether the attack's schedule includes a cloud; a random schedule draws for each cloud of the bag."""
    rng = named_generator(seed, "attack", "schedule", spec.type, spec.seed_name, frame)
    return spec.schedule.active(time_s, rng)


def topic_of(reader: BagReader, spec: AttackSpec) -> str:
    """The topic of the clouds that an attack changes. Raises AdvpipeError if the bag has none or several."""
    if spec.lidar is not None or spec.victim is None:
        return find_lidar_topic(reader, spec.lidar)
    own = [name for name in lidar_topics(reader) if name.startswith(f"/{spec.victim}/")]
    if not own:
        known = sorted({name.split("/")[1] for name in lidar_topics(reader) if name.count("/") > 1})
        raise UsageError(
            f"{spec.type}: {reader.path} has no clouds of the victim {spec.victim!r}; "
            f"{known_names(spec.victim, known, 'vehicles with clouds')}"
        )
    default = VehicleTopics(spec.victim).lidar_points.name
    if len(own) > 1 and default not in own:
        raise UsageError(f"{spec.type}: {spec.victim} has several LiDARs; name one: {', '.join(own)}")
    return default if default in own else own[0]
