"""Labels of points as Parquet: every row in its order, whatever groups the rows lie in."""

from __future__ import annotations

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.labels import clouds
from advpipe.pipeline.labels.clouds import LabelledFrame, PointTables
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.messages.cloud import POINT_DTYPE, StampedCloud

CLEAN = np.zeros(9, POINT_DTYPE)


def moved(frame):
    """Of frame n, its first n points, and the last one is removed; of the frame 0 none is touched."""
    if not frame:
        return PointLabels.removed(np.zeros(0, np.int64))
    actions = np.array(["moved"] * frame + ["removed"])
    return PointLabels(np.append(np.arange(frame), 8), actions, np.append(np.full(frame, 0.5), np.nan))


@pytest.mark.parametrize(("group_rows", "groups"), [(1, [2, 3, 4, 5]), (5, [5, 9]), (1000, [14])])
def test_rows_come_back_from_their_groups(tmp_path, monkeypatch, group_rows, groups):
    monkeypatch.setattr(clouds, "GROUP_ROWS", group_rows)
    with PointTables(tmp_path) as written:
        for frame in range(5):
            topic, clean = f"/lidar_{frame % 2}", StampedCloud(frame * 100, "lidar", CLEAN)
            written.add(LabelledFrame(topic, frame, "mine", clean, 9), moved(frame))
    file = pq.ParquetFile(tmp_path / "labels.parquet")
    assert [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)] == groups
    rows = file.read().to_pylist()
    assert [row["frame"] for row in rows] == [n for n in range(5) if n for _ in range(n + 1)]
    assert [row["point"] for row in rows if row["frame"] == 3] == [0, 1, 2, 8]
    assert {(row["topic"], row["stamp_ns"]) for row in rows if row["frame"] == 3} == {("/lidar_1", 300)}
    assert [row["action"] for row in rows if row["frame"] == 2] == ["moved", "moved", "removed"]
    assert pq.read_table(tmp_path / "frames.parquet")["frame"].to_pylist() == [0, 1, 2, 3, 4]


def test_nothing_touched_is_a_table_too(tmp_path):
    with PointTables(tmp_path) as written:
        written.add(LabelledFrame("/lidar", 0, "mine", StampedCloud(0, "lidar", CLEAN), 9), moved(0))
    assert pq.read_table(tmp_path / "labels.parquet").num_rows == 0
