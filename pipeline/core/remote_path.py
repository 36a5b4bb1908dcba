"""Paths in an object store, such as `s3://bucket/drive`: read like those of a disk, never written."""

from __future__ import annotations

import errno
import io
import os
import stat
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path, PosixPath, PurePosixPath
from typing import IO, TYPE_CHECKING, Any, NoReturn, cast

from advpipe.pipeline.core.errors import UsageError

if TYPE_CHECKING:
    from pyarrow.fs import FileInfo, FileSystem

SCHEME = "s3:"
"""The first part of the paths; pathlib takes the slashes after it for one."""

CONNECT_S, ANSWER_S = 10, 60
"""A store is given up after so long without a connection, or without a byte."""

READ_BYTES = 1 << 20
"""Asked for at once: a request takes some 50 ms, as long as a store needs to send a few MB."""


def located(path: str | os.PathLike[str]) -> Path:
    """The path on this machine, or in the object store that it names."""
    plain = path if isinstance(path, Path) else Path(path)
    return RemotePath(*plain.parts) if plain.parts[:1] == (SCHEME,) else plain


def refuse_remote(path: Path, instead: str) -> None:
    """Raise UsageError for a path in an object store, with what to do instead."""
    if isinstance(where := located(path), RemotePath):
        raise UsageError(f"{where} is in an object store; {instead}")


class RemotePath(PosixPath):
    """A path below `s3://`, with the methods of `Path` that read.

    Credentials, region and AWS_ENDPOINT_URL are those of AWS's own tools. Raises OSError where the store
    does not answer or does not permit, and for all methods that write.
    """

    def __str__(self) -> str:
        parts = self.parts
        is_whole = parts[:1] == (SCHEME,)  # what `relative_to` returns is not
        return f"{SCHEME}//" + "/".join(parts[1:]) if is_whole else "/".join(parts) or "."

    def __fspath__(self) -> str:
        return str(self)

    @property
    def key(self) -> str:
        """The bucket and the name in it."""
        return "/".join(self.parts[1:])

    @property
    def store(self) -> FileSystem:
        """Raises OSError for a path without a bucket."""
        if len(self.parts) < 2:
            raise OSError(errno.EINVAL, "name a bucket: s3://bucket/folder")
        return store_of(self.parts[1])

    def _info(self) -> FileInfo:
        (info,) = self.store.get_file_info([self.key])
        return info

    def _type(self) -> str:
        from pyarrow.fs import FileType

        found = self._info().type
        return {FileType.File: "file", FileType.Directory: "folder"}.get(found, "")

    def stat(self, *, follow_symlinks: bool = True) -> os.stat_result:
        from pyarrow.fs import FileType

        info = self._info()
        if info.type == FileType.NotFound:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self))
        mode = stat.S_IFREG | 0o444 if info.type == FileType.File else stat.S_IFDIR | 0o555
        time_ns = info.mtime_ns or 0
        times_s = (time_ns // 10**9,) * 3
        return os.stat_result((mode, 0, 0, 1, 0, 0, info.size or 0, *times_s), {"st_mtime_ns": time_ns})

    def exists(self, *, follow_symlinks: bool = True) -> bool:
        return self._type() != ""

    def is_file(self, *, follow_symlinks: bool = True) -> bool:
        return self._type() == "file"

    def is_dir(self, *, follow_symlinks: bool = True) -> bool:
        return self._type() == "folder"

    def is_symlink(self) -> bool:
        return False

    def is_absolute(self) -> bool:
        return True

    def absolute(self) -> RemotePath:
        return self

    def resolve(self, strict: bool = False) -> RemotePath:
        return self

    def open(  # type: ignore[override]  # of the modes, those that read
        self,
        mode: str = "r",
        buffering: int = -1,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
    ) -> IO[Any]:
        if set(mode) - set("rbt"):
            _refuse(self)
        raw = cast(io.RawIOBase, self.store.open_input_file(self.key))
        stream = io.BufferedReader(raw, READ_BYTES)
        return stream if "b" in mode else io.TextIOWrapper(stream, encoding, errors, newline)

    def read_bytes(self) -> bytes:
        with self.open("rb") as stream:
            return cast(bytes, stream.read())

    def iterdir(self) -> Iterator[RemotePath]:  # type: ignore[override]  # of any version of Python
        yield from (self / PurePosixPath(name).name for name in self._names(recursive=False))

    def glob(self, pattern: str, **_: Any) -> Iterator[RemotePath]:  # type: ignore[override]
        """Matches part by part; `**` is not known."""
        wanted = pattern.split("/")
        depth = len(self.parts) - 1
        for name in self._names(recursive=len(wanted) > 1):
            parts = name.split("/")[depth:]
            if len(parts) == len(wanted) and all(map(fnmatchcase, parts, wanted)):
                yield self.joinpath(*parts)

    def files(self) -> dict[str, int]:
        """All files below the path, by their names there, with their sizes."""
        from pyarrow.fs import FileSelector, FileType

        below = len(self.key) + 1
        found = self.store.get_file_info(FileSelector(self.key, recursive=True))
        return {info.path[below:]: info.size or 0 for info in found if info.type == FileType.File}

    def _names(self, *, recursive: bool) -> list[str]:
        from pyarrow.fs import FileSelector

        return sorted(
            info.path for info in self.store.get_file_info(FileSelector(self.key, recursive=recursive))
        )

    def mkdir(self, *_: Any, **__: Any) -> NoReturn:
        _refuse(self)

    rename = replace = unlink = rmdir = touch = symlink_to = hardlink_to = chmod = mkdir


def _refuse(path: Path) -> NoReturn:
    raise OSError(errno.EROFS, "an object store is only read here; name a local output", str(located(path)))


@cache
def store_of(bucket: str) -> FileSystem:
    """The store with a bucket, with AWS_ENDPOINT_URL or in the bucket's region. Raises OSError."""
    from pyarrow.fs import S3FileSystem, resolve_s3_region

    endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL")
    if endpoint:
        return S3FileSystem(endpoint_override=endpoint, connect_timeout=CONNECT_S, request_timeout=ANSWER_S)
    region = os.environ.get("AWS_REGION") or resolve_s3_region(bucket)
    return S3FileSystem(region=region, connect_timeout=CONNECT_S, request_timeout=ANSWER_S)
