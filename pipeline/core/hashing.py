"""SHA-256 of files, and of bytes while they are copied."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError

_BLOCK_BYTES = 1 << 20


def sha256_of(*paths: Path) -> str:
    """The SHA-256 of the concatenated bytes of files, as 64 lower-case hexadecimal digits.

    Raises AdvpipeError, which names the file, for one that cannot be read.
    """
    sha256 = hashlib.sha256()
    for path in paths:
        try:
            with path.open("rb") as stream:
                while block := stream.read(_BLOCK_BYTES):
                    sha256.update(block)
        except OSError as error:
            raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None
    return sha256.hexdigest()


def copy(read: Callable[[int], bytes], write: Callable[[bytes], object], size_bytes: int) -> tuple[str, int]:
    """Copy `size_bytes` bytes, or fewer if the source ends; return their SHA-256 (hexadecimal) and count."""
    sha256, left_bytes = hashlib.sha256(), size_bytes
    while left_bytes and (block := read(min(_BLOCK_BYTES, left_bytes))):
        sha256.update(block)
        write(block)
        left_bytes -= len(block)
    return sha256.hexdigest(), size_bytes - left_bytes
