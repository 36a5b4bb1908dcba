"""Clouds in files: what other programs write comes back to the bit, and damage ends in one line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.stages.import_.pcd_file import unpack_lzf
from advpipe.stages.import_.point_fields import MOST_POINTS, cloud_of_fields
from advpipe.stages.import_.point_files import parse_columns, read_point_file

sys.path.insert(0, str(Path(__file__).parent))

from point_bytes import literal_lzf, pcd, ply, some_points

VERTEX = b"ply\nformat ascii 1.0\nelement vertex 1\n"

FORMS = {
    "text.pcd": lambda points: pcd(points, "ascii"),
    "binary.pcd": pcd,
    "packed.pcd": lambda points: pcd(points, "binary_compressed"),
    "text.ply": lambda points: ply(points, ""),
    "little.ply": ply,
    "BIG.PLY": lambda points: ply(points, ">"),
}


def write(folder: Path, name: str, data: bytes) -> Path:
    (folder / name).write_bytes(data)
    return folder / name


@pytest.mark.parametrize("name", FORMS)
def test_all_fields_come_back(name: str, tmp_path: Path) -> None:
    points = some_points()
    cloud = read_point_file(write(tmp_path, name, FORMS[name](points)), None)
    assert cloud.dtype == POINT_DTYPE
    for field in ("x", "y", "z", "intensity", "ring"):
        assert np.array_equal(cloud[field], points[field]), field
    assert np.allclose(cloud["time"], points["t"] * 1e-9, rtol=0, atol=1e-8)


@pytest.mark.oracle
@pytest.mark.parametrize("options", [{"write_ascii": True}, {}, {"compressed": True}], ids=str)
@pytest.mark.parametrize("suffix", [".pcd", ".ply"])
def test_what_open3d_writes_is_read_and_the_reverse(suffix: str, options: dict, tmp_path: Path) -> None:
    from advpipe.pipeline.core.open3d_library import o3d

    points, rng = some_points(), np.random.default_rng(1)
    xyz = np.stack([points[name] for name in "xyz"], axis=1)
    xyz[100:200] = xyz[0]  # what LZF packs
    drawn = o3d.t.geometry.PointCloud(xyz)
    drawn.point.intensity = rng.uniform(0, 1, (300, 1)).astype(np.float32)
    file = tmp_path / f"theirs{suffix}"
    assert o3d.t.io.write_point_cloud(str(file), drawn, **options)
    cloud = read_point_file(file, None)
    atol = 1e-3 if "write_ascii" in options else 0  # six digits
    assert np.allclose(np.stack([cloud[name] for name in "xyz"], axis=1), xyz, rtol=0, atol=atol)
    assert np.allclose(cloud["intensity"], drawn.point.intensity.numpy()[:, 0], rtol=0, atol=atol)
    data = (pcd if suffix == ".pcd" else ply)(points)
    theirs = o3d.t.io.read_point_cloud(str(write(tmp_path, f"ours{suffix}", data)))
    assert np.array_equal(theirs.point.positions.numpy()[:, 0], points["x"])


def test_lzf_copies_what_it_is_just_writing() -> None:
    assert unpack_lzf(b"\x01ab" + bytes([0x20 | 0, 1]), 5) == b"ababa"
    assert unpack_lzf(b"\x00a" + bytes([0xE0, 91, 0]), 101) == b"a" * 101
    assert unpack_lzf(literal_lzf(bytes(range(100))), 100) == bytes(range(100))
    for packed in (b"\x20\x05", b"\x05ab", b"\xe0", b"\x00a\xe0\xff\x00"):
        with pytest.raises(AdvpipeError, match="damaged"):
            unpack_lzf(packed, 4)


def test_tables_have_the_columns_that_are_named(tmp_path: Path) -> None:
    table = np.random.default_rng(0).uniform(0, 1, (50, 6)).astype(np.float32)
    table[:, 4] = np.arange(50)
    table.tofile(tmp_path / "a.bin")
    np.save(tmp_path / "a.npy", table.astype(np.float64))
    names = parse_columns("y, x, z, _, ring, intensity")
    for name in ("a.bin", "a.npy"):
        cloud = read_point_file(tmp_path / name, names, 0.5)
        assert np.array_equal(cloud["y"], table[:, 0])
        assert np.array_equal(cloud["ring"], np.arange(50))
        assert np.array_equal(cloud["intensity"], table[:, 5] * np.float32(0.5))
    np.save(tmp_path / "named.npy", some_points())
    assert np.array_equal(read_point_file(tmp_path / "named.npy", None)["ring"], some_points()["ring"])
    with pytest.raises(AdvpipeError, match=r"6 columns, not the 4 of x,y,z,intensity"):
        read_point_file(tmp_path / "a.npy", None)


@pytest.mark.parametrize(
    ("columns", "complaint"),
    [("x,y", "z missing"), ("x,y,z,x", "twice"), ("x,y,z,intensty", "did you mean 'intensity'")],
)
def test_columns_that_mean_nothing(columns: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        parse_columns(columns)


HEADER = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {n}\nHEIGHT 1\nPOINTS {n}\n"
DAMAGED = {
    "empty.pcd": (b"", "no line DATA"),
    "endless.pcd": (b"x" * 10_000, "no line DATA"),
    "many.pcd": (HEADER.format(n=MOST_POINTS + 1).encode() + b"DATA binary\n", "a cloud has at most"),
    "short.pcd": (HEADER.format(n=9).encode() + b"DATA binary\n" + bytes(100), "truncated"),
    "huge.pcd": (HEADER.format(n=10**7).encode() + b"DATA binary\n", "truncated: 120,000,000 bytes"),
    "words.pcd": (HEADER.format(n=1).encode() + b"DATA ascii\na b c\n", "not lines of numbers"),
    "cut.pcd": (HEADER.format(n=2).encode() + b"DATA ascii\n1 2 3\n", "declares 2 of 3"),
    "form.pcd": (HEADER.format(n=2).encode() + b"DATA zip\n", "stored as 'zip'"),
    "bomb.pcd": (
        HEADER.format(n=10**7).encode()
        + b"DATA binary_compressed\n\2\0\0\0"
        + (12 * 10**7).to_bytes(4, "little")
        + b"\0a",
        "compressed points are damaged",
    ),
    "fields.pcd": (
        HEADER.format(n=1).replace("x y z", "a b c").encode() + b"DATA ascii\n1 2 3\n",
        "no field x, y, z",
    ),
    "empty.ply": (b"", "not a PLY file"),
    "faces.ply": (VERTEX.replace(b"vertex", b"face") + b"end_header\n", "no vertices"),
    "list.ply": (VERTEX + b"property list uchar int v\nend_header\n", "has a list"),
    "many.ply": (b"ply\nformat ascii 1.0\nelement vertex 99999999999\n", "a cloud has at most"),
    "short.ply": (ply(some_points())[:-1], "truncated"),
    "kind.ply": (VERTEX + b"property complex x\nend_header\n", "header is damaged"),
    "odd.bin": (bytes(17), "17 bytes are not a whole number of points of 4"),
    "empty.npy": (b"", "not a .npy file"),
    "zip.npy": (b"PK\3\4", "not a .npy file"),
    "cut.npy": (
        b"\x93NUMPY\1\0v\0{'descr': '<f4', 'fortran_order': False, 'shape': (99, 4), }" + b" " * 55 + b"\n",
        "not a .npy file",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_ends_in_one_line_with_the_file(name: str, tmp_path: Path) -> None:
    data, complaint = DAMAGED[name]
    file = write(tmp_path, name, data)
    with pytest.raises(AdvpipeError) as caught:
        read_point_file(file, None)
    text = str(caught.value)
    assert text.startswith(f"{file}: ")
    assert complaint in text
    assert "\n" not in text


def test_objects_in_npy_are_not_unpickled(tmp_path: Path) -> None:
    np.save(tmp_path / "o.npy", np.array([{}, {}], dtype=object), allow_pickle=True)
    with pytest.raises(AdvpipeError, match="not a"):
        read_point_file(tmp_path / "o.npy", None)


def test_an_unreadable_file_is_named(tmp_path: Path) -> None:
    for name in ("a.pcd", "a.ply", "a.npy", "a.bin"):
        (tmp_path / name).mkdir()
        with pytest.raises(AdvpipeError, match=r"cannot be read"):
            read_point_file(tmp_path / name, None)


def test_times_of_drivers_become_seconds_after_the_stamp() -> None:
    stamp_ns = 1_700_000_000_000_000_000
    xyz = dict.fromkeys("xyz", np.zeros(3, np.float32))
    expected = [0.0, 0.05, 0.1]
    offsets = np.array(expected)
    for name, values in {
        "time": offsets.astype(np.float32),
        "t": (offsets * 1e9).astype(np.uint32),
        "offset_time": (offsets * 1e9).astype(np.uint32),
        "timestamp": stamp_ns / 1e9 + offsets,  # float64: 0.2 microseconds
        "Timestamp": stamp_ns + (offsets * 1e9).astype(np.int64),
        "scalar_time": (offsets * 1e6).astype(np.float32),
    }.items():
        times = cloud_of_fields({**xyz, name: values}, stamp_ns)["time"]
        assert np.allclose(times, expected, rtol=0, atol=1e-6), name
    later = cloud_of_fields({**xyz, "timestamp": stamp_ns / 1e9 - 0.1 + offsets}, stamp_ns)["time"]
    assert np.allclose(later, [-0.1, -0.05, 0.0], rtol=0, atol=1e-6)
    other_clock = cloud_of_fields({**xyz, "timestamp": 5e8 + offsets}, stamp_ns)["time"]
    assert np.allclose(other_clock, expected, rtol=0, atol=1e-6)


def test_a_channel_that_is_none_is_refused() -> None:
    fields = {**dict.fromkeys("xyz", np.zeros(2)), "ring": np.array([0.0, 1e6])}
    with pytest.raises(AdvpipeError, match="not 0 to 65,535"):
        cloud_of_fields(fields, None)
