"""The topics of a bag: name, message type and offered quality of service."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import yaml
from pydantic import Field, TypeAdapter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from advpipe.pipeline.bag import plain_yaml
from advpipe.pipeline.bag.document import Count, Document, Word
from advpipe.pipeline.errors import one_line

_FOREVER = QosTime(9223372036, 854775807)


def _keep_last(depth: int, *, reliable: bool = True, latched: bool = False) -> tuple[Qos, ...]:
    return (
        Qos(
            history=QosHistory.KEEP_LAST,
            depth=depth,
            reliability=QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
            durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
            deadline=_FOREVER,
            lifespan=_FOREVER,
            liveliness=QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=_FOREVER,
            avoid_ros_namespace_conventions=False,
        ),
    )


@dataclass(frozen=True)
class Topic:
    """One channel of a bag.

    qos: the profiles offered by its publishers; rosbag2 republishes with them.
    type_hash: RIHS01 hash of the type where another tool's bag states it; "" for a type of `types.py`.
    """

    name: str
    type: str
    qos: tuple[Qos, ...] = _keep_last(10)
    type_hash: str = ""


CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", _keep_last(1, reliable=False))
TF = Topic("/tf", "tf2_msgs/msg/TFMessage", _keep_last(100))
TF_STATIC = Topic("/tf_static", "tf2_msgs/msg/TFMessage", _keep_last(1, latched=True))
SCENARIO_INFO = Topic("/scenario/info", "std_msgs/msg/String", _keep_last(1, latched=True))
LANES = Topic("/map/lanes", "visualization_msgs/msg/MarkerArray", _keep_last(1, latched=True))
V2X_STATIONS = Topic("/v2x/stations", "advpipe_msgs/msg/V2xStationArray", _keep_last(10))
V2X_SENT = Topic("/v2x/sent", "advpipe_msgs/msg/V2xTransmission", _keep_last(100))
V2X_BUILDINGS = Topic("/v2x/buildings", "std_msgs/msg/String", _keep_last(1, latched=True))
V2X_STATISTICS = Topic("/v2x/statistics", "std_msgs/msg/String", _keep_last(1, latched=True))


LDM_OBJECTS = "ldm/objects"


def is_truth(topic_name: str) -> bool:
    """Whether boxes on a topic may be the truth; what a vehicle was told by radio is none."""
    return not topic_name.endswith(f"/{LDM_OBJECTS}")


@dataclass(frozen=True)
class VehicleTopics:
    """The topics and frames of one instrumented vehicle and one of its LiDARs, under its own namespace.

    >>> VehicleTopics("ego").lidar_points.name
    '/ego/lidar/points'
    """

    vehicle: str = "ego"
    lidar: str = "lidar"

    @property
    def base_frame(self) -> str:
        return f"{self.vehicle}/base_link"

    @property
    def lidar_frame(self) -> str:
        return f"{self.vehicle}/{self.lidar}"

    @property
    def imu_frame(self) -> str:
        return f"{self.vehicle}/imu"

    @property
    def odom_frame(self) -> str:
        """Where the wheels' odometry starts."""
        return f"{self.vehicle}/odom"

    @property
    def lidar_points(self) -> Topic:
        return Topic(f"/{self.vehicle}/{self.lidar}/points", "sensor_msgs/msg/PointCloud2", _keep_last(5))

    @property
    def objects(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/objects", "vision_msgs/msg/Detection3DArray")

    @property
    def road_users(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/road_users", "advpipe_msgs/msg/RoadUserArray")

    @property
    def true_odometry(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/odometry", "nav_msgs/msg/Odometry")

    @property
    def odometry(self) -> Topic:
        """The on-board estimate."""
        return Topic(f"/{self.vehicle}/odometry", "nav_msgs/msg/Odometry")

    @property
    def initial_pose(self) -> Topic:
        """What the on-board estimate starts from."""
        return Topic(
            f"/{self.vehicle}/initialpose",
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            _keep_last(1, latched=True),
        )

    @property
    def wheel_odometry(self) -> Topic:
        return Topic(f"/{self.vehicle}/wheel/odometry", "nav_msgs/msg/Odometry")

    @property
    def imu(self) -> Topic:
        return Topic(f"/{self.vehicle}/imu", "sensor_msgs/msg/Imu", _keep_last(100))

    @property
    def sent_raw(self) -> Topic:
        """What it sends: the bytes of its CAMs."""
        return Topic(f"/{self.vehicle}/v2x/tx/raw", "udp_msgs/msg/UdpPacket", _keep_last(100))

    @property
    def sent_cam(self) -> Topic:
        return Topic(f"/{self.vehicle}/v2x/tx/cam", "etsi_its_cam_msgs/msg/CAM", _keep_last(100))

    @property
    def received_raw(self) -> Topic:
        """What it receives: the bytes, also of what turns out to be no CAM."""
        return Topic(f"/{self.vehicle}/v2x/rx/raw", "udp_msgs/msg/UdpPacket", _keep_last(100))

    @property
    def received_cam(self) -> Topic:
        return Topic(f"/{self.vehicle}/v2x/rx/cam", "etsi_its_cam_msgs/msg/CAM", _keep_last(100))

    @property
    def ldm(self) -> Topic:
        return Topic(f"/{self.vehicle}/ldm", "advpipe_msgs/msg/LdmSnapshot")

    @property
    def ldm_objects(self) -> Topic:
        return Topic(f"/{self.vehicle}/{LDM_OBJECTS}", "vision_msgs/msg/Detection3DArray")

    @property
    def gnss_fix(self) -> Topic:
        return Topic(f"/{self.vehicle}/gnss/fix", "sensor_msgs/msg/NavSatFix")

    @property
    def markers(self) -> Topic:
        return Topic(f"/{self.vehicle}/markers", "visualization_msgs/msg/MarkerArray")


@dataclass(frozen=True)
class TopicInfo:
    """What a bag says about one of its topics."""

    type: str
    qos: tuple[Qos, ...]
    count: int


@dataclass(frozen=True)
class RawMessage:
    """One message as it lies in a bag: `cdr` is its serialised body, `schema` its type's definition."""

    topic: Topic
    schema: str
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    schema_encoding: str = "ros2msg"


class _Time(Document):
    sec: Count
    nsec: Count


class _Profile(Document):
    """As rosbag2 writes one; enumerations by number or name."""

    history: Count | Word
    depth: Count
    reliability: Count | Word
    durability: Count | Word
    deadline: _Time
    lifespan: _Time
    liveliness: Count | Word
    liveliness_lease_duration: _Time
    avoid_ros_namespace_conventions: bool


_PROFILES = TypeAdapter(Annotated[list[_Profile], Field(max_length=1000)] | None)


def qos_to_yaml(profiles: tuple[Qos, ...]) -> str:
    """The profiles on one line, enumerations as numbers: what every rosbag2 since Foxy reads."""
    plain = [
        {
            "history": qos.history.value,
            "depth": qos.depth,
            "reliability": qos.reliability.value,
            "durability": qos.durability.value,
            "deadline": qos.deadline._asdict(),
            "lifespan": qos.lifespan._asdict(),
            "liveliness": qos.liveliness.value,
            "liveliness_lease_duration": qos.liveliness_lease_duration._asdict(),
            "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
        }
        for qos in profiles
    ]
    return yaml.safe_dump(plain, default_flow_style=True, sort_keys=False, width=10**9).strip()


def qos_from_yaml(text: str) -> tuple[Qos, ...]:
    """The profiles in a channel's metadata, with numbers (to Iron) or names (from Jazzy).

    Raises ValueError for a text that is none.
    """
    try:
        profiles = _PROFILES.validate_python(plain_yaml.load(text)) or ()
        return tuple(parse_qos([profile.model_dump() for profile in profiles]))  # type: ignore[misc]
    except (yaml.YAMLError, ValueError, ReaderError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"offered_qos_profiles: {one_line(error)[:200]}") from None
