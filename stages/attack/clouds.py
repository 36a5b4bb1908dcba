"""Which clouds of a bag are attacked, and by what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import FrameSlice, find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
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
        if topic == self.topics[0]:
            return frame in self.frames
        cloud = int(np.searchsorted(self.times_ns, log_time_ns, side="right")) - 1
        return max(cloud, 0) in self.frames


def plan_clouds(
    reader: BagReader, attacks: Sequence[AttackSpec], frames: FrameSlice, recording: RecordedTimes, seed: int
) -> CloudPlan:
    """Who attacks which clouds; at most one attack for each.

    Raises AdvpipeError for a bag without the clouds, frames that it does not have, a schedule that meets
    none, and two attacks on the same clouds at the same time.
    """
    topics = [topic_of(reader, spec) for spec in attacks]
    for (topic, spec), (other_topic, other) in combinations(zip(topics, attacks, strict=True), 2):
        if topic == other_topic and spec.schedule.overlaps(other.schedule):
            raise UsageError(
                f"{spec.type} and {other.type} attack the same clouds of {topic} at the same time; "
                "give them schedules that do not overlap"
            )
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
            raise UsageError(f"{spec.type}: its schedule meets none of the chosen clouds of {topic}")
        attacked += active
    return CloudPlan(plan.topics, plan.frames, times_ns, tuple(attacked))


def is_active(spec: AttackSpec, frame: int, time_s: float, seed: int) -> bool:
    """Whether the attack's schedule includes a cloud; a random one draws for each cloud, chosen or not."""
    rng = named_generator(seed, "attack", "schedule", spec.type, spec.seed_name, frame)
    return spec.schedule.active(time_s, rng)


def topic_of(reader: BagReader, spec: AttackSpec) -> str:
    """The topic of the clouds that it attacks; raises AdvpipeError where the bag has none or several."""
    if spec.lidar is not None or spec.victim is None:
        return find_lidar_topic(reader, spec.lidar)
    own = [name for name in lidar_topics(reader) if name.startswith(f"/{spec.victim}/")]
    if not own:
        raise UsageError(f"{spec.type}: {reader.path} has no clouds of the victim {spec.victim!r}")
    default = VehicleTopics(spec.victim).lidar_points.name
    if len(own) > 1 and default not in own:
        raise UsageError(f"{spec.type}: {spec.victim} has several LiDARs; name one: {', '.join(own)}")
    return default if default in own else own[0]
