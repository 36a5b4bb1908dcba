"""Writes what the sensors of the instrumented vehicles see, and the truth beside it, into the bag."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.bag import messages, topics
from advpipe.pipeline.bag.cloud import cloud_to_cdr
from advpipe.pipeline.bag.localisation import MAP_FRAME, initial_pose_message, onboard_messages
from advpipe.pipeline.bag.markers import markers
from advpipe.pipeline.bag.topics import VehicleTopics
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.scenario.load import scenario_tree
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.instrumented import Instrumented, Snapshot
from advpipe.stages.simulate.rig import View


class Recorder:
    """Turns snapshots into messages; but for the IMU's samples, all of a step carry its stamp."""

    def __init__(self, scenario: Scenario, writer: BagWriter) -> None:
        self._scenario = scenario
        self._write, self._write_cdr = writer.write, writer.write_cdr

    def start(self, stamp_ns: int, vehicles: Sequence[Instrumented]) -> None:
        """The latched topics: where the sensors sit, and what this drive is."""
        static = []
        for vehicle in vehicles:
            topic = VehicleTopics(vehicle.name)
            static.append((topic.base_frame, topic.imu_frame, np.eye(4)))
            for name, lidar in vehicle.rig.lidars.items():
                lidar_frame = VehicleTopics(vehicle.name, name).lidar_frame
                static.append((topic.base_frame, lidar_frame, lidar.base_SE3_lidar))
        self._write(topics.TF_STATIC, messages.transforms(stamp_ns, static), stamp_ns)
        info = json.dumps(scenario_tree(self._scenario), sort_keys=True)
        self._write(topics.SCENARIO_INFO, messages.string(info), stamp_ns)

    def record(self, stamp_ns: int, snapshots: Sequence[Snapshot]) -> None:
        """One step of all instrumented vehicles that are on the road."""
        for snapshot in snapshots:
            self._record_onboard(snapshot)
        self._write(topics.CLOCK, messages.clock(stamp_ns), stamp_ns)
        estimates = [
            (MAP_FRAME, VehicleTopics(s.vehicle).base_frame, s.onboard.estimate.map_SE3_base)
            for s in snapshots
        ]
        self._write(topics.TF, messages.transforms(stamp_ns, estimates), stamp_ns)
        for snapshot in snapshots:
            self._record_truth(stamp_ns, snapshot)
            if snapshot.view is not None:
                self._record_view(stamp_ns, snapshot.vehicle, snapshot.view)

    def _record_onboard(self, snapshot: Snapshot) -> None:
        topic = VehicleTopics(snapshot.vehicle)
        if snapshot.initial is not None:
            stamp_ns = snapshot.onboard.measured.stamp_ns
            self._write(*initial_pose_message(topic, snapshot.initial, stamp_ns))
        for message in onboard_messages(topic, self._scenario.sensors.imu, snapshot.onboard):
            self._write(*message)

    def _record_truth(self, stamp_ns: int, snapshot: Snapshot) -> None:
        topic, truth = VehicleTopics(snapshot.vehicle), snapshot.onboard.truth
        odometry = messages.odometry(
            stamp_ns,
            truth.map_SE3_base,
            truth.base_velocity_mps,
            truth.turn_rate_radps,
            frame_id=MAP_FRAME,
            child_frame_id=topic.base_frame,
        )
        self._write(topic.true_odometry, odometry, stamp_ns)

    def _record_view(self, stamp_ns: int, vehicle: str, view: View) -> None:
        for name, cloud in view.clouds.items():
            topic = VehicleTopics(vehicle, name)
            self._write_cdr(topic.lidar_points, cloud_to_cdr(cloud, stamp_ns, topic.lidar_frame), stamp_ns)
        topic, boxes = VehicleTopics(vehicle), view.boxes
        self._write(topic.objects, messages.detections(stamp_ns, MAP_FRAME, boxes), stamp_ns)
        road_users = messages.road_users(stamp_ns, MAP_FRAME, boxes, view.lidar_points, view.occlusion)
        self._write(topic.road_users, road_users, stamp_ns)
        if self._scenario.recording.markers:
            self._write(topic.markers, markers(stamp_ns, MAP_FRAME, boxes), stamp_ns)
