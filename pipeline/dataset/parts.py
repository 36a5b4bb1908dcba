"""An archive's bytes in one file or several: NAME.tar, or NAME.tar.000, NAME.tar.001 and so on."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import IO

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset import checksums

_PART = re.compile(r"(.+\.tar)\.([0-9]{3,})")


def whole_name(path: Path) -> Path:
    """The archive that a part belongs to: NAME.tar for NAME.tar.001 and NAME.tar.sha256."""
    if match := _PART.fullmatch(path.name):
        return path.with_name(match[1])
    return path.with_suffix("") if path.suffix == ".sha256" else path


def sums_path(archive: Path) -> Path:
    """The checksum list of an archive, next to it."""
    return archive.with_name(archive.name + ".sha256")


def existing_parts(archive: Path) -> list[Path]:
    """All parts of NAME.tar that there are, whether or not any is missing."""
    if not archive.parent.is_dir():
        return []
    found = []
    for path in archive.parent.iterdir():
        match = _PART.fullmatch(path.name)
        if match and match[1] == archive.name:
            found.append((int(match[2]), path))
    return [path for _, path in sorted(found)]


def find_parts(archive: Path) -> list[Path]:
    """The files of NAME.tar in their order; raises AdvpipeError where one is missing."""
    parts = existing_parts(archive)
    if archive.is_file():
        if parts:
            raise UsageError(f"both {archive} and {parts[0].name} exist; move one of them elsewhere")
        return [archive]
    if not parts:
        raise UsageError(f"neither {archive} nor {archive.name}.000 exists")
    for number, part in enumerate(parts):
        expected = part_path(archive, number)
        if part != expected:
            raise AdvpipeError(f"{expected} is missing; download it again")
        if part.stat().st_size != parts[0].stat().st_size and part != parts[-1]:
            raise AdvpipeError(f"{part} differs in size from {parts[0].name}: truncated; download it again")
    return parts


def part_path(archive: Path, number: int) -> Path:
    """Part 1 of NAME.tar is NAME.tar.001."""
    return archive.with_name(f"{archive.name}.{number:03d}")


class PartsWriter:
    """Writes one file, or several of `split_size_bytes` each, and their checksums beside them."""

    def __init__(self, archive: Path, split_size_bytes: int | None) -> None:
        self._archive, self._split_size_bytes = archive, split_size_bytes
        self._stream: IO[bytes] | None = None
        self._room_bytes = 0
        self._hash = hashlib.sha256()
        self._digests: dict[str, str] = {}
        self.count_bytes = 0

    def write(self, data: bytes) -> None:
        """Append bytes, in further parts where one is full."""
        rest = memoryview(data)
        while rest:
            if self._stream is None:
                self._open()
            now = rest if self._split_size_bytes is None else rest[: self._room_bytes]
            assert self._stream is not None
            self._stream.write(now)
            self._hash.update(now)
            self._room_bytes -= len(now)
            self.count_bytes += len(now)
            rest = rest[len(now) :]
            if self._split_size_bytes is not None and not self._room_bytes:
                self.close_part()

    def _open(self) -> None:
        number = len(self._digests)
        path = self._archive if self._split_size_bytes is None else part_path(self._archive, number)
        self._stream, self._path = path.open("wb"), path
        self._hash = hashlib.sha256()
        self._room_bytes = self._split_size_bytes or 0

    def close_part(self) -> None:
        """Close the open part, if there is one, and store its checksum."""
        if self._stream is not None:
            self._stream.close()
            self._digests[self._path.name] = self._hash.hexdigest()
            self._stream = None

    def finish(self) -> None:
        """End the last part and write NAME.tar.sha256."""
        self.close_part()
        sums_path(self._archive).write_text(checksums.to_text(self._digests), encoding="utf-8")


class PartsReader:
    """Reads the files of an archive as one stream; each must have its size and checksum at its end."""

    def __init__(self, archive: Path) -> None:
        self.archive = archive
        self._paths = find_parts(archive)
        self._sums = _stated_sums(archive, self._paths)
        self.length_bytes = sum(path.stat().st_size for path in self._paths)
        self.position_bytes = 0
        self._stream: IO[bytes] | None = None
        self._hash = hashlib.sha256()
        self._next = 0

    def read(self, size_bytes: int) -> bytes:
        """Exactly so many bytes; raises AdvpipeError where the archive ends before."""
        blocks: list[bytes] = []
        left_bytes = size_bytes
        while left_bytes:
            if self._stream is None and not self._open():
                raise AdvpipeError(
                    f"{self.archive}: truncated after {self.length_bytes} bytes; download it again"
                    + (" (the last part may be missing)" if len(self._paths) > 1 else "")
                )
            assert self._stream is not None
            block = self._stream.read(left_bytes)
            self._hash.update(block)
            blocks.append(block)
            left_bytes -= len(block)
            if not block:
                self._end_part()
        self.position_bytes += size_bytes
        return blocks[0] if len(blocks) == 1 else b"".join(blocks)

    def finish(self) -> None:
        """Check the last part; everything was read."""
        if self._stream is not None and not self._stream.read(1):
            self._end_part()

    def close(self) -> None:
        """Close the open part, if there is one."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _open(self) -> bool:
        if self._next == len(self._paths):
            return False
        self._stream = self._paths[self._next].open("rb")
        self._hash = hashlib.sha256()
        self._next += 1
        return True

    def _end_part(self) -> None:
        self.close()
        path = self._paths[self._next - 1]
        if self._sums and self._sums[path.name] != self._hash.hexdigest():
            raise AdvpipeError(
                f"{path} is damaged: it does not match {sums_path(self.archive).name}; download both again"
            )


def _stated_sums(archive: Path, paths: list[Path]) -> dict[str, str]:
    """What NAME.tar.sha256 says; empty where there is none, for the archive's content is checked anyway."""
    path = sums_path(archive)
    if not path.is_file():
        return {}
    sums = checksums.parse_checksums(checksums.read_bytes(path), path)
    if sorted(sums) != sorted(part.name for part in paths):
        raise AdvpipeError(f"{path} lists {', '.join(sums) or 'nothing'}, not the parts next to it")
    return sums
