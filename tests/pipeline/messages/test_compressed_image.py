"""Compressed images: the bytes of messages and files."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest
from PIL import Image

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.compressed_image import (
    StampedImage,
    encoded_like,
    image_from_cdr,
    image_to_cdr,
    pixels_of,
)
from advpipe.pipeline.messages.images import jpeg_message, png_message
from advpipe.pipeline.messages.types import serialise

RGB = np.random.default_rng(1).integers(0, 256, (24, 40, 3)).astype(np.uint8)
TYPE = "sensor_msgs/msg/CompressedImage"


@pytest.mark.parametrize("frame_id", ["ego/front_optical_frame", "a", "ab", "abc", "abcd"])
def test_a_message_is_read_and_written_as_rosbags_does(frame_id: str) -> None:
    cdr = serialise(jpeg_message(1_700_000_000_123_456_789, frame_id, RGB, 92), TYPE)
    image = image_from_cdr(cdr)
    assert (image.stamp_ns, image.frame_id) == (1_700_000_000_123_456_789, frame_id)
    assert image.encoding == "rgb8; jpeg compressed bgr8"
    assert image_to_cdr(image) == cdr


def test_png_keeps_every_value() -> None:
    depth_mm = np.arange(24 * 40, dtype=np.uint16).reshape(24, 40) * 68
    for image in (depth_mm, RGB):
        cdr = serialise(png_message(0, "f", image), TYPE)
        assert (pixels_of(image_from_cdr(cdr).file) == image).all()


def test_a_jpeg_is_compressed_again_as_it_was() -> None:
    file = io.BytesIO()
    Image.fromarray(RGB).save(file, "JPEG", quality=71, subsampling=1)
    again = Image.open(io.BytesIO(encoded_like(RGB[::-1].copy(), file.getvalue())))
    assert again.quantization == Image.open(file).quantization  # type: ignore[attr-defined]
    assert encoded_like(RGB, file.getvalue()) == file.getvalue()


@pytest.mark.parametrize(
    ("cdr", "what"),
    [
        (b"", "malformed"),
        (b"\x00\x00\x00\x00" + bytes(40), "little-endian"),
        (image_to_cdr(StampedImage(0, "f", "jpeg", b"12345"))[:-1], "does not fit"),
        (b"\x00\x01\x00\x00" + struct.pack("<iII", 0, 0, 1 << 30), "a string of"),
    ],
)
def test_a_damaged_message_is_one_line(cdr: bytes, what: str) -> None:
    with pytest.raises(AdvpipeError, match=what):
        image_from_cdr(cdr)


@pytest.mark.parametrize("file", [b"", b"\xff\xd8\xff\xe0 no image", b"GIF89a"])
def test_a_damaged_file_is_one_line(file: bytes) -> None:
    with pytest.raises(AdvpipeError, match="cannot be decompressed"):
        pixels_of(file)


def test_a_bomb_is_refused() -> None:
    """A few kilobytes that would be hundreds of megabytes of pixels."""
    file = io.BytesIO()
    Image.new("L", (9000, 9000)).save(file, "PNG")
    with pytest.raises(AdvpipeError, match="too many to read"):
        pixels_of(file.getvalue())
