"""What the layouts of viewers show of a bag: topics, and the frames from which to look at them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from advpipe.pipeline.bag.carried import CLOUD_TYPE, lidar_topics, sensors_by_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import TopicInfo
from advpipe.pipeline.mcap.qos import is_latched
from advpipe.pipeline.messages.debug import is_debug
from advpipe.pipeline.messages.topics import MAP_FRAME, TF, TF_STATIC, VehicleTopics, is_truth
from advpipe.pipeline.sensors.lidar.lidars import CLOUD_PANEL
from advpipe.pipeline.sensors.sensor import Panel

TOUCHED_PANEL = Panel(
    foxglove={"colorMode": "rgb", "colorField": "rgb", "pointSize": 5},
    rviz="PointCloud2",
    rviz_keys={"Style": "Points", "Size (Pixels)": 5, "Color Transformer": "RGB8"},
)
"""The panel of touched points (`messages.debug`), in the colours of what was done to them."""

_TRANSFORM_MESSAGES = 100  # of each topic: they repeat


@dataclass(frozen=True)
class ViewedTopic:
    """One topic of a layout. is_latched: whether late subscribers get the last message."""

    name: str
    is_latched: bool


@dataclass(frozen=True)
class ViewerScene:
    """A bag as a layout shows it.

    panels: topics of sensors and of touched points, each with its panel. markers: topics of markers.
    odometry: on-board estimates. speed: the topic of the ego's true odometry, truth: that of true boxes, both
    None without one. ego_frame, root_frame: the frame that a viewer follows, and the one in which it draws.
    """

    panels: Sequence[tuple[ViewedTopic, Panel]]
    markers: Sequence[ViewedTopic]
    odometry: Sequence[ViewedTopic]
    speed: str | None
    truth: str | None
    ego_frame: str
    root_frame: str


def viewer_scene(reader: BagReader) -> ViewerScene:
    """The scene of a bag; for one with its debug topics, give a reader that has them."""
    topics = {name: info for name, info in sorted(reader.topics.items()) if info.count}
    viewed = {name: ViewedTopic(name, is_latched(info.qos)) for name, info in topics.items()}
    vehicles = _vehicles(topics, lidar_topics(reader))
    ego = VehicleTopics(vehicles[0]) if vehicles else VehicleTopics()
    pairs = _transforms(reader)
    roots = sorted({parent for parent, _ in pairs} - {child for _, child in pairs})
    root_frame = roots[0] if len(roots) == 1 else MAP_FRAME
    odometry = [VehicleTopics(name).odometry.name for name in vehicles]
    truths = [n for n, i in topics.items() if i.type.endswith("/Detection3DArray") and is_truth(n)]
    return ViewerScene(
        panels=[(viewed[name], panel) for name, panel in _panels(reader) if name in viewed],
        markers=[viewed[name] for name, info in topics.items() if info.type.endswith("/MarkerArray")],
        odometry=[viewed[name] for name in odometry if name in viewed],
        speed=ego.true_odometry.name if ego.true_odometry.name in topics else None,
        truth=truths[0] if truths else None,
        ego_frame=ego.base_frame if any(ego.base_frame in pair for pair in pairs) else root_frame,
        root_frame=root_frame,
    )


def _panels(reader: BagReader) -> list[tuple[str, Panel]]:
    sensors = sensors_by_topic(reader)
    if sensors is None:
        found = [(name, CLOUD_PANEL) for name in lidar_topics(reader)]
    else:
        panels = ((name, sensor.panel(name)) for name, sensor in sorted(sensors.items()))
        found = [(name, panel) for name, panel in panels if panel is not None]
    return found + [(name, TOUCHED_PANEL) for name in reader.topics_of_type(CLOUD_TYPE) if is_debug(name)]


def _vehicles(topics: Mapping[str, TopicInfo], lidars: Sequence[str]) -> list[str]:
    """The namespaces with clouds or true odometry, the ego first."""
    found = {name.split("/")[1] for name in lidars if name.count("/") > 1 and name in topics}
    found |= {name.split("/")[1] for name in topics if name.endswith("/ground_truth/odometry")}
    return sorted(found, key=lambda name: (name != VehicleTopics().vehicle, name))


def _transforms(reader: BagReader) -> set[tuple[str, str]]:
    """Parent and child frames."""
    return {
        (transform.header.frame_id, transform.child_frame_id)
        for topic in (TF_STATIC.name, TF.name)
        if topic in reader.topics
        for _, message in islice(reader.messages(topic), _TRANSFORM_MESSAGES)
        for transform in message.transforms
    }
