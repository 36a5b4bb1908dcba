"""Which of several LiDARs is used, in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
from advpipe.pipeline.bag.reader import BagReader

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
