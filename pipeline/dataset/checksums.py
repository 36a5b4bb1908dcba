"""SHA256SUMS: a checksum of every file of a folder, in the form that `sha256sum -c` reads."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.dataset import layout

FILE = "SHA256SUMS"
SIGNATURE_FILE = "SHA256SUMS.sig"
UNLISTED = (FILE, SIGNATURE_FILE)
"""The files that a list cannot hold: itself, and what signs it."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")
_LIMIT_BYTES = 64 << 20


def listed_files(folder: Path) -> list[str]:
    """The files of a folder that its SHA256SUMS lists: all but itself and its signature."""
    return [name for name in layout.files(folder) if name not in UNLISTED]


def write(folder: Path) -> Path:
    """Write the checksums of every file below a folder; returns the list's path."""
    sums = {name: sha256_of(folder / name) for name in listed_files(folder)}
    (folder / FILE).write_bytes(to_text(sums).encode())
    return folder / FILE


def to_text(sums: Mapping[str, str]) -> str:
    """The list of digests by relative path, sorted by the paths' bytes."""
    return "".join(f"{sums[name]}  {name}\n" for name in sorted(sums, key=str.encode))


def read(folder: Path) -> dict[str, str]:
    """The digests by relative path that a folder's SHA256SUMS states.

    Raises AdvpipeError, with the number of the line, for anything that `write` would not have written.
    """
    return parse_checksums(read_bytes(folder / FILE), folder / FILE)


def read_bytes(path: Path) -> bytes:
    """A list of checksums as it lies there; raises AdvpipeError where there is none."""
    if not path.is_file():
        raise AdvpipeError(f"{path} does not exist; `advpipe share` writes it")
    if path.stat().st_size > _LIMIT_BYTES:
        raise AdvpipeError(f"{path} is too large for a checksum list")
    return path.read_bytes()


def parse_checksums(data: bytes, path: Path) -> dict[str, str]:
    """The digests in a list's bytes; `path` is for errors alone."""
    sums: dict[str, str] = {}
    last = b""
    lines = data.split(b"\n")
    if lines.pop():
        raise AdvpipeError(f"{path}:{len(lines) + 1}: the last line has no line end; the list is truncated")
    for number, line in enumerate(lines, start=1):
        try:
            match = _LINE.fullmatch(line.decode())
        except UnicodeDecodeError:
            raise AdvpipeError(f"{path}:{number}: invalid UTF-8; the list is damaged") from None
        if match is None:
            raise AdvpipeError(
                f"{path}:{number}: expected a line of `sha256sum`: 64 hex digits, two spaces, a path"
            )
        name = match[2]
        if not layout.is_portable(name) or name in UNLISTED:
            raise AdvpipeError(f"{path}:{number}: {name!r} is not the path of a file in this folder")
        if name.encode() <= last:
            raise AdvpipeError(f"{path}:{number}: {name!r} is listed twice or out of order")
        sums[name], last = match[1], name.encode()
    return sums


def of_files(files: Mapping[str, Path]) -> dict[str, str]:
    """What the SHA256SUMS among some files says, where it lists just these.

    files: by relative path in the data set. Raises AdvpipeError for one too many or too few.
    """
    sums = parse_checksums(read_bytes(files[FILE]), files[FILE])
    for name in sorted(set(sums) ^ (set(files) - set(UNLISTED))):
        what = "is missing, though it lists it" if name in sums else "is not listed"
        raise AdvpipeError(f"{files[FILE]}: {name} {what}")
    return sums
