"""The topics that an investigation may read: what the vehicle had on board, and nothing else.

Truth, labels, provenance, the scenario, and what radios truly sent are not among them, and an investigation
reads no topic that is not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.messages.topics import LANES, TF, TF_STATIC, VehicleTopics


class EvidenceKind(Enum):
    """What a topic tells; the value names it for people."""

    CLOUDS = "LiDAR clouds"
    FIXES = "GNSS fixes"
    WHEELS = "wheel odometry"
    IMU = "an IMU"
    ESTIMATE = "the vehicle's own pose"
    INITIAL_POSE = "an initial pose"
    MESSAGES = "received V2X messages"
    RECEPTIONS = "power of received messages"
    TRANSFORMS = "transforms"
    MOUNTS = "mounts of sensors"
    LANES = "lanes"


_TYPES: Mapping[EvidenceKind, str] = {
    EvidenceKind.CLOUDS: "sensor_msgs/msg/PointCloud2",
    EvidenceKind.FIXES: "sensor_msgs/msg/NavSatFix",
    EvidenceKind.WHEELS: "nav_msgs/msg/Odometry",
    EvidenceKind.IMU: "sensor_msgs/msg/Imu",
    EvidenceKind.ESTIMATE: "nav_msgs/msg/Odometry",
    EvidenceKind.INITIAL_POSE: "geometry_msgs/msg/PoseWithCovarianceStamped",
    EvidenceKind.MESSAGES: "udp_msgs/msg/UdpPacket",
    EvidenceKind.RECEPTIONS: "advpipe_msgs/msg/V2xReceptionInfo",
    EvidenceKind.TRANSFORMS: "tf2_msgs/msg/TFMessage",
    EvidenceKind.MOUNTS: "tf2_msgs/msg/TFMessage",
    EvidenceKind.LANES: "visualization_msgs/msg/MarkerArray",
}

_FOREIGN = (EvidenceKind.CLOUDS, EvidenceKind.FIXES, EvidenceKind.IMU)
"""Told by their types alone where another tool's names are not ours, and there is one topic of the type."""

_NOT_SENSED = ("ground_truth", "debug", "radar")


@dataclass(frozen=True)
class EvidenceTopics:
    """The topics of one vehicle that may be read, and what each tells. vehicle: "" for an unnamed one."""

    vehicle: str
    kinds: Mapping[str, EvidenceKind]

    def has(self, kind: EvidenceKind) -> bool:
        """Whether the bag has such a topic."""
        return kind in self.kinds.values()

    def of(self, kind: EvidenceKind) -> list[str]:
        """The topics of a kind, sorted."""
        return sorted(name for name, found in self.kinds.items() if found is kind)


def vehicles_with_evidence(reader: BagReader) -> list[str]:
    """The vehicles of which a bag holds sensors' data or received messages, sorted."""
    found = set()
    for name, info in reader.topics.items():
        vehicle = name.strip("/").partition("/")[0]
        wanted = _topics_of(vehicle)
        if (info.count and wanted.get(name, (None,))[0] in _JUDGED) or _is_lidar(reader, name, vehicle):
            found.add(vehicle)
    return sorted(found)


_JUDGED = (EvidenceKind.FIXES, EvidenceKind.MESSAGES)


def find_evidence(reader: BagReader, vehicle: str | None = None) -> EvidenceTopics:
    """The topics of a vehicle: the named one, `ego`, or the only one; of another tool's bag, by their types.

    Raises UsageError for an unknown vehicle, for several without a name, and for a bag without anything that
    could be judged.
    """
    known = vehicles_with_evidence(reader)
    if vehicle is not None and vehicle not in known:
        raise UsageError(f"{reader.path} has no vehicle {vehicle!r}; {known_names(vehicle, known, 'it has')}")
    if vehicle is None:
        if len(known) > 1 and "ego" not in known:
            raise UsageError(f"{reader.path} has several vehicles: {', '.join(known)}; name one")
        vehicle = "ego" if "ego" in known else next(iter(known), "")
    kinds = _own_topics(reader, vehicle) if vehicle else {}
    kinds |= _foreign_topics(reader, kinds)
    if not set(kinds.values()) & {EvidenceKind.CLOUDS, *_JUDGED}:
        raise UsageError(
            f"{reader.path} has nothing to judge: neither LiDAR clouds, nor GNSS fixes, nor received messages"
        )
    return EvidenceTopics(vehicle, kinds)


def _topics_of(vehicle: str) -> dict[str, tuple[EvidenceKind, str]]:
    topics = VehicleTopics(vehicle)
    named = {
        EvidenceKind.FIXES: topics.gnss_fix,
        EvidenceKind.WHEELS: topics.wheel_odometry,
        EvidenceKind.IMU: topics.imu,
        EvidenceKind.ESTIMATE: topics.odometry,
        EvidenceKind.INITIAL_POSE: topics.initial_pose,
        EvidenceKind.MESSAGES: topics.received_raw,
        EvidenceKind.RECEPTIONS: topics.reception_info,
        EvidenceKind.TRANSFORMS: TF,
        EvidenceKind.MOUNTS: TF_STATIC,
        EvidenceKind.LANES: LANES,
    }
    return {topic.name: (kind, topic.type) for kind, topic in named.items()}


def _own_topics(reader: BagReader, vehicle: str) -> dict[str, EvidenceKind]:
    wanted = _topics_of(vehicle)
    found = {
        name: wanted[name][0]
        for name, info in reader.topics.items()
        if info.count and name in wanted and info.type == wanted[name][1]
    }
    clouds = [name for name in reader.topics if _is_lidar(reader, name, vehicle)]
    return found | dict.fromkeys(clouds, EvidenceKind.CLOUDS)


def _is_lidar(reader: BagReader, name: str, vehicle: str) -> bool:
    """Whether a topic is `/VEHICLE/SENSOR/points` of a LiDAR: radars have a scan beside their points."""
    parts = name.strip("/").split("/")
    if len(parts) != 3 or parts[0] != vehicle or parts[2] != "points":
        return False
    info, scan = reader.topics[name], VehicleTopics(vehicle).radar_scan(parts[1]).name
    return info.type == _TYPES[EvidenceKind.CLOUDS] and info.count > 0 and scan not in reader.topics


def _foreign_topics(reader: BagReader, known: Mapping[str, EvidenceKind]) -> dict[str, EvidenceKind]:
    """What the types of another tool's topics tell, of kinds of which our names told none."""
    found = {}
    for kind in _FOREIGN:
        names = [
            name
            for name in reader.topics_of_type(_TYPES[kind])
            if reader.topics[name].count and not any(part in name for part in _NOT_SENSED)
        ]
        if kind not in known.values() and len(names) == 1 and not known:
            found[names[0]] = kind
    if found:
        for topic, kind in ((TF, EvidenceKind.TRANSFORMS), (TF_STATIC, EvidenceKind.MOUNTS)):
            if (info := reader.topics.get(topic.name)) is not None and info.type == topic.type:
                found[topic.name] = kind
    return found
