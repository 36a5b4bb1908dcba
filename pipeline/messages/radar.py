"""Radar scans: a numpy structured array, as radar_msgs/RadarScan and as sensor_msgs/PointCloud2."""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.messages.cloud import points_to_cdr

RadarReturns = npt.NDArray[np.void]

SCAN_TYPE = "radar_msgs/msg/RadarScan"

RETURN_DTYPE = np.dtype(
    [("range", "<f4"), ("azimuth", "<f4"), ("elevation", "<f4"), ("velocity", "<f4"), ("amplitude", "<f4")]
)
"""One detection, as in radar_msgs/RadarReturn: metres, radians, m/s (positive: moves away), dB over noise."""

RADAR_POINT_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("velocity", "<f4"), ("rcs", "<f4"), ("snr", "<f4")]
)
"""The same as a point: metres, m/s, dBsm, dB."""


class StampedScan(NamedTuple):
    """A scan with the header of its message."""

    stamp_ns: int
    frame_id: str
    returns: RadarReturns


def xyz_of_returns(returns: RadarReturns) -> npt.NDArray[np.float64]:
    """Positions (N, 3) of returns (N,) in the radar's frame."""
    range_m, azimuth, elevation = (
        returns[name].astype(np.float64) for name in ("range", "azimuth", "elevation")
    )
    level_m = range_m * np.cos(elevation)
    return np.stack([level_m * np.cos(azimuth), level_m * np.sin(azimuth), range_m * np.sin(elevation)], 1)


def scan_to_cdr(returns: RadarReturns, stamp_ns: int, frame_id: str) -> bytes:
    """Serialise returns (N,) of `RETURN_DTYPE` as radar_msgs/RadarScan."""
    writer = Cdr()
    writer.header(stamp_ns, frame_id)
    writer.uint32(len(returns))
    writer.body += returns.tobytes()
    return bytes(writer)


def radar_cloud_to_cdr(returns: RadarReturns, rcs_dbsm: npt.ArrayLike, stamp_ns: int, frame_id: str) -> bytes:
    """Serialise returns (N,) with their RCS (N,) as sensor_msgs/PointCloud2 of `RADAR_POINT_DTYPE`."""
    points = np.zeros(len(returns), RADAR_POINT_DTYPE)
    points["x"], points["y"], points["z"] = xyz_of_returns(returns).T
    points["velocity"], points["snr"], points["rcs"] = returns["velocity"], returns["amplitude"], rcs_dbsm
    return points_to_cdr(points, stamp_ns, frame_id)


def scan_from_cdr(cdr: bytes) -> StampedScan:
    """The returns (N,) of a serialised radar_msgs/RadarScan, a read-only view of `cdr`.

    Raises AdvpipeError for a message that is none, and for values that are not finite.
    """
    try:
        if cdr[:2] != b"\x00\x01":
            raise ValueError("only little-endian CDR is supported")
        seconds, nanoseconds, length = struct.unpack_from("<iII", cdr, 4)
        frame_id = bytes(cdr[16 : 16 + length]).rstrip(b"\0").decode()
        place = 16 + length + -length % 4
        (count,) = struct.unpack_from("<I", cdr, place)
        if len(frame_id) > 255 or count * RETURN_DTYPE.itemsize != len(cdr) - place - 4:
            raise ValueError(f"{count} returns do not fit {len(cdr)} bytes")
        returns = np.frombuffer(cdr, RETURN_DTYPE, count, place + 4)
        values = returns.view("<f4")
        if not (np.abs(values) < 1e6).all():
            raise ValueError("a value is not finite or beyond 1e6")
    except (struct.error, ValueError) as error:
        raise AdvpipeError(f"malformed RadarScan message: {error}") from None
    return StampedScan(seconds * 1_000_000_000 + nanoseconds, frame_id, returns)
