"""Messages of a small graph for tests of the relay: clouds, packets with CAMs, and fixes."""

import math

import numpy as np

from advpipe.pipeline.messages.build import nav_sat_fix
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_to_cdr
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.messages.v2x import udp_packet_cdr
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam

BEGIN_NS = 1_700_000_000_000_000_000
LATITUDE_DEG, LONGITUDE_DEG = 48.0, 11.0


def cloud(points: int = 2000, seed: int = 1) -> Cloud:
    """Random points around the sensor, from the ground to 3 m above it."""
    rng = np.random.default_rng(seed)
    made = np.zeros(points, POINT_DTYPE)
    angle_rad, distance_m = rng.uniform(-math.pi, math.pi, points), rng.uniform(15, 60, points)
    made["x"], made["y"] = distance_m * np.cos(angle_rad), distance_m * np.sin(angle_rad)
    made["z"] = rng.uniform(-1.8, 1.2, points)
    made["ring"] = np.arange(points) % 32
    return made


def cloud_cdr(number: int = 0, points: int = 2000) -> bytes:
    return cloud_to_cdr(cloud(points, number), BEGIN_NS + number, "ego/lidar")


def cam_payload_of(station_id: int, stamp_ns: int = BEGIN_NS, speed_mps: float = 10.0) -> bytes:
    """Of a car near the origin that drives to the north."""
    return encode_cam(
        Cam(
            station_id=station_id,
            station_type=5,
            generation_delta_time_ms=generation_delta_time_ms(stamp_ns),
            latitude_deg=LATITUDE_DEG + 1e-4 * (station_id % 10),
            longitude_deg=LONGITUDE_DEG,
            altitude_m=520.0,
            heading_rad=0.0,
            speed_mps=speed_mps,
            length_m=4.5,
            width_m=1.8,
            longitudinal_acceleration_mps2=1.0,
            yaw_rate_radps=0.0,
            curvature_per_m=0.0,
        )
    )


def packet_cdr(station_id: int, stamp_ns: int = BEGIN_NS) -> bytes:
    """The car gains a metre a second each second."""
    speed_mps = 10.0 + (stamp_ns - BEGIN_NS) * 1e-9
    return udp_packet_cdr(stamp_ns, cam_payload_of(station_id, stamp_ns, speed_mps))


def fix_cdr(north_m: float, stamp_ns: int = BEGIN_NS, *, is_fix: bool = True) -> bytes:
    latitude_deg = LATITUDE_DEG + math.degrees(north_m / 6.37e6) if is_fix else math.nan
    fix = nav_sat_fix(stamp_ns, latitude_deg, LONGITUDE_DEG, 520.0, std_m=(1, 1, 2), is_fix=is_fix)
    return serialise(fix, "sensor_msgs/msg/NavSatFix")
