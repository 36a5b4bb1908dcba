"""The bag of a log: its records, the CAMs of the beacons, and the receivers' own states."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.beacons import beacon_log_message
from advpipe.pipeline.messages.topics import BEACONS, SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.messages.types import message_class
from advpipe.pipeline.messages.v2x import udp_packet_cdr
from advpipe.stages.import_.beacons.motion import Motion
from advpipe.stages.import_.beacons.record import BeaconRecord, BeaconState

_NO_DBM = math.nan


class LogBag:
    """Writes the messages of a log.

    origin_deg: latitude and longitude. names: of receivers in topics, by the log's. motion: of a state, with
    the yaw before.
    """

    def __init__(
        self,
        writer: BagWriter,
        origin_deg: tuple[float, float],
        names: Mapping[str, str],
        motion: Callable[[BeaconState, float], Motion],
    ) -> None:
        self._writer, self._names, self._motion = writer, names, motion
        self._yaw_rad: dict[str, float] = {}
        self._origin_deg = origin_deg
        self._own_ns: dict[str, int] = {}

    def begin(self, records: Sequence[BeaconRecord]) -> None:
        """Write what is recorded once, and the first own state of each receiver."""
        latitude_deg, longitude_deg = self._origin_deg
        origin = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "altitude_m": 0.0}
        info = {"map": {"origin": origin}, "vehicles": {name: {} for name in sorted(self._names.values())}}
        stamp_ns = records[0].stamp_ns if records else 0
        self._writer.write(SCENARIO_INFO, build.string(json.dumps(info)), stamp_ns)
        for record in records:
            if record.receiver and record.receiver not in self._own_ns:
                self.write_own(record, stamp_ns)

    def write_record(self, record: BeaconRecord) -> None:
        """The record itself; a receiver's own state as its odometry, too."""
        self._writer.write(BEACONS, beacon_log_message(record), record.stamp_ns)
        if record.receiver:
            self.write_own(record)

    def write_own(self, record: BeaconRecord, stamp_ns: int | None = None) -> None:
        """The receiver's own state, once for an instant."""
        stamp_ns = record.stamp_ns if stamp_ns is None else stamp_ns
        found = self._motion(record.own_state, self._yaw_rad.get(record.receiver, math.nan))
        if not math.isfinite(found.x_m + found.y_m) or self._own_ns.get(record.receiver) == stamp_ns:
            return
        self._own_ns[record.receiver] = stamp_ns
        yaw_rad = found.yaw_rad if math.isfinite(found.yaw_rad) else 0.0
        self._yaw_rad[record.receiver] = yaw_rad
        topics = VehicleTopics(self._names[record.receiver])
        message = build.odometry(
            stamp_ns,
            se3_from_yaw((found.x_m, found.y_m, 0.0), yaw_rad),
            np.array([found.speed_mps if math.isfinite(found.speed_mps) else 0.0, 0.0, 0.0]),
            np.zeros(3),
            child_frame_id=topics.base_frame,
        )
        self._writer.write(topics.odometry, message, stamp_ns)

    def write_received(self, record: BeaconRecord, payload: bytes, number: int, station_id: int) -> None:
        """The CAM of a received beacon, its power and its true sender."""
        topics, stamp_ns = VehicleTopics(self._names[record.receiver]), record.stamp_ns
        self._writer.write_cdr(topics.received_raw, udp_packet_cdr(stamp_ns, payload), stamp_ns)
        header = build.message_header(stamp_ns, "")
        power_dbm = 10 * math.log10(record.rssi) if record.rssi > 0 else _NO_DBM
        info = message_class(topics.reception_info.type)(header=header, power_dbm=power_dbm, sinr_db=_NO_DBM)
        self._writer.write(topics.reception_info, info, stamp_ns)
        truth = message_class(topics.true_receptions.type)(
            header=header, number=number, station_id=station_id
        )
        self._writer.write(topics.true_receptions, truth, stamp_ns)
