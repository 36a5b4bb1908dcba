"""The occlusion of each road user, where a bag holds it: advpipe's own bags do."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.build import stamp_ns as header_stamp_ns
from advpipe.pipeline.messages.topics import VehicleTopics


class Occlusion:
    """Looks up `advpipe_msgs/RoadUser.occlusion` of the vehicle that carries a LiDAR."""

    def __init__(self, reader: BagReader, lidar_topic: str) -> None:
        topic = vehicle_of(lidar_topic).road_users
        info = reader.topics.get(topic.name)
        self._reader = reader
        self._topic = topic.name if info is not None and info.type == topic.type else None

    def at(self, stamp_ns: int) -> Mapping[str, float]:
        """The occlusion in [0, 1] of the road users, by id, at the stamp of a cloud; empty where unknown."""
        if self._topic is None:
            return {}
        for raw in self._reader.raw_messages([self._topic], stamp_ns, stamp_ns):
            message = self._reader.decode(raw)
            if header_stamp_ns(message) == stamp_ns:
                # Bags of the first version lack the field.
                return {user.id: getattr(user, "occlusion", float("nan")) for user in message.road_users}
        return {}


def vehicle_of(lidar_topic: str) -> VehicleTopics:
    """The vehicle under whose name a LiDAR's clouds lie: `/ego/lidar/points` is ego's."""
    return VehicleTopics(*lidar_topic.strip("/").split("/")[:2])
