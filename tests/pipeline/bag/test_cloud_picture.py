"""Frames from above, through the command line: what the picture says of a cloud and of an attack on it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from first_words import without_progress
from typer.testing import CliRunner

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.messages.cloud import Cloud, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

EGO = VehicleTopics()

Record = Callable[..., Path]
Change = Callable[[Cloud], Cloud]


@pytest.fixture
def clean(tmp_path: Path, record: Record) -> Path:
    (tmp_path / "drive").mkdir()
    return record(tmp_path / "drive" / "clean", frames=3)


def attack(clean: Path, name: str, change: Change, frames: tuple[int, ...] = (0, 1, 2)) -> Path:
    """An adversarial bag with changed clouds of these frames, and no ground truth."""
    stamps_ns = BagReader(clean).log_times_ns(EGO.lidar_points.name)
    with BagWriter(clean.with_name(name), provenance={"kind": "attack"}) as writer:
        for frame in read_frames(clean):
            if frame.index in frames:
                cdr = cloud_to_cdr(change(frame.cloud), frame.stamp_ns, EGO.lidar_frame)
                writer.write_cdr(EGO.lidar_points, cdr, int(stamps_ns[frame.index]))
    return clean.with_name(name)


def plot(*words: object, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["plot", *map(str, words)])
    assert done.exit_code == code, done.output
    return without_progress(done.output)


def texts(svg: Path) -> str:
    """All texts of an SVG, which matplotlib keeps as comments beside their outlines."""
    return "\n".join(re.findall(r"<!-- (.*?) -->", svg.read_text(encoding="utf-8")))


def test_a_clean_cloud_has_its_boxes_and_a_scale(clean: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.svg"
    assert f"picture: {out}" in plot(clean.parent, "--cloud", 1, "-o", out)
    found = texts(out)
    assert "drive, frame 1 of /ego/lidar/points" in found
    assert "200 points;" in found
    assert "1 true box" in found
    assert re.search(r"^10 m$", found, re.MULTILINE)
    assert "removed" not in found
    drawn = out.read_bytes()
    assert b"<dc:date>" not in drawn
    plot(clean, "--cloud", 1, "-o", out, "--overwrite")
    assert out.read_bytes() == drawn


@pytest.mark.parametrize("suffix", ["png", "pdf"])
def test_the_format_can_be_named(clean: Path, tmp_path: Path, suffix: str) -> None:
    plot(clean, "--cloud", 0, "-o", tmp_path / "frame", "--format", suffix)
    assert (tmp_path / f"frame.{suffix}").read_bytes()[:5] in (b"\x89PNG\r", b"%PDF-")


def _moved(cloud: Cloud) -> Cloud:
    cloud = cloud.copy()
    cloud["x"][:7] += 1.0
    cloud["intensity"][7:9] += 0.5
    return cloud


@pytest.mark.parametrize(
    ("change", "entries"),
    [
        (lambda cloud: cloud[5:], ["5 points removed"]),
        (lambda cloud: np.concatenate([cloud[1:], cloud[:4], cloud[:1]]), ["4 points added"]),
        (_moved, ["7 points moved", "2 points with another intensity"]),
        (lambda cloud: cloud, ["no point differs from the clean cloud"]),
    ],
)
def test_touched_points_are_counted_in_the_legend(
    clean: Path, tmp_path: Path, change: Change, entries: list[str]
) -> None:
    bag, out = attack(clean, "attacked", change), tmp_path / "a.svg"
    plot(clean, "--cloud", 2, "--attacked", bag, "-o", out)
    legend = re.findall(r"^\d+ points? (?:removed|added|moved|with .*)$|^no point .*$", texts(out), re.M)
    assert legend == entries
    assert "1 true box" in texts(out)
    plot(bag, "--cloud", 2, "-o", out, "--overwrite")  # compared with the clean bag beside it
    assert "attacked, frame 2" in texts(out)
    assert set(entries) <= set(texts(out).splitlines())


def test_what_cannot_be_drawn_is_one_line(clean: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    few = attack(clean, "few", lambda cloud: cloud[5:], frames=(0, 2))
    for words, message in (
        ((clean, "--cloud", 3), "clean has no frame 3 of /ego/lidar/points; choose from 0 to 2"),
        ((clean, "--cloud", 1, "--attacked", few), "lacks frame 1 of .*; both have the frames 0, 2"),
        ((clean, "--attacked", few), "choose one with --cloud FRAME"),
        (
            (clean, "--cloud", 0, "--lidar", "/ego/lidar/point"),
            r"no clouds on /ego/lidar/point; it has .*; did you mean .*\?",
        ),
        ((clean,), "has no V2X statistics; .*--cloud FRAME"),
    ):
        text = plot(*words, "-o", out, code=2)
        assert re.fullmatch(rf"advpipe: .*{message}.*\n", text), text
    assert not out.exists()


def test_odd_clouds_are_drawn(tmp_path: Path, clean: Path) -> None:
    def spoil(cloud: Cloud) -> Cloud:
        cloud = cloud.copy()
        cloud["z"][:9], cloud["x"][9:20] = np.nan, np.inf
        cloud["y"][20] = 1e30
        return cloud

    bag = attack(clean, "odd", spoil)
    plot(bag, "--cloud", 0, "-o", tmp_path / "odd.png")
    empty = attack(clean, "empty", lambda cloud: cloud[:0])
    plot(empty, "--cloud", 0, "-o", tmp_path / "empty.png")
    assert (tmp_path / "empty.png").is_file()
