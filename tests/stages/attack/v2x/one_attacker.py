"""Station 7's messages, made by hand: tests import them from here, and `attacked_cams` from `conftest.py`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codes import AccelerationControl, DriveDirection
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam, LowFrequency
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam

START_NS = 1_700_000_000_000_000_000
ATTACKER, OTHER = 7, 8


def genuine(time_ms: int, **fields: Any) -> Sent:
    """A genuine message of station 7 at 48 degrees north and 11 east, heading east at 10 m/s."""
    time_ns = START_NS + time_ms * 1_000_000
    cam = Cam(
        station_id=ATTACKER,
        station_type=5,
        generation_delta_time_ms=generation_delta_time_ms(time_ns),
        latitude_deg=48.0,
        longitude_deg=11.0,
        altitude_m=520.0,
        heading_rad=math.pi / 2,
        speed_mps=10.0,
        drive_direction=DriveDirection.FORWARD,
        length_m=4.5,
        width_m=1.8,
        longitudinal_acceleration_mps2=1.0,
        yaw_rate_radps=0.0,
        curvature_per_m=0.0,
        acceleration_control=AccelerationControl.GAS_PEDAL,
        low_frequency=LowFrequency(),
    )
    payload = encode_cam(replace(cam, **fields))
    return Sent(time_ms, time_ms, ATTACKER, time_ns, payload, 23.0)
