"""What verify finds in forged images and labels of attacked cameras."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from camera_bags import FRONT, REAR, labels

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.compressed_image import encoded_like, image_from_cdr, image_to_cdr, pixels_of
from advpipe.stages.verify.run import verify


def _repaint(raw: RawMessage) -> bytes:
    """The image with a corner painted black."""
    image = image_from_cdr(raw.cdr)
    rgb = pixels_of(image.file).copy()
    rgb[:40, :40] = 0
    return image_to_cdr(replace(image, file=encoded_like(rgb, image.file)))


def _truncate(raw: RawMessage) -> bytes:
    """The image with half of its file."""
    image = image_from_cdr(raw.cdr)
    return image_to_cdr(replace(image, file=image.file[: len(image.file) // 2]))


def _restamp(raw: RawMessage) -> bytes:
    """The image with a stamp that no image of the clean bag has."""
    image = image_from_cdr(raw.cdr)
    return image_to_cdr(replace(image, stamp_ns=image.stamp_ns + 1))


def _forge(bag: Path, number: int, change: Callable[[RawMessage], bytes]) -> None:
    """Change one image of a bag, and write the bag again."""
    reader = BagReader(bag)
    every = list(reader.raw_messages(list(reader.topics)))
    provenance, beside = dict(reader.provenance), (bag / "camera_labels.parquet").read_bytes()
    resolved = (bag / "attack.yaml").read_bytes()
    shutil.rmtree(bag)
    with BagWriter(bag, provenance=provenance) as writer:
        (writer.folder / "camera_labels.parquet").write_bytes(beside)
        (writer.folder / "attack.yaml").write_bytes(resolved)
        count = -1
        for raw in every:
            count += raw.topic.name == FRONT
            hit = raw.topic.name == FRONT and count == number
            writer.copy(replace(raw, cdr=change(raw)) if hit else raw)


@pytest.mark.parametrize(
    ("name", "number", "change", "what"),
    [
        ("patch", 1, _repaint, "image 1 of .* was changed without a label"),
        ("patch", 5, _repaint, "image 5 of .* was painted on outside the rectangle of its label"),
        ("freeze", 6, _repaint, "image 6 of .* shows something else than its labels say"),
        ("delay", 5, _repaint, "image 5 of .* shows something else than its labels say"),
        ("patch", 5, _truncate, "an image cannot be decompressed"),
        ("patch", 5, _restamp, "holds an image at .* that is not of the clean bag"),
    ],
)
def test_verify_finds_a_forged_image(
    name: str,
    number: int,
    change: Callable[[RawMessage], bytes],
    what: str,
    camera_drive: Path,
    tmp_path: Path,
) -> None:
    for each in ("clean", name):
        shutil.copytree(camera_drive / each, tmp_path / each)
    _forge(tmp_path / name, number, change)
    found = [one.what for one in verify(tmp_path / name).findings if one.check == "images"]
    assert found
    assert re.search(what, " ".join(found)), found


def test_verify_measures_how_large_a_patch_is(camera_drive: Path, tmp_path: Path) -> None:
    """A bag whose attack declares less than the 1.2 m that it painted."""
    for each in ("clean", "patch"):
        shutil.copytree(camera_drive / each, tmp_path / each)
    row = labels(tmp_path / "patch")[0]
    wider = row["right_px"] + round(0.6 * (row["right_px"] - row["left_px"]))
    path = tmp_path / "patch" / "camera_labels.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    rows[0]["right_px"] = wider
    pq.write_table(pa.Table.from_pylist(rows, table.schema), path)
    (found,) = [one.what for one in verify(tmp_path / "patch").findings if one.check == "images"]
    assert re.search(
        r"exceeds the bounds of camera-patch: diagonal of what was painted on a road user", found
    )


@pytest.mark.parametrize(
    ("name", "damage", "what"),
    [
        ("drop", lambda row: None, "is missing without a label"),
        ("drop", lambda row: {**row, "attack": "camera-blind"}, "of camera-blind, which was not active"),
        ("drop", lambda row: {**row, "image": 10}, "missing without a label|labelled as dropped"),
        ("freeze", lambda row: {**row, "source": 2}, "shows something else"),
        ("freeze", lambda row: {**row, "source": 99}, "names no other image"),
        ("delay", lambda row: {**row, "delay_ns": 1}, "ns late, but labelled with 1"),
        ("blind", lambda row: {**row, "action": "dazzled"}, "unknown action dazzled"),
        ("blind", lambda row: {**row, "stamp_ns": row["stamp_ns"] + 1}, "with another stamp"),
        ("patch", lambda row: {**row, "right_px": 5000}, "outside the image"),
        ("patch", lambda row: {**row, "left_px": None}, "without its place"),
        ("patch", lambda row: {**row, "pixels": 10**6}, "does not hold as many"),
        ("patch", lambda row: {**row, "action": "dropped"}, "labelled as dropped"),
        ("patch", lambda row: {**row, "topic": REAR}, "changed without a label|do not hold|of another"),
    ],
)
def test_verify_finds_labels_that_are_wrong(
    name: str, damage: Any, what: str, camera_drive: Path, tmp_path: Path
) -> None:
    for each in ("clean", name):
        shutil.copytree(camera_drive / each, tmp_path / each)
    path = tmp_path / name / "camera_labels.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    last = damage(rows[-1])
    pq.write_table(pa.Table.from_pylist(rows[:-1] + ([last] if last else []), table.schema), path)
    found = [one.what for one in verify(tmp_path / name).findings if one.check == "images"]
    assert found
    assert re.search(what, " ".join(found)), found
