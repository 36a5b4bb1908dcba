"""The CAMs of a spoofed vehicle, from its estimate on board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.recorded_filter import RecordedFilter
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam import Cam, cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS, first_check_ns, switched_on_ns
from advpipe.pipeline.v2x.facilities.own_state import Identity, accuracy_of_estimate, own_state
from advpipe.pipeline.v2x.facilities.path_history import PathHistory
from advpipe.pipeline.v2x.facilities.reference_point import ReferencePoint, reference_point
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.gnss.victim import SpoofedVehicle


class EstimatedCams:
    """Rebuilds a victim's CAMs from its spoofed estimate, as the simulator does; a `MessageEditor`.

    Position, ellipse, altitude, heading, speed, accelerations, yaw rate, curvature, pedals and path history,
    with their confidences, follow the estimate; without a false fix every bit is reproduced. The times of
    CAMs, and which of them carry the low-frequency container, stay as recorded, although a vehicle with
    another estimate would trigger them at other times (EN 302 637-2, 6.1.3).

    Calls of `edit` go through the drive's steps in order, once.
    """

    def __init__(self, victim: SpoofedVehicle, recorded: RecordedFilter, v2x: V2x) -> None:
        self.name = victim.attack
        self._victim = victim
        self._recorded = recorded
        self._geodesy = recorded.geodesy
        self._path_points = v2x.cam.path_points
        self._drive_begin_ns: int | None = None
        self._path: PathHistory | None = None
        self._pseudonym: int | None = None
        self._next_check_ns = 0
        self._speed_before_mps: float | None = None

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """The messages with the victim's CAMs rebuilt from its estimate, from its first attacked fix on."""
        if self._drive_begin_ns is None:
            self._drive_begin_ns = step.begin_ns
        radio = next((radio for radio in step.radios if radio.vehicle == self._victim.vehicle), None)
        estimate = self._victim.estimates.get(step.begin_ns)
        if radio is None or estimate is None:
            self._path = None
            return sent
        if self._path is None:
            self._switch_on(step, radio, self._drive_begin_ns)
        path = self._path
        assert path is not None
        place = reference_point(self._geodesy, estimate.map_SE3_base, radio.size_m[0])
        while step.end_ns is not None and self._next_check_ns < step.end_ns:
            path.add(step.begin_ns, place.latitude_deg, place.longitude_deg, place.altitude_m)
            self._next_check_ns += CHECK_INTERVAL_NS
        speed_mps, before_mps = float(estimate.base_velocity_mps[0]), self._speed_before_mps
        acceleration_mps2 = 0.0
        if before_mps is not None:
            acceleration_mps2 = (speed_mps - before_mps) / self._recorded.clock.step_s
        self._speed_before_mps = speed_mps
        first_ns = self._victim.first_attacked_ns
        if first_ns is None or step.begin_ns < first_ns:
            return sent
        return [
            self._with_false_position(one, step.begin_ns, radio, estimate, place, acceleration_mps2)
            if one.station_id == radio.station_id
            else one
            for one in sent
        ]

    def _switch_on(self, step: V2xStep, radio: RadioPlace, drive_begin_ns: int) -> None:
        seed = self._recorded.clock.seed
        active_ns = switched_on_ns(step.begin_ns, drive_begin_ns, seed, radio.vehicle)
        self._path, self._speed_before_mps = PathHistory(), None
        self._next_check_ns = first_check_ns(active_ns, seed, radio.station_id)

    def _with_false_position(
        self,
        one: Sent,
        time_ns: int,
        radio: RadioPlace,
        estimate: Estimate,
        place: ReferencePoint,
        acceleration_mps2: float,
    ) -> Sent:
        try:
            recorded_cam = decode_cam(one.payload)
        except CamError:  # not a CAM: no position to change
            return one
        length_m, width_m, _ = radio.size_m
        pseudonym = recorded_cam.station_id
        if self._path is not None and self._pseudonym not in (None, pseudonym):
            self._path = PathHistory()  # as the station does with a new pseudonym
            self._path.add(time_ns, place.latitude_deg, place.longitude_deg, place.altitude_m)
        self._pseudonym = pseudonym
        who = Identity(pseudonym, recorded_cam.station_type, length_m, width_m, recorded_cam.trailer)
        state = own_state(
            who,
            time_ns,
            place,
            accuracy_of_estimate(estimate),
            speed_mps=float(estimate.base_velocity_mps[0]),
            acceleration_mps2=acceleration_mps2,
            yaw_rate_radps=float(estimate.base_turn_rate_radps[2]),
        )
        cam = cam_of_state(state, recorded_cam.low_frequency)
        return replace(one, payload=encode_cam(self._with_path(cam, place, time_ns)))

    def _with_path(self, cam: Cam, place: ReferencePoint, time_ns: int) -> Cam:
        if cam.low_frequency is None:
            return cam
        assert self._path is not None
        points = self._path.points(place.latitude_deg, place.longitude_deg, place.altitude_m, time_ns)
        return replace(
            cam, low_frequency=replace(cam.low_frequency, path_history=points[: self._path_points])
        )
