"""SHA-256 of files, and of bytes on their way from one place to another."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError

_BLOCK_BYTES = 1 << 20


def sha256_of(*paths: Path) -> str:
    """Of the bytes of files, one behind the other: 64 hexadecimal digits in lower case.

    Raises AdvpipeError for a file that cannot be read: of a failing disk, the system does not say which.
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
    """Copy so many bytes, or as many as there are; returns their SHA-256 and how many they were."""
    sha256, left_bytes = hashlib.sha256(), size_bytes
    while left_bytes and (block := read(min(_BLOCK_BYTES, left_bytes))):
        sha256.update(block)
        write(block)
        left_bytes -= len(block)
    return sha256.hexdigest(), size_bytes - left_bytes
