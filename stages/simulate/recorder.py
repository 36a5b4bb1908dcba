"""Writes what the sensors of the instrumented vehicles see, and the truth beside it, into the bag."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.bag import messages, topics
from advpipe.pipeline.bag.cloud import Cloud, cloud_to_cdr, xyz
from advpipe.pipeline.bag.markers import markers
from advpipe.pipeline.bag.topics import VehicleTopics
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.geometry.transforms import Float64, invert, wrap_angle, yaw_of
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.gnss import GnssReceiver
from advpipe.pipeline.scenario.load import scenario_tree
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.simulate.road_users import RoadUser, boxes_of

MAP_FRAME = "map"


@dataclass(frozen=True)
class Snapshot:
    """One recorded step.

    carriers: the instrumented vehicles by name. others: every other road user in the LiDAR's range.
    cloud: in the LiDAR's frame, with `base_SE3_lidar` where the sensor sits on its vehicle.
    """

    stamp_ns: int
    carriers: Mapping[str, RoadUser]
    others: Sequence[RoadUser]
    cloud: Cloud
    base_SE3_lidar: Float64


class Recorder:
    """Turns snapshots into messages; all messages of a step carry its stamp."""

    def __init__(self, scenario: Scenario, writer: BagWriter) -> None:
        self._scenario = scenario
        self._writer = writer
        self._step_s = scenario.simulation.step_s
        origin = scenario.map.origin
        self._geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        gnss = scenario.sensors.gnss
        self._carrier = scenario.sensors.lidars["lidar"].vehicle
        rng = named_generator(scenario.simulation.seed, "gnss", self._carrier)
        self._receiver = GnssReceiver(gnss, self._step_s, rng)
        self._last_yaw_rad: dict[str, float] = {}

    def start(self, stamp_ns: int, base_SE3_lidar: Float64) -> None:
        """The latched topics: where the sensors sit, and what this drive is."""
        topic = VehicleTopics(self._carrier)
        static = messages.transforms(stamp_ns, [(topic.base_frame, topic.lidar_frame, base_SE3_lidar)])
        self._writer.write(topics.TF_STATIC, static, stamp_ns)
        info = json.dumps(scenario_tree(self._scenario), sort_keys=True)
        self._writer.write(topics.SCENARIO_INFO, messages.string(info), stamp_ns)

    def record(self, snapshot: Snapshot) -> None:
        """One step: clock, poses, GNSS, cloud and ground truth."""
        stamp_ns, write = snapshot.stamp_ns, self._writer.write
        write(topics.CLOCK, messages.clock(stamp_ns), stamp_ns)
        poses = [
            (MAP_FRAME, VehicleTopics(name).base_frame, carrier.map_SE3_base)
            for name, carrier in sorted(snapshot.carriers.items())
        ]
        write(topics.TF, messages.transforms(stamp_ns, poses), stamp_ns)
        for name, carrier in sorted(snapshot.carriers.items()):
            self._record_odometry(name, carrier, stamp_ns)
        self._record_fix(snapshot)
        self._record_lidar(snapshot)

    def _record_odometry(self, name: str, carrier: RoadUser, stamp_ns: int) -> None:
        topic = VehicleTopics(name)
        yaw_rad = yaw_of(carrier.map_SE3_base)
        turned_rad = float(wrap_angle(yaw_rad - self._last_yaw_rad.get(name, yaw_rad)))
        self._last_yaw_rad[name] = yaw_rad
        odometry = messages.odometry(
            stamp_ns,
            carrier.map_SE3_base,
            carrier.map_SE3_base[:3, :3].T @ carrier.velocity_mps,
            (0.0, 0.0, turned_rad / self._step_s),
            frame_id=MAP_FRAME,
            child_frame_id=topic.base_frame,
        )
        self._writer.write(topic.true_odometry, odometry, stamp_ns)

    def _record_fix(self, snapshot: Snapshot) -> None:
        name = self._carrier
        topic = VehicleTopics(name)
        fix_m = self._receiver.fix(snapshot.carriers[name].position_m)
        std_m = np.sqrt(np.diag(self._receiver.covariance_m2))
        fix = messages.nav_sat_fix(
            snapshot.stamp_ns,
            *self._geodesy.to_geographic(fix_m),
            std_m=std_m.tolist(),
            frame_id=topic.base_frame,
        )
        self._writer.write(topic.gnss_fix, fix, snapshot.stamp_ns)

    def _record_lidar(self, snapshot: Snapshot) -> None:
        name = self._carrier
        topic, stamp_ns = VehicleTopics(name), snapshot.stamp_ns
        cdr = cloud_to_cdr(snapshot.cloud, stamp_ns, topic.lidar_frame)
        self._writer.write_cdr(topic.lidar_points, cdr, stamp_ns)
        boxes = boxes_of(snapshot.others)
        map_SE3_lidar = snapshot.carriers[name].map_SE3_base @ snapshot.base_SE3_lidar
        in_lidar = boxes.transformed(invert(map_SE3_lidar))
        points = count_points(xyz(snapshot.cloud), in_lidar.geometry)
        write = self._writer.write
        write(topic.objects, messages.detections(stamp_ns, MAP_FRAME, boxes), stamp_ns)
        write(
            topic.road_users,
            messages.road_users(stamp_ns, MAP_FRAME, boxes, points, np.zeros(len(points))),
            stamp_ns,
        )
        if self._scenario.recording.markers:
            write(topic.markers, markers(stamp_ns, MAP_FRAME, boxes), stamp_ns)
