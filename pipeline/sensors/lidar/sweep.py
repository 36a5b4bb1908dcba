"""The rays of one turn: their directions, and the sensor's pose when each ray leaves."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, invert, se3
from advpipe.pipeline.sensors.lidar.section import LidarSensor

Float32 = npt.NDArray[np.float32]


class LidarSweep:
    """R = columns x channels rays, column by column; the channels of a column leave simultaneously.

    Seen from above, the turn is clockwise, as with most sensors. It starts and ends at the rear, so that the
    seam between the first and the last column is behind the vehicle.

    directions: (3, R) float32, unit vectors in the LiDAR's frame.
    rings: (R,) uint16, 0 is the lowest. times_s: (R,) float32, relative to the end of the turn, at most 0.
    elevation_error_rad: (channels,), by how much each ring's rays leave higher than `directions`, which the
    sensor believes in.
    """

    def __init__(self, sensor: LidarSensor, elevation_error_rad: Float64 | None = None) -> None:
        angles = sensor.vertical_angles_deg
        if angles is None:
            angles = tuple(np.linspace(sensor.lower_fov, sensor.upper_fov, sensor.channels).tolist())
        columns, channels = sensor.columns, len(angles)
        elevation = np.deg2rad(np.asarray(angles))
        azimuth = np.pi - 2 * np.pi * np.arange(columns) / columns
        self._ahead, self._left = np.cos(azimuth), np.sin(azimuth)
        self._column_s = -(columns - 1 - np.arange(columns)) / columns / sensor.rotation_frequency
        self.rings = np.tile(np.arange(channels, dtype=np.uint16), columns)
        self.times_s: Float32 = np.repeat(self._column_s, channels).astype(np.float32)
        self.columns, self.channels = columns, channels
        self._fan = _fan(elevation)
        directions = self._spread(np.eye(3)[None], np.zeros((1, 3)))[:, 3:]
        self.directions: Float32 = np.ascontiguousarray(directions.T)
        if elevation_error_rad is not None:
            self._fan = _fan(elevation + elevation_error_rad)

    def rays(self, map_SE3_base: Float64, base_SE3_lidar: Float64, base_twist: Float64 | None) -> Float32:
        """Rays (R, 6) in the map frame: origin, unit direction.

        `map_SE3_base`: pose of base_link at the end of the turn. `base_twist`: its motion during the turn, or
        None if it does not move.
        """
        if base_twist is None:
            poses = (map_SE3_base @ base_SE3_lidar)[None]
        else:
            poses = map_SE3_base @ poses_at(base_twist, self._column_s) @ base_SE3_lidar
        return self._spread(poses[:, :3, :3], poses[:, :3, 3])

    def undistorted(
        self, points_m: Float32, times_s: Float32, base_SE3_lidar: Float64, base_twist: Float64
    ) -> Float64:
        """Transform points (N, 3) from the LiDAR's frame at times (N,) to its frame at the turn's end."""
        lidar_SE3_then = invert(base_SE3_lidar) @ poses_at(base_twist, self._column_s) @ base_SE3_lidar
        column = np.rint((1 - times_s / min(self._column_s[0], -1e-9)) * (len(self._column_s) - 1))
        pose = lidar_SE3_then[column.astype(np.int64)]
        moved: Float64 = np.einsum("nij,nj->ni", pose[:, :3, :3], points_m) + pose[:, :3, 3]
        return moved

    def _spread(self, rotation: Float64, origin_m: Float64) -> Float32:
        """Rays (R, 6) for the rotations (columns or 1, 3, 3) and origins (columns or 1, 3)."""
        level = self._ahead[:, None] * rotation[:, :, 0] + self._left[:, None] * rotation[:, :, 1]
        level, up = level.astype(np.float32), rotation[:, :, 2].astype(np.float32)
        flat, high = self._fan
        rays = np.empty((len(level), len(flat), 6), np.float32)
        rays[..., :3] = origin_m[:, None]
        for axis in range(3):  # axis by axis: operations on rows of three numbers are slow
            np.multiply(level[:, axis, None], flat, out=rays[..., 3 + axis])
            rays[..., 3 + axis] += up[:, axis, None] * high
        return rays.reshape(-1, 6)


def _fan(elevation: Float64) -> tuple[Float32, Float32]:
    return np.cos(elevation).astype(np.float32), np.sin(elevation).astype(np.float32)


def poses_at(twist: Float64, times_s: Float64) -> Float64:
    """Poses (N, 4, 4) of a body at the times (N,), in the body's own frame at time zero.

    twist: (6,), constant, in the body's axes: linear velocity in m/s, then turn rate in rad/s (the order of
    geometry_msgs/Twist). This is the exponential map of SE(3), see Lynch and Park, Modern Robotics,
    proposition 3.25.
    """
    velocity, turn = np.asarray(twist, dtype=np.float64).reshape(2, 3)
    rate = float(np.linalg.norm(turn))
    poses = np.tile(np.eye(4), (len(times_s), 1, 1))
    if rate < 1e-9:
        poses[:, :3, 3] = times_s[:, None] * velocity
        return poses
    x, y, z = turn / rate
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = (rate * times_s)[:, None, None]
    twice = across @ across
    poses[:, :3, :3] += np.sin(angle) * across + (1 - np.cos(angle)) * twice
    path = angle * np.eye(3) + (1 - np.cos(angle)) * across + (angle - np.sin(angle)) * twice
    poses[:, :3, 3] = path @ velocity / rate
    return poses


class MountedPose(Protocol):
    """The keys of a section that say where a sensor is mounted."""

    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def z_m(self) -> float: ...
    @property
    def roll_deg(self) -> float: ...
    @property
    def pitch_deg(self) -> float: ...
    @property
    def yaw_deg(self) -> float: ...


def mounting(sensor: MountedPose) -> Float64:
    """`base_SE3_sensor` (4, 4): roll, then pitch (positive is down), then yaw, about fixed axes (REP-103)."""
    roll, pitch, yaw = np.deg2rad([sensor.roll_deg, sensor.pitch_deg, sensor.yaw_deg])
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return se3(about_z @ about_y @ about_x, (sensor.x_m, sensor.y_m, sensor.z_m))
