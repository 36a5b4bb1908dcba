"""Camera images as probes see them, and the probes."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.probe import Float64, Probe
from advpipe.pipeline.labels.image_quantities import (
    IMAGE_DELAY,
    IMAGES_DROPPED,
    IMAGES_REPLACED,
    PIXEL_SHARE,
)
from advpipe.pipeline.messages.compressed_image import StampedImage

_CONTENT = (PIXEL_SHARE.name, IMAGES_REPLACED.name)
_TIMES = (IMAGE_DELAY.name, IMAGES_DROPPED.name)


class ImageFile(NamedTuple):
    """What the file of an image says without its pixels; NaN where it is no JPEG or PNG file.

    checksum: of all bytes. header_bytes: before the coded pixels of a JPEG. step: mean of its quantisation
    tables. tables: their number. sampling: how many pixels share a colour.
    """

    stamp_ns: int
    log_time_ns: int
    size: int
    checksum: int
    encoding: int
    pixels: float = np.nan
    header_bytes: float = np.nan
    step: float = np.nan
    tables: float = np.nan
    sampling: float = np.nan

    @classmethod
    def of(cls, image: StampedImage, log_time_ns: int) -> ImageFile:
        """That of a received image."""
        sums = zlib.crc32(image.file), zlib.crc32(image.encoding.encode())
        return cls(image.stamp_ns, log_time_ns, len(image.file), *sums, *_header(image.file))


def _header(file: bytes) -> tuple[float, ...]:
    from PIL import Image, JpegImagePlugin

    try:
        with Image.open(io.BytesIO(file), formats=("JPEG", "PNG")) as image:
            size = float(image.width * image.height)
            if not isinstance(image, JpegImagePlugin.JpegImageFile):
                return (size,)
            tables = list(image.quantization.values())
            step = float(np.mean([np.mean(table) for table in tables])) if tables else np.nan
            scan = float(file.find(b"\xff\xda"))
            return size, scan, step, float(len(tables)), float(JpegImagePlugin.get_sampling(image))
    except (OSError, ValueError, SyntaxError, IndexError, struct.error, Image.DecompressionBombError):
        return ()


@dataclass(frozen=True)
class ImageView:
    """The N images of a topic, in order of arrival."""

    files: Sequence[ImageFile]

    def each(self, name: str) -> Float64:
        """A number (N,) of each."""
        return np.array([getattr(file, name) for file in self.files], np.float64)

    @cached_property
    def stamp_ns(self) -> npt.NDArray[np.int64]:
        """(N,)."""
        return np.array([file.stamp_ns for file in self.files], np.int64)

    @cached_property
    def log_time_ns(self) -> npt.NDArray[np.int64]:
        """(N,)."""
        return np.array([file.log_time_ns for file in self.files], np.int64)

    @cached_property
    def equal_files(self) -> Float64:
        """How many other images (N,) of the topic have the same bytes."""
        sums = [(file.checksum, file.size) for file in self.files]
        counts: dict[tuple[int, int], int] = {}
        for one in sums:
            counts[one] = counts.get(one, 0) + 1
        return np.array([counts[one] - 1 for one in sums], np.float64)


def _off_usual(times_ns: npt.NDArray[np.int64]) -> Float64:
    """By how many seconds (N,) the time since the image before is not the usual one."""
    interval_s = np.append(np.nan, np.diff(times_ns) / 1e9)
    return np.abs(interval_s - np.nanmedian(interval_s)) if len(times_ns) > 1 else interval_s


IMAGE_PROBES: tuple[Probe[ImageView], ...] = (
    Probe("bytes", "image", "bytes of the file", lambda v: v.each("size"), _CONTENT),
    Probe("compression", "image", "bytes of a pixel",
          lambda v: v.each("size") / v.each("pixels"), _CONTENT),
    Probe("change", "image", "change of the bytes since the image before",
          lambda v: np.append(np.nan, np.abs(np.diff(v.each("size")))), (*_CONTENT, *_TIMES)),
    Probe("equal-files", "image", "other images with the same bytes",
          lambda v: v.equal_files, (IMAGES_REPLACED.name,)),
    Probe("header", "image", "bytes before the coded pixels", lambda v: v.each("header_bytes")),
    Probe("step", "image", "mean of the quantisation tables", lambda v: v.each("step")),
    Probe("tables", "image", "number of quantisation tables", lambda v: v.each("tables")),
    Probe("sampling", "image", "subsampling of colours", lambda v: v.each("sampling")),
    Probe("encoding", "image", "the stated format", lambda v: v.each("encoding")),
    Probe("interval", "image", "deviation of the interval of stamps from the usual one",
          lambda v: _off_usual(v.stamp_ns), (IMAGES_DROPPED.name,)),
    Probe("arrival", "image", "deviation of the interval of arrivals from the usual one",
          lambda v: _off_usual(v.log_time_ns), _TIMES),
    Probe("log-time", "image", "log time after the stamp",
          lambda v: (v.log_time_ns - v.stamp_ns) / 1e9, (IMAGE_DELAY.name,)),
    Probe("order", "image", "place among all images",
          lambda v: np.arange(len(v.files)) / max(len(v.files), 1)),
)  # fmt: skip
