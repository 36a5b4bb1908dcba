"""CAMs of logged beacons, and what they lose."""

from __future__ import annotations

import math
from collections.abc import Callable

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codes import DriveDirection
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.stages.import_.beacons.motion import Motion
from advpipe.stages.import_.beacons.record import BeaconRecord, BeaconState

LENGTH_M, WIDTH_M = 5.0, 1.8
"""Of every vehicle, as NextGen's published checks take it: logs do not say it."""
PASSENGER_CAR = 5
_LARGEST_ID = 2**32 - 1
_FAST_TURN_RADPS = 5.7

LOSSES = (
    "CAMs are derived from the log: times are rounded to 1 ms, positions to about 1 cm, headings to 0.1°, "
    "speeds to 0.01 m/s and accelerations to 0.1 m/s²; what a CAM cannot state, such as more than 163.8 m/s, "
    "is out of range there. The log's own digits are on /log/beacons.",
    f"The log states no sizes and no yaw rates: every CAM says {LENGTH_M:g} m by {WIDTH_M:g} m, and the yaw "
    "rate that follows from the headings of a station's last two messages.",
)


class StationIds:
    """Numbers of stations, by what the log calls them: its own where a CAM can hold it."""

    def __init__(self) -> None:
        self._known: dict[str, int] = {}
        self._taken: set[int] = set()

    def of(self, name: str) -> int:
        """The same number for the same name."""
        if name not in self._known:
            own = int(name) if name.isdecimal() else _LARGEST_ID + 1
            if own > _LARGEST_ID or own in self._taken:
                own = next(n for n in range(len(self._known) + 1, _LARGEST_ID) if n not in self._taken)
            self._known[name] = own
            self._taken.add(own)
        return self._known[name]


class CamsOfLog:
    """Derives CAMs from one receiver's records, which come in order of reception."""

    def __init__(
        self, geodesy: Geodesy, ids: StationIds, motion: Callable[[BeaconState, float], Motion]
    ) -> None:
        self._geodesy, self._ids, self._motion = geodesy, ids, motion
        self._last: dict[int, tuple[int, float]] = {}

    def payload(self, record: BeaconRecord) -> bytes | None:
        """The CAM in UPER; None for a record without a place on the Earth's map."""
        station_id = self._ids.of(record.pseudonym or record.sender)
        last_ns, last_yaw_rad = self._last.get(station_id, (0, math.nan))
        found, sent_ns = self._motion(record.state, last_yaw_rad), record.sent_ns or record.stamp_ns
        turn_radps = 0.0
        if sent_ns > last_ns and math.isfinite(found.yaw_rad - last_yaw_rad):
            turned_rad = math.remainder(found.yaw_rad - last_yaw_rad, math.tau)
            turn_radps = turned_rad / ((sent_ns - last_ns) / 1e9)
        if sent_ns > last_ns:
            self._last[station_id] = sent_ns, found.yaw_rad
        yaw_rad = found.yaw_rad if math.isfinite(found.yaw_rad) else 0.0
        # A CAM names the middle of the front; the log's place is taken as the middle of the vehicle.
        front_m = (
            found.x_m + LENGTH_M / 2 * math.cos(yaw_rad),
            found.y_m + LENGTH_M / 2 * math.sin(yaw_rad),
            0.0,
        )
        latitude_deg, longitude_deg, _ = self._geodesy.to_geographic(front_m).tolist()
        if not math.isfinite(latitude_deg + longitude_deg):
            return None
        try:
            return encode_cam(_cam(station_id, sent_ns, (latitude_deg, longitude_deg), found, turn_radps))
        except CamError:
            return None


def _cam(
    station_id: int, sent_ns: int, place_deg: tuple[float, float], found: Motion, turn_radps: float
) -> Cam:
    return Cam(
        station_id=station_id,
        station_type=PASSENGER_CAR,
        generation_delta_time_ms=generation_delta_time_ms(sent_ns),
        latitude_deg=place_deg[0],
        longitude_deg=place_deg[1],
        semi_major_m=found.position_confidence_m,
        semi_minor_m=found.position_confidence_m,
        semi_major_rad=0.0,
        heading_rad=_known((math.pi / 2 - found.yaw_rad) % math.tau),
        heading_confidence_rad=found.heading_confidence_rad,
        speed_mps=_known(abs(found.speed_mps)),
        speed_confidence_mps=found.speed_confidence_mps,
        drive_direction=DriveDirection.BACKWARD if found.speed_mps < 0 else DriveDirection.FORWARD,
        length_m=LENGTH_M,
        width_m=WIDTH_M,
        longitudinal_acceleration_mps2=_known(found.acceleration_mps2, 0.0),
        yaw_rate_radps=max(min(turn_radps, _FAST_TURN_RADPS), -_FAST_TURN_RADPS),
    )


def _known(value: float, otherwise: float | None = None) -> float | None:
    return value if math.isfinite(value) else otherwise
