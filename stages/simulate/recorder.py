"""Records the sensors of the instrumented vehicles, and the ground truth, in the bag."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from advpipe.pipeline.bag.footprints import footprints_text
from advpipe.pipeline.bag.localisation import initial_pose_message, onboard_messages
from advpipe.pipeline.bag.v2x_statistics import statistics_message
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.live.stream import LiveStream
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.heard_objects import heard_objects_cdr
from advpipe.pipeline.messages.ldm import ldm_detections_cdr, ldm_snapshot_cdr
from advpipe.pipeline.messages.markers import Lane, lane_markers
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.messages.v2x import (
    PseudonymUse,
    RadioPlace,
    own_messages,
    packet_messages,
    pseudonym_message,
    received_messages,
    rejected_message,
    sent_message,
    stations_message,
)
from advpipe.pipeline.scenario.load import scenario_tree
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.sensor import Reading
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot as LdmSnapshot
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.instrumented import Instrumented, VehicleSnapshot
from advpipe.stages.simulate.network.protocol import NetworkStep


@dataclass
class Tally:
    """Counts of the readings so far."""

    clouds: int = 0
    points: int = 0
    road_users: set[str] = field(default_factory=set)

    def add(self, readings: Sequence[Reading]) -> None:
        """Count the readings of one vehicle in one step."""
        for reading in readings:
            self.clouds += reading.clouds
            self.points += reading.points
            self.road_users.update(reading.road_users)


class Recorder:
    """Converts each step to messages and writes them to the bag.

    Messages about an instant carry the step's stamp; IMU samples, messages sent and messages received
    carry their own, since the previous step. All messages of a step are written in the order of their stamps,
    and published by the stream, if there is one.

    behind: by how many steps the writing may be behind, while readings are in the making elsewhere.
    tally: of the readings so far written.
    """

    def __init__(
        self, scenario: Scenario, writer: BagWriter, stream: LiveStream | None = None, behind: int = 0
    ) -> None:
        self._scenario = scenario
        self._writer, self._stream = writer, stream
        self._behind, self.tally = behind, Tally()
        self._step: list[StampedCdr] = []
        self._readings: list[tuple[int, Sequence[Reading]]] = []  # with their places in the step
        self._waiting: deque[tuple[list[StampedCdr], list[tuple[int, Sequence[Reading]]]]] = deque()
        self._own_radios: dict[int, VehicleTopics] = {}

    def start(
        self,
        stamp_ns: int,
        vehicles: Sequence[Instrumented],
        lanes: Sequence[Lane],
        footprints: Sequence[shapely.Polygon] | None = None,
    ) -> None:
        """Record the latched topics: sensor mounts, scenario, roads, and the buildings that attenuate
        signals."""
        static = []
        for vehicle in vehicles:
            topic = VehicleTopics(vehicle.name)
            static.append((topic.base_frame, topic.imu_frame, np.eye(4)))
            for name, base_SE3_sensor in vehicle.mounts.items():
                static.append((topic.base_frame, topic.sensor_frame(name), base_SE3_sensor))
        self._write(topics.TF_STATIC, build.transforms(stamp_ns, static), stamp_ns)
        info = json.dumps(scenario_tree(self._scenario), sort_keys=True)
        self._write(topics.SCENARIO_INFO, build.string(info), stamp_ns)
        self._write(topics.LANES, lane_markers(stamp_ns, MAP_FRAME, lanes), stamp_ns)
        if self._scenario.v2x.enabled and footprints is not None:
            text = footprints_text(footprints)
            self._write(topics.V2X_BUILDINGS, build.string(text), stamp_ns)

    def record(
        self,
        network_step: NetworkStep,
        snapshots: Sequence[VehicleSnapshot],
        radios: Sequence[RadioPlace],
        local_dynamic_maps: Sequence[tuple[str, LdmSnapshot]],
        pseudonyms: Sequence[PseudonymUse] = (),
    ) -> None:
        """Record one step: radio messages up to it, all instrumented vehicles, all radios on the road."""
        stamp_ns = network_step.stamp_ns
        self._write(topics.CLOCK, build.clock(stamp_ns), stamp_ns)
        estimates = [
            (MAP_FRAME, VehicleTopics(s.vehicle).base_frame, s.onboard.estimate.map_SE3_base)
            for s in snapshots
        ]
        self._write(topics.TF, build.transforms(stamp_ns, estimates), stamp_ns)
        self._record_network_step(network_step)
        for snapshot in snapshots:
            self._record_onboard(snapshot)
            self._record_truth(stamp_ns, snapshot)
            self._readings.append((len(self._step), snapshot.readings))
        if self._scenario.v2x.enabled:
            self._record_radios(stamp_ns, radios)
            self._step += map(pseudonym_message, pseudonyms)
            self._record_maps(stamp_ns, local_dynamic_maps)
        self._flush()

    def finish(self, network_step: NetworkStep, statistics: Statistics | None) -> None:
        """Record the messages after the last step, and the statistics."""
        self._record_network_step(network_step)
        if statistics is not None:
            stamp_ns = max((message[2] for message in self._step), default=network_step.stamp_ns)
            self._step.append(statistics_message(stamp_ns, statistics))
        self._behind = 0
        self._flush()

    def _flush(self) -> None:
        """End the step, and write the steps whose readings need not be waited for yet."""
        self._waiting.append((self._step, self._readings))
        self._step, self._readings = [], []
        while len(self._waiting) > self._behind:
            step, readings = self._waiting.popleft()
            for place, vehicle in reversed(readings):
                step[place:place] = [message for reading in vehicle for message in reading.messages]
                self.tally.add(vehicle)
            step.sort(key=lambda message: message[2])
            for message in step:
                self._writer.write_cdr(*message)
            if self._stream is not None:
                self._stream.publish(step)

    def _write(self, topic: Topic, message: Any, stamp_ns: int) -> None:
        self._step.append((topic, serialise(message, topic.type), stamp_ns))

    def _record_network_step(self, network_step: NetworkStep) -> None:
        for sent in network_step.sent:
            self._step.append(sent_message(sent))
            self._step += packet_messages(sent)
            if sent.station_id in self._own_radios:
                self._step += own_messages(self._own_radios[sent.station_id], sent)
        for received in network_step.received:
            self._step += received_messages(received)
        self._step += map(rejected_message, network_step.rejected)

    def _record_radios(self, stamp_ns: int, radios: Sequence[RadioPlace]) -> None:
        self._step.append(stations_message(stamp_ns, radios, MAP_FRAME))
        self._own_radios = {
            radio.station_id: VehicleTopics(radio.vehicle)
            for radio in radios
            if radio.vehicle in self._scenario.vehicles
        }

    def _record_maps(self, stamp_ns: int, local_dynamic_maps: Sequence[tuple[str, LdmSnapshot]]) -> None:
        for vehicle, snapshot in local_dynamic_maps:
            topic = VehicleTopics(vehicle)
            self._step.append((topic.ldm, ldm_snapshot_cdr(snapshot), stamp_ns))
            self._step.append((topic.ldm_objects, ldm_detections_cdr(snapshot), stamp_ns))
            if self._scenario.v2x.cpm is not None:
                self._step.append((topic.heard_objects, heard_objects_cdr(snapshot), stamp_ns))

    def _record_onboard(self, snapshot: VehicleSnapshot) -> None:
        topic = VehicleTopics(snapshot.vehicle)
        if snapshot.initial is not None:
            stamp_ns = snapshot.onboard.measured.stamp_ns
            self._write(*initial_pose_message(topic, snapshot.initial, stamp_ns))
        self._write_all(onboard_messages(topic, self._scenario.sensors.imu, snapshot.onboard))

    def _write_all(self, stamped: Iterable[tuple[Topic, Any, int]]) -> None:
        for message in stamped:
            self._write(*message)

    def _record_truth(self, stamp_ns: int, snapshot: VehicleSnapshot) -> None:
        topic, truth = VehicleTopics(snapshot.vehicle), snapshot.onboard.truth
        odometry = build.odometry(
            stamp_ns,
            truth.map_SE3_base,
            truth.base_velocity_mps,
            truth.turn_rate_radps,
            frame_id=MAP_FRAME,
            child_frame_id=topic.base_frame,
        )
        self._write(topic.true_odometry, odometry, stamp_ns)
