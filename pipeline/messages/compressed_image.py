"""sensor_msgs/CompressedImage as it is read and written again: its header, and the file in it."""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cdr import Cdr

IMAGE_TYPE = "sensor_msgs/msg/CompressedImage"

MOST_PIXELS = 50_000_000
"""Of an image that is decompressed: a bag is untrusted."""

UInt8 = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class StampedImage:
    """encoding: the field `format` of the message. file: the bytes of a JPEG or PNG file."""

    stamp_ns: int
    frame_id: str
    encoding: str
    file: bytes


def image_from_cdr(cdr: bytes) -> StampedImage:
    """Raises AdvpipeError for a message that is no little-endian CompressedImage."""
    try:
        if cdr[:2] != b"\x00\x01":
            raise ValueError("only little-endian CDR is supported")
        seconds, nanoseconds = struct.unpack_from("<iI", cdr, 4)
        frame_id, place = _string(cdr, 12)
        encoding, place = _string(cdr, place)
        (length,) = struct.unpack_from("<I", cdr, place)
        if place + 4 + length != len(cdr):
            raise ValueError(f"a file of {length} bytes does not fit {len(cdr)} bytes")
    except (struct.error, ValueError) as error:
        raise AdvpipeError(f"malformed CompressedImage message: {error}") from None
    file = bytes(cdr[place + 4 :])
    return StampedImage(seconds * 1_000_000_000 + nanoseconds, frame_id, encoding, file)


def image_to_cdr(image: StampedImage) -> bytes:
    """The message in the bytes in which `types.serialise` writes it."""
    writer = Cdr()
    writer.header(image.stamp_ns, image.frame_id)
    writer.string(image.encoding)
    writer.octets(image.file)
    return bytes(writer)


def pixels_of(file: bytes) -> npt.NDArray[Any]:
    """The pixels of a JPEG or PNG file: (H, W, 3) uint8 of colours, (H, W) uint8 or uint16 of one channel.

    Raises AdvpipeError for a file that is damaged, too large or none of these.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(file), formats=("JPEG", "PNG")) as image:
            if image.width * image.height > MOST_PIXELS:
                raise AdvpipeError(f"an image has {image.width} x {image.height} pixels, too many to read")
            grey = image.mode in ("L", "I;16", "I")
            found = np.asarray(image if grey else image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise AdvpipeError(f"an image cannot be decompressed: {error}") from None
    return found.astype(np.uint16) if found.dtype.itemsize > 1 else found


def encoded_like(rgb: UInt8, file: bytes) -> bytes:
    """An image (H, W, 3) as a file of the same kind as another: a JPEG with its quantisation tables and
    subsampling, so that the quality stays as it was."""
    from PIL import Image, JpegImagePlugin

    with Image.open(io.BytesIO(file), formats=("JPEG", "PNG")) as image:
        options: dict[str, Any] = {}
        if isinstance(image, JpegImagePlugin.JpegImageFile):
            options = {"qtables": image.quantization, "subsampling": JpegImagePlugin.get_sampling(image)}
        kind = image.format
    written = io.BytesIO()
    Image.fromarray(rgb).save(written, kind, **options)
    return written.getvalue()


def png_file(rgb: UInt8) -> bytes:
    """An image (H, W, 3) as a PNG file."""
    from PIL import Image

    written = io.BytesIO()
    Image.fromarray(rgb).save(written, "PNG")
    return written.getvalue()


def _string(cdr: bytes, place: int) -> tuple[str, int]:
    """A string whose length stands at `place`, and where the next field of four bytes stands."""
    (length,) = struct.unpack_from("<I", cdr, place)
    if length > 256 or place + 4 + length > len(cdr):
        raise ValueError(f"a string of {length} bytes")
    end = place + 4 + length
    return bytes(cdr[place + 4 : end]).rstrip(b"\0").decode(), 4 + -(-(end - 4) // 4) * 4
