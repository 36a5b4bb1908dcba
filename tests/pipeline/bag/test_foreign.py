"""Other formats are told by name, and what the error says to do makes a bag that advpipe reads.

The oracle is `rosbags`, which writes the ROS 1 and the SQLite bags, and converts them.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from first_words import without_progress
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import UsageError

CLOUD = "sensor_msgs/msg/PointCloud2"


def record(path: Path, *, ros1: bool) -> None:
    """Two clouds of five points."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    kinds = store.types
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    fields = [
        kinds["sensor_msgs/msg/PointField"](name=name, offset=4 * place, datatype=7, count=1)
        for place, name in enumerate(("x", "y", "z", "intensity"))
    ]
    with (
        Ros1Writer(path) if ros1 else Ros2Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as bag
    ):
        connection = bag.add_connection("/points", CLOUD, typestore=store)
        for number in range(2):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=10, nanosec=number * 100_000_000)
            counted = {"seq": number} if ros1 else {}
            header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="lidar", **counted)
            cloud = kinds[CLOUD](
                header=header,
                height=1,
                width=5,
                fields=fields,
                is_bigendian=False,
                point_step=16,
                row_step=80,
                data=np.zeros(80, np.uint8),
                is_dense=True,
            )
            bag.write(connection, 10**10 + number * 10**8, serialize(cloud, CLOUD))


def refusal(path: Path) -> str:
    with pytest.raises(UsageError) as caught:
        resolve_bag(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.oracle
@pytest.mark.parametrize("ros1", [True, False], ids=["ROS 1", "bare .db3"])
def test_the_command_in_the_error_makes_a_bag(
    ros1: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recorded = Path("my drive.bag" if ros1 else "my drive")
    record(recorded, ros1=ros1)
    if not ros1:
        (recorded / "metadata.yaml").unlink()
    source = recorded if ros1 else recorded / "my drive.db3"
    text = refusal(source)
    assert ("is a ROS 1 bag" if ros1 else "is the SQLite database of a ROS 2 bag") in text
    assert f"`advpipe import rosbag {shlex.quote(str(source))} --out " in text
    command = re.search(r"or convert it with `(.*)`", text)
    assert command is not None
    program, *words = shlex.split(command[1])
    assert program == "rosbags-convert"
    script = Path(sys.executable).with_name(program)
    subprocess.run([sys.executable, str(script), *words], check=True, capture_output=True)
    assert describe(resolve_bag(Path("my drive-mcap"))).clouds == 2


def test_a_folder_says_what_is_in_it(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("#ROSBAG V2.0\n")
    assert "is not a bag: neither a data set" in refusal(tmp_path)
    (tmp_path / "000000.bin").write_bytes(bytes(160))
    assert re.match(
        rf"{tmp_path} is not a bag: {tmp_path}/000000\.bin looks like a KITTI cloud", refusal(tmp_path)
    )


@pytest.mark.parametrize(
    ("inside", "title", "form"),
    [
        ("v1.0-mini/scene.json", "nuScenes", "nuscenes"),
        ("training/velodyne/000000.bin", "KITTI", "kitti"),
        ("sequences/00/velodyne/000000.bin", "KITTI", "kitti"),
        ("2011_09_26/2011_09_26_drive_0001_sync/velodyne_points/data/0.bin", "KITTI", "kitti"),
        ("log/sensors/lidar/1.feather", "Argoverse 2", "av2"),
        ("2021_08_16/641/000068.pcd", "OPV2V", "opv2v"),
    ],
)
def test_folders_of_other_data_sets_say_how_to_import_them(
    inside: str, title: str, form: str, tmp_path: Path
) -> None:
    file = tmp_path / "drive" / inside
    file.parent.mkdir(parents=True)
    file.write_bytes(bytes(16))
    folder = tmp_path / "drive"
    assert refusal(folder) == (
        f"{folder} is not a bag but looks like {title}; make a data set of it with "
        f"`advpipe import {form} {folder} --out datasets/drive`"
    )


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        (
            "000000.bin",
            bytes(160),
            "000000.bin looks like a KITTI cloud; make a data set of its folder with `advpipe import ",
        ),
        ("old.bag", b"#ROSBAG V2.0\n", "old.bag is a ROS 1 bag; `advpipe import rosbag "),
        ("0.db3", b"SQLite format 3\0", "0.db3 is the SQLite database of a ROS 2 bag"),
        ("renamed.mcap", b"SQLite format 3\0", "renamed.mcap is the SQLite database of a ROS 2 bag"),
        ("0.pcd", b"# .PCD v0.7\n", "0.pcd is one point cloud; make a data set of its folder with `advpipe "),
        ("0.ply", b"ply\nformat ascii 1.0\n", "0.ply is one point cloud; make a data set of its folder "),
        ("0.npy", b"\x93NUMPY\x01\0", "0.npy is one point cloud; make a data set of its folder with "),
        ("odd.pcd", b"\0" * 20, "is not an MCAP file"),
        ("odd.bin", bytes(161), "is not an MCAP file"),
        ("empty.bin", b"", "is empty, not an MCAP file"),
    ],
)
def test_each_command_says_so_in_one_line(
    name: str, content: bytes, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    for words in (["inspect"], ["attack"], ["evaluate"]):
        with pytest.raises(SystemExit) as ended:
            app([*words, str(tmp_path / name)])
        assert ended.value.code == 2
        (line,) = without_progress(capsys.readouterr().err).splitlines()
        assert line.startswith("advpipe: ")
        assert expected in line
