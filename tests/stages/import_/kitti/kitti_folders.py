"""Writes small folders of KITTI's forms, with values that are easy to compute by hand."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

P = "700 0 600 0 0 700 180 0 0 0 1 0"
P2 = "700 0 600 42 0 700 180 0.7 0 0 1 0.002"
R0 = "1 0 0 0 1 0 0 0 1"
VELO_TO_CAM = "0 -1 0 0 0 0 -1 0 1 0 0 -0.25"
"""The camera stands .25 m ahead of the LiDAR: x right, y down, z forward."""
IMU_TO_VELO = "1 0 0 -0.8 0 1 0 0.3 0 0 1 -0.8"

CALIBRATION = "".join(
    f"{key}: {numbers}\n"
    for key, numbers in {
        "P0": P,
        "P1": P,
        "P2": P2,
        "P3": P,
        "R0_rect": R0,
        "Tr_velo_to_cam": VELO_TO_CAM,
        "Tr_imu_to_velo": IMU_TO_VELO,
    }.items()
)

CAR = "Car 0.10 1 -1.57 600.00 170.00 700.00 260.00 1.50 1.60 4.00 2.00 1.70 9.75 -1.57"
"""In the LiDAR's frame: 10 m ahead, 2 m to the right, bottom 1.7 m below, heading forward."""
VAN = "Van 0.00 0 1.20 400.00 150.00 480.00 230.00 2.00 1.90 5.00 -3.00 1.80 20.00 0.50"
DONT_CARE = "DontCare -1 -1 -10 100.00 150.00 140.00 180.00 -1 -1 -1 -1000 -1000 -1000 -10"


def points(seed: int, count: int = 300) -> np.ndarray:
    """A table (N, 4) of float32: x, y, z and intensity, on the ground and around (10, -2)."""
    rng = np.random.default_rng(seed)
    table = np.column_stack(
        [
            rng.uniform(-40, 40, count),
            rng.uniform(-20, 20, count),
            np.full(count, -1.7),
            rng.uniform(0, 1, count),
        ]
    ).astype("<f4")
    table[:60, 0] = rng.uniform(8.1, 11.9, 60)
    table[:60, 1] = rng.uniform(-2.7, -1.3, 60)
    table[:60, 2] = rng.uniform(-1.6, -0.3, 60)
    return table


def write_text(file: Path, text: str) -> None:
    """The file with its folders."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")


def write_cloud(file: Path, seed: int) -> None:
    """Points of a seed as KITTI's .bin."""
    file.parent.mkdir(parents=True, exist_ok=True)
    points(seed).tofile(file)


def write_png(file: Path, width: int, height: int) -> None:
    """A black picture, written by the PNG specification."""
    file.parent.mkdir(parents=True, exist_ok=True)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress((b"\0" * (width + 1)) * height)
    file.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def write_object_frames(
    root: Path, names: tuple[str, ...] = ("000003", "000007"), part: str = "training"
) -> Path:
    """Frames of the object benchmark: a car, a van, a DontCare in each."""
    for seed, name in enumerate(names):
        write_cloud(root / part / "velodyne" / f"{name}.bin", seed)
        write_text(root / part / "calib" / f"{name}.txt", CALIBRATION)
        if part == "training":
            write_text(root / part / "label_2" / f"{name}.txt", f"{CAR}\n{VAN}\n{DONT_CARE}\n")
    return root


def write_raw_drive(date: Path, number: str = "0005", frames: int = 3, speed_mps: float = 10.0) -> Path:
    """A raw drive due north; a car stands, another drives 5 m/s ahead of the vehicle, both tracked."""
    drive = date / f"{date.name}_drive_{number}_sync"
    cameras = "".join(f"P_rect_{camera:02d}: {P2 if camera == 2 else P}\n" for camera in range(4))
    write_text(
        date / "calib_cam_to_cam.txt",
        f"calib_time: 09-Jan-2012 13:57:47\nR_rect_00: {R0}\nS_rect_02: 1.242e+03 3.75e+02\n{cameras}",
    )
    write_text(date / "calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 -0.25\n")
    write_text(date / "calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n")
    stamps, degree_m = [], 6378137.0 * np.pi / 180
    for frame in range(frames):
        write_cloud(drive / "velodyne_points" / "data" / f"{frame:010d}.bin", frame)
        stamps.append(f"2011-09-26 13:02:{25 + frame / 10:012.9f}")
        latitude = 49.0 + speed_mps * frame / 10 / degree_m
        fix = [latitude, 8.4, 110.0, 0.0, 0.0, np.pi / 2, *[0.0] * 24]
        write_text(drive / "oxts" / "data" / f"{frame:010d}.txt", " ".join(map(repr, map(float, fix))) + "\n")
    write_text(drive / "velodyne_points" / "timestamps.txt", "\n".join(stamps) + "\n")
    step = speed_mps / 10
    standing = [(20 - step * frame, 2.0) for frame in range(frames)]
    driving = [(15 + (5 - speed_mps) / 10 * frame, -2.0) for frame in range(frames)]
    items = (
        _tracklet("Car", standing, 0)
        + _tracklet("Car", driving, 1)
        + _tracklet("Person (sitting)", standing[:1], 0)
    )
    write_text(
        drive / "tracklet_labels.xml",
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        f"<boost_serialization><tracklets><count>3</count>{items}</tracklets></boost_serialization>\n",
    )
    return drive


def _tracklet(class_name: str, places: list[tuple[float, float]], occlusion: int) -> str:
    poses = "".join(
        f"<item><tx>{x}</tx><ty>{y}</ty><tz>-1.7</tz><rx>0</rx><ry>0</ry><rz>0.1</rz><state>2</state>"
        f"<occlusion>{occlusion}</occlusion><truncation>0</truncation></item>"
        for x, y in places
    )
    return (
        f"<item><objectType>{class_name}</objectType><h>1.5</h><w>1.6</w><l>4</l><first_frame>0</first_frame>"
        f"<poses><count>{len(places)}</count><item_version>2</item_version>{poses}</poses></item>"
    )


def write_odometry(root: Path, number: str = "04", frames: int = 3) -> Path:
    """A sequence straight ahead, 1 m a frame, turning by .1 rad to the left from the second frame on."""
    sequence = root / "sequences" / number
    projections = "".join(f"P{camera}: {P2 if camera == 2 else P}\n" for camera in range(4))
    write_text(sequence / "calib.txt", f"{projections}Tr: {VELO_TO_CAM}\n")
    write_text(sequence / "times.txt", "".join(f"{frame / 10:e}\n" for frame in range(frames)))
    rows = []
    for frame in range(frames):
        write_cloud(sequence / "velodyne" / f"{frame:06d}.bin", frame)
        angle = -0.1 if frame else 0.0  # about the camera's y axis, which points down
        c, s = np.cos(angle), np.sin(angle)
        rows.append(f"{c} 0 {s} 0 0 1 0 0 {-s} 0 {c} {frame}")
    write_text(root / "poses" / f"{number}.txt", "\n".join(rows) + "\n")
    return sequence
