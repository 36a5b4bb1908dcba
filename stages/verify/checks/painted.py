"""Whether an image was painted on where its labels say, and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.compressed_image import encoded_like, pixels_of

BLOCK_PX = 16
"""Side of the blocks that a JPEG file compresses as one, with halved colours."""

TOLERANCE = 4
"""Levels by which the same image, compressed once more, may differ: other versions of libjpeg round
otherwise."""

Area = tuple[tuple[Any, ...], Any]
"""Edges (left, top, right, bottom) and number of pixels."""


def paint_fault(clean: bytes, attacked: bytes, areas: Sequence[Area]) -> Iterator[str]:
    """What is wrong with an image file that was painted on in these areas.

    Compressing changes pixels all over: outside the blocks of the areas, and the next ones, whose colours
    are smoothed with theirs, the image must be what the clean one becomes if it is compressed once more.
    """
    before, after = pixels_of(clean), pixels_of(attacked)
    if before.shape != after.shape:
        yield "has another size than in the clean bag"
        return
    height, width = before.shape[:2]
    outside = np.ones((height, width), np.bool_)
    for edges, pixels in areas:
        if any(edge is None for edge in edges) or pixels is None:
            yield "has a label of paint without its place"
            return
        left, top, right, bottom = edges
        if not (0 <= left <= right < width and 0 <= top <= bottom < height):
            yield "has a label of paint outside the image"
            return
        if not 0 < pixels <= (right - left + 1) * (bottom - top + 1):
            yield f"has a label of {pixels} pixels in a rectangle that does not hold as many"
        outside[_blocks(top, bottom), _blocks(left, right)] = False
    if outside.any() and _differs(before, clean, after, outside):
        yield "was painted on outside the rectangle of its label"


def _blocks(first: int, last: int) -> slice:
    """The blocks that hold these rows or columns, and one more on each side."""
    low = (first // BLOCK_PX - 1) * BLOCK_PX
    return slice(max(low, 0), (last // BLOCK_PX + 2) * BLOCK_PX)


def _differs(
    before: npt.NDArray[Any], clean: bytes, after: npt.NDArray[Any], outside: npt.NDArray[np.bool_]
) -> bool:
    again = pixels_of(encoded_like(before, clean)).astype(np.int16)
    apart = np.abs(again[outside] - after[outside].astype(np.int16))
    return bool(apart.max() > TOLERANCE)
