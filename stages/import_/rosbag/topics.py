"""Which topics of a recording hold the clouds, the boxes, the transforms and the vehicle's pose."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import takewhile

from advpipe.pipeline.bag.frames import vehicle_topics
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.topics import SOURCE_FRAME, is_truth
from advpipe.stages.import_.rosbag.clouds import CLOUD_TYPES
from advpipe.stages.import_.rosbag.objects import BOX_READERS, MARKERS
from advpipe.stages.import_.rosbag.recording import TF_OF_ROS1, Recording, TopicContent

ODOMETRY = "nav_msgs/msg/Odometry"
_TF_TYPES = ("tf2_msgs/msg/TFMessage", TF_OF_ROS1)
_CARLA_LIDAR = re.compile(r"/carla/[^/]+/lidar")
_CARLA_OBJECTS = re.compile(r"/carla/([^/]+/)?objects")
_TRUTH = "ground_truth"


@dataclass(frozen=True)
class ChosenTopics:
    """objects, odometry: None where there are no boxes or no poses of that type.

    ignored, coverage, frame_names: of a bag of advpipe, what counts neither way, where objects are labelled,
    and what its source called the frames; None elsewhere.
    """

    points: str
    objects: str | None
    moving_tf: tuple[str, ...]
    static_tf: tuple[str, ...]
    odometry: str | None
    ignored: str | None = None
    coverage: str | None = None
    frame_names: str | None = None

    @property
    def read(self) -> tuple[str, ...]:
        """All that are read along with the clouds."""
        others = (self.objects, self.odometry, self.ignored, self.coverage)
        return (self.points, *filter(None, others), *self.moving_tf)

    @property
    def used(self) -> frozenset[str]:
        """All that an import takes something from."""
        return frozenset((*self.read, *self.static_tf, *filter(None, [self.frame_names])))

    @property
    def has_true_odometry(self) -> bool:
        """Whether the odometry is the truth, while transforms may be an estimate."""
        return self.odometry is not None and _TRUTH in self.odometry


def choose_topics(recording: Recording, points: str | None, objects: str | None) -> ChosenTopics:
    """The named topics, else those that can be guessed. Raises UsageError where a guess is not safe."""
    topics = {name: content for name, content in recording.topics.items() if content.messages}
    chosen = _points(recording, topics, points)
    tf = _of_types(topics, _TF_TYPES)
    own = vehicle_topics(chosen)
    return ChosenTopics(
        chosen,
        _objects(recording, topics, objects, chosen),
        tuple(name for name in tf if not name.endswith("tf_static")),
        tuple(name for name in tf if name.endswith("tf_static")),
        _odometry(_of_types(topics, [ODOMETRY]), chosen),
        *(_if_there(topics, topic) for topic in (own.ignored_objects, own.label_coverage, SOURCE_FRAME)),
    )


def _if_there(topics: Mapping[str, TopicContent], topic: Topic) -> str | None:
    content = topics.get(topic.name)
    return topic.name if content is not None and content.type == topic.type else None


def _of_types(topics: Mapping[str, TopicContent], types: Collection[str]) -> list[str]:
    return sorted(name for name, content in topics.items() if content.type in types)


def _odometry(found: list[str], points: str) -> str | None:
    """The truth before estimates, and the LiDAR's own vehicle's before others'."""

    def order(name: str) -> tuple[bool, int, str]:
        pairs = zip(name.split("/"), points.split("/"), strict=False)
        shared = len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))
        return _TRUTH not in name, -shared, name

    return min(found, key=order, default=None)


def _points(recording: Recording, topics: Mapping[str, TopicContent], wanted: str | None) -> str:
    found = _of_types(topics, CLOUD_TYPES)
    if not found:
        raise UsageError(f"{recording.path} holds no point clouds ({', '.join(CLOUD_TYPES)})")
    if wanted is not None:
        return _named(recording, wanted, found, "clouds")
    carla = [name for name in found if _CARLA_LIDAR.fullmatch(name)]
    if len(found) > 1 and len(carla) != 1:
        raise UsageError(
            f"{recording.path} has several topics of clouds; name one by --points: {', '.join(found)}"
        )
    return found[0] if len(found) == 1 else carla[0]


def _objects(
    recording: Recording, topics: Mapping[str, TopicContent], wanted: str | None, points: str
) -> str | None:
    if wanted is not None:
        return _named(recording, wanted, _of_types(topics, BOX_READERS), "boxes")
    found = [name for name in _of_types(topics, set(BOX_READERS) - {MARKERS}) if is_truth(name)]
    if len(found) < 2:
        return found[0] if found else None
    # CARLA's bridge sends all objects, and those around each vehicle without the vehicle itself.
    role = points.strip("/").split("/")[1:2]
    own = f"/carla/{role[0]}/objects" if role else ""
    carla = [name for name in found if _CARLA_OBJECTS.fullmatch(name)]
    if len(carla) == len(found) and points.startswith("/carla/"):
        return own if own in carla else "/carla/objects" if "/carla/objects" in carla else carla[0]
    truth = [name for name in found if _TRUTH in name]
    if len(truth) == 1:
        return truth[0]
    raise UsageError(
        f"{recording.path} has several topics of boxes; name the true ones by --objects: {', '.join(found)}"
    )


def _named(recording: Recording, wanted: str, found: list[str], what: str) -> str:
    if wanted in found:
        return wanted
    hint = suggestion(wanted, found)
    raise UsageError(
        f"{recording.path} has no {what} on {wanted}; it has {', '.join(found) or 'none'}"
        f"{'; ' if hint else ''}{hint}"
    )
