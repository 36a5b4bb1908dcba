import struct

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_from_cdr, cloud_to_cdr, xyzi
from advpipe.pipeline.messages.types import message_class, serialise, typestore

TYPE = "sensor_msgs/msg/PointCloud2"
STAMP_NS = 12_345_678_901


def random_cloud(points: int) -> np.ndarray:
    raw = np.random.default_rng(0).integers(0, 127, points * POINT_DTYPE.itemsize, dtype=np.uint8)
    return raw.view(POINT_DTYPE)


def foreign_cdr(points: np.ndarray, fields: list[tuple[str, int, int]], **changes: object) -> bytes:
    """A PointCloud2 serialised by rosbags; fields are (name, offset, datatype)."""
    PointField = message_class("sensor_msgs/msg/PointField")
    values = {
        "header": build.message_header(STAMP_NS, "other"),
        "height": 1,
        "width": len(points),
        "fields": [PointField(name=n, offset=o, datatype=d, count=1) for n, o, d in fields],
        "is_bigendian": False,
        "point_step": points.dtype.itemsize,
        "row_step": points.nbytes,
        "data": np.frombuffer(points.tobytes(), np.uint8),
        "is_dense": True,
    }
    return serialise(message_class(TYPE)(**{**values, **changes}), TYPE)


@pytest.mark.oracle
@pytest.mark.parametrize("points", [0, 1, 2, 3, 1000])
@pytest.mark.parametrize("frame_id", ["", "a", "ego/lidar"])
def test_bytes_equal_those_of_rosbags(points: int, frame_id: str) -> None:
    cloud = random_cloud(points)
    cdr = cloud_to_cdr(cloud, STAMP_NS, frame_id)
    message = typestore().deserialize_cdr(cdr, TYPE)
    assert bytes(typestore().serialize_cdr(message, TYPE)) == cdr
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 345_678_901)
    assert message.header.frame_id == frame_id
    assert (message.height, message.width, message.point_step, message.row_step) == (
        1,
        points,
        22,
        22 * points,
    )
    assert [(f.name, f.offset, f.datatype) for f in message.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
        ("intensity", 12, 7),
        ("ring", 16, 4),
        ("time", 18, 7),
    ]
    assert message.data.tobytes() == cloud.tobytes()


def test_advpipes_layout_is_read_without_a_copy() -> None:
    cloud = random_cloud(100)
    cdr = cloud_to_cdr(cloud, STAMP_NS, "ego/lidar")
    stamp_ns, frame_id, back = cloud_from_cdr(cdr)
    assert (stamp_ns, frame_id) == (STAMP_NS, "ego/lidar")
    assert back.tobytes() == cloud.tobytes()
    assert np.shares_memory(back, np.frombuffer(cdr, np.uint8))


def test_points_that_are_not_finite_are_kept_and_declared() -> None:
    cloud = np.zeros(2, POINT_DTYPE)
    cloud["y"][1] = np.nan
    cdr = cloud_to_cdr(cloud, 0, "lidar")
    assert not typestore().deserialize_cdr(cdr, TYPE).is_dense
    assert np.isnan(cloud_from_cdr(cdr).cloud["y"]).tolist() == [False, True]


def test_carlas_layout_is_read() -> None:
    points = np.array([(1, 2, 3, 0.5), (4, 5, 6, 0.25)], np.dtype([(n, "<f4") for n in "xyzi"]))
    cdr = foreign_cdr(points, [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7)])
    cloud = cloud_from_cdr(cdr).cloud
    assert xyzi(cloud).tolist() == [[1, 2, 3, 0.5], [4, 5, 6, 0.25]]
    assert not cloud["ring"].any()
    assert not cloud["time"].any()


def test_ousters_layout_with_padding_and_nanoseconds_is_read() -> None:
    dtype = np.dtype(
        {
            "names": ["x", "y", "z", "intensity", "t", "reflectivity", "ring", "ambient", "range"],
            "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2", "<u2", "<u2", "<u4"],
            "offsets": [0, 4, 8, 16, 20, 24, 26, 28, 32],
            "itemsize": 48,
        }
    )
    points = np.zeros(2, dtype)
    points["x"], points["intensity"], points["ring"], points["t"] = (
        [1, 2],
        [200, 900],
        [3, 127],
        [0, 50_000_000],
    )
    codes = {"<f4": 7, "<u4": 6, "<u2": 4}
    fields = [(name, dtype.fields[name][1], codes[dtype.fields[name][0].str]) for name in dtype.names]
    cloud = cloud_from_cdr(foreign_cdr(points, fields)).cloud
    assert cloud["x"].tolist() == [1, 2]
    assert cloud["intensity"].tolist() == [200, 900]
    assert cloud["ring"].tolist() == [3, 127]
    assert cloud["time"].tolist() == pytest.approx([0, 0.05])


def test_big_endian_clouds_are_read() -> None:
    points = np.zeros(2, np.dtype([("x", ">f4"), ("y", ">f4"), ("z", ">f8"), ("ring", ">u2")]))
    points["x"], points["y"], points["z"], points["ring"] = [1, 4], [2, 5], [3, 6], [7, 300]
    fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 8), ("ring", 16, 4)]
    cloud = cloud_from_cdr(foreign_cdr(points, fields, is_bigendian=True)).cloud
    assert xyzi(cloud).tolist() == [[1, 2, 3, 0], [4, 5, 6, 0]]
    assert cloud["ring"].tolist() == [7, 300]


def test_padded_rows_are_read() -> None:
    rows = np.zeros((2, 5), "<f4")  # a point (x, y, z) and 8 bytes of padding in each row
    rows[:, :3] = [[1, 2, 3], [4, 5, 6]]
    xyz_fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
    cdr = foreign_cdr(rows.ravel(), xyz_fields, height=2, width=1, point_step=12, row_step=20)
    assert xyzi(cloud_from_cdr(cdr).cloud).tolist() == [[1, 2, 3, 0], [4, 5, 6, 0]]


XYZ = np.zeros(10, np.dtype([(n, "<f4") for n in "xyz"]))
XYZ_FIELDS = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]


@pytest.mark.parametrize(
    ("changes", "fields", "reason"),
    [
        ({"width": 11}, XYZ_FIELDS, "do not fit"),
        ({"width": 2**32 - 1, "height": 2**32 - 1, "point_step": 0, "row_step": 0}, XYZ_FIELDS, ""),
        ({"point_step": 2**31, "row_step": 2**31}, XYZ_FIELDS, "do not fit"),
        ({"row_step": 0}, XYZ_FIELDS, "do not fit"),
        ({}, XYZ_FIELDS[:2], "no field z"),
        ({}, [*XYZ_FIELDS[:2], ("z", 9, 7)], ""),  # ends behind the point
        ({}, [*XYZ_FIELDS[:2], ("z", 2**31, 7)], ""),
    ],
)
def test_sizes_that_do_not_fit_are_refused(changes: dict, fields: list, reason: str) -> None:
    cdr = foreign_cdr(XYZ, fields, **changes)
    with pytest.raises(AdvpipeError, match=f"malformed PointCloud2 message: .*{reason}"):
        cloud_from_cdr(cdr)


def test_every_truncated_message_is_refused() -> None:
    cdr = cloud_to_cdr(random_cloud(3), STAMP_NS, "ego/lidar")
    for length in range(len(cdr) - 1):  # the last byte is is_dense, which reading does not need
        with pytest.raises(AdvpipeError):
            cloud_from_cdr(cdr[:length])


def test_changed_bytes_never_raise_another_error() -> None:
    cdr = cloud_to_cdr(random_cloud(3), STAMP_NS, "ego/lidar")
    rng = np.random.default_rng(1)
    for _ in range(3000):
        changed = bytearray(cdr)
        for place in rng.integers(0, len(cdr), 3):
            changed[place] = rng.integers(0, 256)
        try:
            assert len(cloud_from_cdr(bytes(changed)).cloud) <= len(cdr)
        except AdvpipeError:
            continue


def test_a_huge_field_count_is_refused_quickly() -> None:
    cdr = cloud_to_cdr(random_cloud(0), STAMP_NS, "")
    start = cdr.index(struct.pack("<I", 6), 4)
    with pytest.raises(AdvpipeError):
        cloud_from_cdr(cdr[:start] + struct.pack("<I", 2**32 - 1) + cdr[start + 4 :])
