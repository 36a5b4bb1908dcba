"""Checks untrusted files of torch.save before torch unpacks them.

torch refuses objects that could run code, but limits neither the unpacked size of an archive nor the number
of objects in a pickle.
"""

from __future__ import annotations

import pickletools
import re
import struct
import zipfile
from pathlib import Path
from typing import IO

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import shorten

MOST_BYTES = 1 << 28
"""A CenterPoint for Waymo has 23 MB of weights, three times that with its optimiser's state."""

MOST_ENTRIES = 10_000
MOST_DIRECTORY_BYTES = 1 << 22
MOST_PICKLE_BYTES = 1 << 20
"""Limit on names and shapes; each byte of a pickle may expand to some 60 bytes in Python."""

PLAIN = re.compile(
    r"collections OrderedDict|torch Size|torch device|torch\.serialization _get_layout"
    r"|torch(\.cuda)? \w+Storage"
    r"|torch\._utils _rebuild_(tensor|tensor_v2|tensor_v3|parameter|parameter_with_state|sparse_tensor)"
    r"|torch (bool|u?int\d+|b?float\d+)"
)
"""Names allowed in pickles of tensors. torch allows more, such as a bytearray of any length."""

_OLD_PICKLES = 5
"""Before 2020, torch.save wrote a magic number, its version, the system, the object and the names of storages
as consecutive pickles, and then the numbers."""


def check_archive(path: Path) -> None:
    """Raise AdvpipeError for a file that unpacks to more than its size, or whose pickle names anything other
    than tensors."""
    size_bytes = path.stat().st_size
    if size_bytes > MOST_BYTES:
        raise AdvpipeError(f"{path} has {size_bytes} bytes; checkpoints of OpenPCDet have up to {MOST_BYTES}")
    with path.open("rb") as file:
        if file.read(4) == b"PK\x03\x04":
            _check_zip(path, file, size_bytes)
        else:
            file.seek(0)
            _check_old(path, file)


def _check_zip(path: Path, file: IO[bytes], size_bytes: int) -> None:
    count, directory_bytes = _directory(path, file, size_bytes)
    if count > MOST_ENTRIES or directory_bytes > MOST_DIRECTORY_BYTES:
        raise AdvpipeError(f"{path} is an archive of {count} entries, too many for a checkpoint")
    try:
        with zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            if len({entry.filename.lower() for entry in entries}) < len(entries):
                raise AdvpipeError(
                    f"{path} has two entries with the same name, which torch.save never writes"
                )
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries):
                raise AdvpipeError(
                    f"{path} is compressed, unlike files of torch.save; load it and save it again"
                )
            if sum(entry.file_size for entry in entries) > size_bytes:
                raise AdvpipeError(
                    f"{path} declares more data than it holds; it was not written by torch.save"
                )
            for entry in entries:
                if entry.filename.lower().endswith(".pkl"):
                    if entry.file_size > MOST_PICKLE_BYTES:
                        raise AdvpipeError(f"{path} holds {entry.file_size} bytes of names, too many to read")
                    with archive.open(entry) as pickled:
                        _check_pickle(path, pickled)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError) as error:
        raise _no_checkpoint(path, error) from None


def _directory(path: Path, file: IO[bytes], size_bytes: int) -> tuple[int, int]:
    """The number of entries and the bytes of an archive's directory (PKWARE APPNOTE 4.3.14 to 4.3.16)."""
    start = max(size_bytes - (1 << 16) - 22, 0)
    file.seek(start)
    tail = file.read()
    at = tail.rfind(b"PK\x05\x06")
    try:
        if at < 0:
            raise struct.error("no directory")
        count, directory_bytes = struct.unpack_from("<HI", tail, at + 10)
        if count == 0xFFFF or directory_bytes == 0xFFFFFFFF:
            (place,) = struct.unpack_from("<Q", tail, at - 20 + 8)
            file.seek(min(place, size_bytes))
            count, directory_bytes = struct.unpack_from("<QQ", file.read(56), 32)
    except struct.error as error:
        raise _no_checkpoint(path, error) from None
    return int(count), int(directory_bytes)


def _check_old(path: Path, file: IO[bytes]) -> None:
    start = file.read(MOST_PICKLE_BYTES)
    if not start.startswith(b"\x80"):
        raise AdvpipeError(f"{path} was not written by torch.save")
    file.seek(0)
    for _ in range(_OLD_PICKLES):
        _check_pickle(path, file)
        if file.tell() > MOST_PICKLE_BYTES:
            raise AdvpipeError(f"{path} holds over {MOST_PICKLE_BYTES} bytes of names, too many to read")


def _check_pickle(path: Path, file: IO[bytes]) -> None:
    """Scan one pickle without building objects; raise AdvpipeError for a name that no tensor needs."""
    try:
        for operation, argument, _ in pickletools.genops(file):
            named = str(argument) if operation.name == "GLOBAL" else ""
            if operation.name in ("STACK_GLOBAL", "INST") or (named and not PLAIN.fullmatch(named)):
                what = shorten(named.replace(" ", ".")) or "a computed name"
                raise AdvpipeError(
                    f"{path} holds {what}; only plain tensors are loaded, since anything else could run "
                    "code; if you trust the file, save its `model_state` alone, as {'model_state': ...}, "
                    "with torch.save"
                )
    except (ValueError, OSError, UnicodeError, zipfile.BadZipFile) as error:
        raise _no_checkpoint(path, error) from None


def _no_checkpoint(path: Path, error: Exception) -> AdvpipeError:
    return AdvpipeError(
        f"{path} is truncated or not written by torch.save ({type(error).__name__}); copy it again"
    )
