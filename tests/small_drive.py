"""A small drive whose numbers are known: a car at 10 m/s along +x, behind another one that says so."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.transforms import se3, se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_to_cdr
from advpipe.pipeline.messages.markers import lane_markers
from advpipe.pipeline.messages.topics import LANES, SCENARIO_INFO, TF_STATIC, V2X_STATISTICS, VehicleTopics
from advpipe.pipeline.messages.v2x import udp_packet_cdr
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam

START_NS = 1_767_268_800_000_000_000
STEP_NS = 100_000_000
EARTH = Geodesy(48.1, 11.5, 500.0)
SPEED_MPS = 10.0
LEADER, GHOST = 7, 13
LEADER_AHEAD_M, GHOST_PLACE_M = 15.0, (18.0, 9.0)
"""The leader's centre ahead of the vehicle; the ghost's, ahead and to the left, where nothing stands."""
SIZE_M = (4.5, 1.8, 1.5)
LIDAR_HEIGHT_M = 1.8
EGO = VehicleTopics("ego")
MOUNT = se3(np.eye(3), [0.0, 0.0, LIDAR_HEIGHT_M])
"""base_SE3_lidar."""


@dataclass(frozen=True)
class Lies:
    """What is false in a drive, from `from_s` on. jump_m: of the fixes, to the north. removed: of the points
    of each cloud, one in so many. hidden: the leader does not return."""

    from_s: float = 3.0
    ghost: bool = False
    jump_m: float = 0.0
    off_ray_m: float = 0.0
    removed: int = 0
    hidden: bool = False


HONEST = Lies()


def cast(leader_ahead_m: float = LEADER_AHEAD_M, rings: int = 24, columns: int = 360) -> Cloud:
    """What a LiDAR over a plane sees of the leader: the nearer of plane and box along each ray."""
    elevation = np.deg2rad(np.linspace(-18.0, 3.0, rings))
    azimuth = (np.arange(columns) + 0.5) * (2 * np.pi / columns) - np.pi
    ring, column = (each.ravel() for each in np.meshgrid(range(rings), range(columns), indexing="ij"))
    flat = np.cos(elevation[ring])
    way = np.stack(
        [flat * np.cos(azimuth[column]), flat * np.sin(azimuth[column]), np.sin(elevation[ring])], 1
    )
    with np.errstate(divide="ignore"):
        ground_m = np.where(way[:, 2] < 0, -LIDAR_HEIGHT_M / way[:, 2], np.inf)
        low = np.array([leader_ahead_m - SIZE_M[0] / 2, -SIZE_M[1] / 2, -LIDAR_HEIGHT_M]) / way
        high = np.array([leader_ahead_m + SIZE_M[0] / 2, SIZE_M[1] / 2, SIZE_M[2] - LIDAR_HEIGHT_M]) / way
    enters = np.minimum(low, high).max(axis=1)
    box_m = np.where((enters > 0) & (enters <= np.maximum(low, high).min(axis=1)), enters, np.inf)
    range_m = np.minimum(ground_m, box_m)
    seen = range_m < 90.0
    cloud = np.zeros(int(seen.sum()), POINT_DTYPE)
    for axis, name in enumerate("xyz"):
        cloud[name] = (way * range_m[:, None])[seen, axis]
    cloud["ring"], cloud["intensity"] = ring[seen], 0.2
    return cloud


def cam(station_id: int, time_ns: int, centre_m: tuple[float, float]) -> bytes:
    """A car's CAM eastwards at the vehicle's speed; its reference point is the middle of its front."""
    latitude_deg, longitude_deg, _ = EARTH.to_geographic([centre_m[0] + SIZE_M[0] / 2, centre_m[1], 0.0])
    return encode_cam(
        Cam(
            station_id=station_id,
            station_type=5,
            generation_delta_time_ms=generation_delta_time_ms(time_ns),
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=500.0,
            heading_rad=np.pi / 2,
            speed_mps=SPEED_MPS,
            length_m=SIZE_M[0],
            width_m=SIZE_M[1],
            longitudinal_acceleration_mps2=0.0,
            yaw_rate_radps=0.0,
        )
    )


def power_cdr(stamp_ns: int, power_dbm: float) -> bytes:
    """advpipe_msgs/V2xReceptionInfo."""
    cdr = Cdr()
    cdr.header(stamp_ns, "")
    cdr.float64(power_dbm, power_dbm + 95.0)
    return bytes(cdr)


def _write_step(bag: BagWriter, number: int, lies: Lies, only: frozenset[str]) -> None:
    now_ns, x_m = START_NS + number * STEP_NS, SPEED_MPS * number / 10
    is_false = number / 10 >= lies.from_s
    pose = se3_from_yaw([x_m, 0.0, 0.0], 0.0)
    if "imu" in only:
        for part in range(10):
            stamp_ns = now_ns - STEP_NS + (part + 1) * STEP_NS // 10
            if number:
                sample = build.imu(
                    stamp_ns,
                    np.array([0.0, 0.0, 9.80665]),
                    np.zeros(3),
                    force_stddev_mps2=0.02,
                    rate_stddev_radps=0.002,
                    frame_id=EGO.imu_frame,
                )
                bag.write(EGO.imu, sample, stamp_ns)
    if "fix" in only:
        north_m = lies.jump_m if is_false else 0.0
        fix = EARTH.to_geographic([x_m, north_m, 0.0])
        message = build.nav_sat_fix(now_ns, *fix, std_m=[1.0, 1.0, 2.0], frame_id=EGO.base_frame)
        bag.write(EGO.gnss_fix, message, now_ns)
    for topic, frame in ((EGO.wheel_odometry, EGO.odom_frame), (EGO.odometry, "map")):
        if {EGO.wheel_odometry: "wheel", EGO.odometry: "estimate"}[topic] in only:
            message = build.odometry(
                now_ns,
                pose,
                (SPEED_MPS, 0.0, 0.0),
                (0.0, 0.0, 0.0),
                frame_id=frame,
                child_frame_id=EGO.base_frame,
                pose_covariance=np.eye(6) * 1e-4,
                twist_covariance=np.eye(6) * 1e-4,
            )
            bag.write(topic, message, now_ns)
    if "messages" in only:
        said = [(LEADER, (x_m + LEADER_AHEAD_M, 0.0))]
        if lies.ghost and is_false:
            said.append((GHOST, (x_m + GHOST_PLACE_M[0], GHOST_PLACE_M[1])))
        for place, (station_id, centre_m) in enumerate(said):
            stamp_ns = now_ns + 1_000_000 * (place + 1)
            bag.write_cdr(
                EGO.received_raw, udp_packet_cdr(stamp_ns, cam(station_id, now_ns, centre_m)), stamp_ns
            )
            bag.write_cdr(EGO.reception_info, power_cdr(stamp_ns, -60.0), stamp_ns)
    if "cloud" in only:
        cloud = cast(leader_ahead_m=500.0) if lies.hidden and is_false else cast()
        if lies.removed and is_false:
            cloud = np.delete(cloud, slice(number % 7, None, lies.removed))
        if lies.off_ray_m and is_false:
            cloud["z"][::100] += np.float32(lies.off_ray_m)
        bag.write_cdr(EGO.lidar_points, cloud_to_cdr(cloud, now_ns, EGO.lidar_frame), now_ns + 5_000_000)


EVERYTHING = frozenset({"imu", "fix", "wheel", "estimate", "messages", "cloud", "lanes", "initial", "mount"})


def record_small_drive(
    path: Path,
    lies: Lies = HONEST,
    *,
    only: frozenset[str] = EVERYTHING,
    secrets: bool = False,
    steps: int = 80,
) -> Path:
    """Write a drive with some lies; of `only` some topics; with what no vehicle knows if it tells secrets."""
    provenance = {"kind": "attack", "attack": "cam-ghost-stop"} if secrets else {}
    with BagWriter(path, provenance=provenance) as bag:
        if "mount" in only:
            link = [(EGO.base_frame, EGO.lidar_frame, MOUNT)]
            bag.write(TF_STATIC, build.transforms(START_NS, link), START_NS)
        if "lanes" in only:
            lanes = [(np.array([[-50.0, y_m, 0.0], [300.0, y_m, 0.0]]), 3.5) for y_m in (0.0, 9.0)]
            bag.write(LANES, lane_markers(START_NS, "map", lanes), START_NS)
        if "initial" in only:
            unturned = np.array([0.0, 0.0, 0.0, 1.0])
            initial = build.initial_pose(START_NS, np.zeros(3), unturned, np.eye(6) * 0.01, frame_id="map")
            bag.write(EGO.initial_pose, initial, START_NS)
        for number in range(steps):
            _write_step(bag, number, lies, only)
            if secrets:
                after_ns = START_NS + number * STEP_NS + 6_000_000
                for topic in (SCENARIO_INFO, V2X_STATISTICS):
                    bag.write(topic, build.string(f"station {GHOST} lies"), after_ns)
    return path
