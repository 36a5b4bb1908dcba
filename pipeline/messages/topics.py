"""The topics of advpipe's bags: name, message type and offered quality of service."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.v2x.message_type import CAM, MessageType

MAP_FRAME = "map"

CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", keep_last(1, reliable=False))
TF = Topic("/tf", "tf2_msgs/msg/TFMessage", keep_last(100))
TF_STATIC = Topic("/tf_static", "tf2_msgs/msg/TFMessage", keep_last(1, latched=True))
SCENARIO_INFO = Topic("/scenario/info", "std_msgs/msg/String", keep_last(1, latched=True))
SOURCE_FRAME = Topic("/source/frame", "std_msgs/msg/String")
"""The name that an imported drive's source gives a frame, recorded at the time of its clouds."""
LANES = Topic("/map/lanes", "visualization_msgs/msg/MarkerArray", keep_last(1, latched=True))
V2X_STATIONS = Topic("/v2x/stations", "advpipe_msgs/msg/V2xStationArray", keep_last(10))
V2X_SENT = Topic("/v2x/sent", "advpipe_msgs/msg/V2xTransmission", keep_last(100))
V2X_PACKETS = Topic("/v2x/packets", "advpipe_msgs/msg/V2xPacket", keep_last(100))
V2X_PSEUDONYMS = Topic("/v2x/pseudonyms", "advpipe_msgs/msg/V2xPseudonym", keep_last(100))
"""Which station took which pseudonym; this is ground truth, which no vehicle knows."""
V2X_BUILDINGS = Topic("/v2x/buildings", "std_msgs/msg/String", keep_last(1, latched=True))
BEACONS = Topic("/log/beacons", "advpipe_msgs/msg/BeaconLog", keep_last(100))
"""The records of an imported log of beacons, as the log has them."""
V2X_STATISTICS = Topic("/v2x/statistics", "std_msgs/msg/String", keep_last(1, latched=True))


LDM_OBJECTS = "ldm/objects"
IGNORED_OBJECTS = "ground_truth/ignored_objects"


def is_truth(topic_name: str) -> bool:
    """Whether boxes on a topic may be the ground truth that counts; the objects of a Local Dynamic Map and
    those to be ignored are not."""
    return not topic_name.endswith((f"/{LDM_OBJECTS}", f"/{IGNORED_OBJECTS}"))


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
        return self.sensor_frame(self.lidar)

    def sensor_frame(self, name: str) -> str:
        """The frame of one of its mounted sensors."""
        return f"{self.vehicle}/{name}"

    @property
    def imu_frame(self) -> str:
        return f"{self.vehicle}/imu"

    @property
    def odom_frame(self) -> str:
        """The frame in which wheel odometry starts."""
        return f"{self.vehicle}/odom"

    @property
    def lidar_points(self) -> Topic:
        return Topic(f"/{self.vehicle}/{self.lidar}/points", "sensor_msgs/msg/PointCloud2", keep_last(5))

    @property
    def semantic_points(self) -> Topic:
        """What the rays of a LiDAR hit, as CARLA's semantic LiDAR tells it."""
        name = f"/{self.vehicle}/ground_truth/{self.lidar}/semantic_points"
        return Topic(name, "sensor_msgs/msg/PointCloud2", keep_last(5))

    @property
    def objects(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/objects", "vision_msgs/msg/Detection3DArray")

    @property
    def road_users(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/road_users", "advpipe_msgs/msg/RoadUserArray")

    @property
    def ignored_objects(self) -> Topic:
        """Labelled objects that count neither way, with the source's names of their classes."""
        return Topic(f"/{self.vehicle}/{IGNORED_OBJECTS}", "vision_msgs/msg/Detection3DArray")

    @property
    def label_coverage(self) -> Topic:
        """Where the source has labelled objects."""
        return Topic(f"/{self.vehicle}/ground_truth/label_coverage", "advpipe_msgs/msg/LabelCoverage")

    def camera_info(self, camera: str) -> Topic:
        """A camera's calibration."""
        return Topic(f"/{self.vehicle}/{camera}/camera_info", "sensor_msgs/msg/CameraInfo")

    def camera_image(self, camera: str, kind: str) -> Topic:
        """A camera's images of one kind; rgb is its main image, beside `camera_info`."""
        base = "image" if kind == "rgb" else kind
        return Topic(
            f"/{self.vehicle}/{camera}/{base}/compressed", "sensor_msgs/msg/CompressedImage", keep_last(5)
        )

    def visible_boxes(self, camera: str) -> Topic:
        """The 2D boxes of what is visible of each object in a camera's images."""
        return Topic(
            f"/{self.vehicle}/ground_truth/{camera}/visible_boxes", "vision_msgs/msg/Detection2DArray"
        )

    def amodal_boxes(self, camera: str) -> Topic:
        """The 2D boxes of whole objects in a camera's images, hidden parts included."""
        return Topic(
            f"/{self.vehicle}/ground_truth/{camera}/amodal_boxes", "vision_msgs/msg/Detection2DArray"
        )

    def instance_names(self, camera: str) -> Topic:
        """The road users' names of the ids in a camera's instance segmentation."""
        return Topic(f"/{self.vehicle}/ground_truth/{camera}/instances", "vision_msgs/msg/LabelInfo")

    def image_labels(self, camera: str) -> Topic:
        """What the source has labelled in a camera's images."""
        return Topic(f"/{self.vehicle}/ground_truth/{camera}/labels", "advpipe_msgs/msg/ImageLabelArray")

    def radar_scan(self, radar: str) -> Topic:
        """The detections of a radar."""
        return Topic(f"/{self.vehicle}/{radar}/scan", "radar_msgs/msg/RadarScan", keep_last(5))

    def radar_points(self, radar: str) -> Topic:
        """The same as points with velocity and RCS, for viewers."""
        return Topic(f"/{self.vehicle}/{radar}/points", "sensor_msgs/msg/PointCloud2", keep_last(5))

    @property
    def true_odometry(self) -> Topic:
        return Topic(f"/{self.vehicle}/ground_truth/odometry", "nav_msgs/msg/Odometry")

    @property
    def odometry(self) -> Topic:
        """The pose estimated on board."""
        return Topic(f"/{self.vehicle}/odometry", "nav_msgs/msg/Odometry")

    @property
    def initial_pose(self) -> Topic:
        """The initial pose of the on-board estimate."""
        return Topic(
            f"/{self.vehicle}/initialpose",
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            keep_last(1, latched=True),
        )

    @property
    def wheel_odometry(self) -> Topic:
        return Topic(f"/{self.vehicle}/wheel/odometry", "nav_msgs/msg/Odometry")

    @property
    def imu(self) -> Topic:
        return Topic(f"/{self.vehicle}/imu", "sensor_msgs/msg/Imu", keep_last(100))

    @property
    def sent_raw(self) -> Topic:
        """The messages that it sends, as bytes."""
        return Topic(f"/{self.vehicle}/v2x/tx/raw", "udp_msgs/msg/UdpPacket", keep_last(100))

    @property
    def sent_cam(self) -> Topic:
        return self.sent_values(CAM)

    def sent_values(self, message: MessageType) -> Topic:
        """The values of the messages of a type that it sends."""
        return Topic(f"/{self.vehicle}/v2x/tx/{message.name}", message.ros_name, keep_last(100))

    @property
    def received_raw(self) -> Topic:
        """The messages that it receives, as bytes, including those that are not valid."""
        return Topic(f"/{self.vehicle}/v2x/rx/raw", "udp_msgs/msg/UdpPacket", keep_last(100))

    @property
    def received_cam(self) -> Topic:
        return self.received_values(CAM)

    def received_values(self, message: MessageType) -> Topic:
        """The values of the messages of a type that it receives."""
        return Topic(f"/{self.vehicle}/v2x/rx/{message.name}", message.ros_name, keep_last(100))

    @property
    def reception_info(self) -> Topic:
        """Power and SINR of each received message, as its radio measures them."""
        return Topic(f"/{self.vehicle}/v2x/rx/info", "advpipe_msgs/msg/V2xReceptionInfo", keep_last(100))

    @property
    def true_receptions(self) -> Topic:
        """Which sent message each received message truly is; this is ground truth, which no vehicle knows."""
        return Topic(
            f"/{self.vehicle}/ground_truth/receptions", "advpipe_msgs/msg/V2xReception", keep_last(100)
        )

    @property
    def rejections(self) -> Topic:
        """The messages that reached its radio, but not its facilities, as security rejected them."""
        return Topic(
            f"/{self.vehicle}/ground_truth/rejections", "advpipe_msgs/msg/V2xRejection", keep_last(100)
        )

    @property
    def ldm(self) -> Topic:
        return Topic(f"/{self.vehicle}/ldm", "advpipe_msgs/msg/LdmSnapshot")

    @property
    def ldm_objects(self) -> Topic:
        return Topic(f"/{self.vehicle}/{LDM_OBJECTS}", "vision_msgs/msg/Detection3DArray")

    @property
    def heard_objects(self) -> Topic:
        """The objects of the Local Dynamic Map that other stations report."""
        return Topic(f"/{self.vehicle}/ldm/heard_objects", "advpipe_msgs/msg/HeardObjectArray")

    @property
    def gnss_fix(self) -> Topic:
        return Topic(f"/{self.vehicle}/gnss/fix", "sensor_msgs/msg/NavSatFix")

    @property
    def markers(self) -> Topic:
        return Topic(f"/{self.vehicle}/markers", "visualization_msgs/msg/MarkerArray")
