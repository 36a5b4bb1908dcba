"""Which of several LiDARs is used, in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

Record = Callable[..., Path]


def test_the_default_of_several_is_said_once(
    tmp_path: Path, record_fleet: Record, capsys: pytest.CaptureFixture[str]
) -> None:
    reader = BagReader(record_fleet(tmp_path / "fleet"))
    notice_default_lidar(reader, "/ego/roof/points")
    assert capsys.readouterr().err == ""
    notice_default_lidar(reader)
    assert capsys.readouterr().err == (
        f"note: {tmp_path}/fleet has 3 LiDARs; /ego/lidar/points is used by default, lidar chooses another: "
        "/bus_3/front/points or /ego/roof/points\n"
    )
    notice_default_lidar(reader)
    assert capsys.readouterr().err == ""


def test_one_needs_no_notice(tmp_path: Path, record: Record, capsys: pytest.CaptureFixture[str]) -> None:
    notice_default_lidar(BagReader(record(tmp_path / "bag", frames=1)))
    assert capsys.readouterr().err == ""


def test_without_a_default_one_has_to_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with BagWriter(tmp_path / "two", provenance={}) as bag:
        for name in ("left", "right"):
            cloud = cloud_to_cdr(np.zeros(1, POINT_DTYPE), 0, name)
            bag.write_cdr(VehicleTopics(name).lidar_points, cloud, 0)
    notice_default_lidar(BagReader(tmp_path / "two"))
    assert capsys.readouterr().err == (
        f"note: {tmp_path}/two has 2 LiDARs; name one by lidar: /left/lidar/points or /right/lidar/points\n"
    )
