"""One station: a vehicle with a radio, that tells others where it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw, wrap_angle, yaw_of
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.v2x import V2x
from advpipe.pipeline.seeding import named_generator
from advpipe.pipeline.v2x.codes import AccelerationControl, DriveDirection, StationType
from advpipe.pipeline.v2x.dcc import ReactiveDcc
from advpipe.pipeline.v2x.generation import (
    CHECK_INTERVAL_NS,
    CamGenerator,
    GeneratedCam,
    GenerationRules,
    first_check_ns,
)
from advpipe.pipeline.v2x.reference_point import reference_point
from advpipe.pipeline.v2x.station_state import StationState
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.v2x.self_knowledge import Wander

STATION_TYPES = {
    "van": StationType.LIGHT_TRUCK,
    "minibus": StationType.LIGHT_TRUCK,
    "box_truck": StationType.HEAVY_TRUCK,
    "semi_trailer": StationType.HEAVY_TRUCK,
    "bus": StationType.BUS,
    "motorcycle": StationType.MOTORCYCLE,
    "scooter": StationType.MOPED,
}
"""By the name of the body; what is not here is told by its class."""

_BY_CLASS = {"car": StationType.PASSENGER_CAR, "truck": StationType.HEAVY_TRUCK}

BRAKING_MPS2 = -0.5
"""Slower by more than rolling out: the driver's foot is on the brake."""
PEDAL_MPS2 = 0.1

STANDING_MPS = 0.05


def station_type(user: RoadUser) -> StationType | None:
    """What a road user is as a station; None for one that carries no radio: bicycles, people on foot."""
    body = user.variant.name.partition(".")[0]
    return STATION_TYPES.get(body) or _BY_CLASS.get(user.variant.body.label)


@dataclass(frozen=True)
class Knowledge:
    """What a station believes of itself; standard deviations are 1 sigma.

    position_covariance_m2: (2, 2) along the map's x and y axes.
    """

    map_SE3_base: Float64
    speed_mps: float
    position_covariance_m2: Float64
    altitude_stddev_m: float | None
    heading_stddev_rad: float
    speed_stddev_mps: float


class Station:
    """One vehicle's ITS station, from when it is first seen on."""

    def __init__(
        self, v2x: V2x, seed: int, step_s: float, station_id: int, user: RoadUser, now_ns: int
    ) -> None:
        self.id, self.user = station_id, user
        self._step_s = step_s
        self._type = station_type(user) or StationType.UNKNOWN
        self._generator = CamGenerator(now_ns, GenerationRules.of(v2x.cam))
        self._dcc = ReactiveDcc() if v2x.cam.dcc == "reactive" else None
        self._next_check_ns = first_check_ns(now_ns, seed, station_id)
        self._knowledge = v2x.others
        self._wander = Wander(v2x.others, step_s, named_generator(seed, "v2x", "self-knowledge", user.id))
        self._last: Knowledge | None = None
        self._state: StationState | None = None

    def hear_load(self, busy_ratio: float) -> None:
        """Takes the channel load that the station measured over the last tenth of a second."""
        if self._dcc is not None:
            self._dcc.update(busy_ratio)

    def update(self, now_ns: int, user: RoadUser, estimate: Estimate | None, geodesy: Geodesy) -> None:
        """The newest state: that of the estimate on board, or the truth with an error that wanders."""
        self.user = user
        known = self._guess(user) if estimate is None else _estimated(estimate)
        yaw_rate_radps, acceleration_mps2 = self._change(known)
        self._last = known
        place = reference_point(geodesy, known.map_SE3_base, user.variant.length_m)
        covariance = known.position_covariance_m2
        curvature = yaw_rate_radps / known.speed_mps if abs(known.speed_mps) > STANDING_MPS else 0.0
        self._state = StationState(
            station_id=self.id,
            station_type=self._type,
            time_ns=now_ns,
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            altitude_m=place.altitude_m,
            heading_rad=place.heading_rad,
            speed_mps=abs(known.speed_mps),
            drive_direction=DriveDirection.FORWARD if known.speed_mps >= 0 else DriveDirection.BACKWARD,
            length_m=user.variant.length_m,
            width_m=user.variant.width_m,
            longitudinal_acceleration_mps2=acceleration_mps2,
            yaw_rate_radps=yaw_rate_radps,
            curvature_per_m=curvature,
            east_north_covariance_m2=(covariance[0, 0], covariance[0, 1], covariance[1, 1]),
            altitude_std_m=known.altitude_stddev_m,
            heading_std_rad=known.heading_stddev_rad,
            speed_std_mps=known.speed_stddev_mps,
            acceleration_control=_pedals(acceleration_mps2),
        )

    def cams_before(self, end_ns: int) -> Iterator[GeneratedCam]:
        """Checks at every due instant before `end_ns`, with the newest state."""
        assert self._state is not None
        while self._next_check_ns < end_ns:
            interval_s = self._dcc.interval_s if self._dcc is not None else 0.0
            cam = self._generator.check(self._next_check_ns, self._state, interval_s)
            self._next_check_ns += CHECK_INTERVAL_NS
            if cam is not None:
                yield cam

    def _guess(self, user: RoadUser) -> Knowledge:
        """A receiver of its own: the truth, and an error that wanders."""
        east_m, north_m, turn_rad, speed_mps = self._wander.step().tolist()
        pose = user.map_SE3_base.copy()
        pose[:3, :3] = se3_from_yaw((0, 0, 0), turn_rad)[:3, :3] @ pose[:3, :3]
        pose[:2, 3] += east_m, north_m
        knowledge = self._knowledge
        true_mps = float(user.map_SE3_base[:3, 0] @ user.velocity_mps)
        # A wheel that stands still is known to stand still.
        is_standing = abs(true_mps) < STANDING_MPS
        return Knowledge(
            pose,
            0.0 if is_standing else max(true_mps + speed_mps, 0.0),
            np.eye(2) * knowledge.position_stddev_m**2,
            None,
            float(np.deg2rad(knowledge.heading_stddev_deg)),
            knowledge.speed_stddev_mps,
        )

    def _change(self, known: Knowledge) -> tuple[float, float]:
        """Yaw rate and acceleration since the last state."""
        if self._last is None:
            return 0.0, 0.0
        turned_rad = float(wrap_angle(yaw_of(known.map_SE3_base) - yaw_of(self._last.map_SE3_base)))
        return turned_rad / self._step_s, (known.speed_mps - self._last.speed_mps) / self._step_s


def _estimated(estimate: Estimate) -> Knowledge:
    pose, twist = estimate.pose_covariance, estimate.twist_covariance
    return Knowledge(
        estimate.map_SE3_base,
        float(estimate.base_velocity_mps[0]),
        pose[:2, :2],
        float(np.sqrt(pose[2, 2])),
        float(np.sqrt(pose[5, 5])),
        float(np.sqrt(twist[0, 0])),
    )


def _pedals(acceleration_mps2: float) -> AccelerationControl:
    if acceleration_mps2 < BRAKING_MPS2:
        return AccelerationControl.BRAKE_PEDAL
    return AccelerationControl.GAS_PEDAL if acceleration_mps2 > PEDAL_MPS2 else AccelerationControl.NONE
