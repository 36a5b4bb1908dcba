"""A copy of what lies in an object store, for what reads every byte of it several times."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError, writing
from advpipe.pipeline.core.hashing import copy
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.remote_path import RemotePath, located
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.dataset.archive import NoRoomError
from advpipe.pipeline.dataset.layout import is_portable


@contextmanager
def local_copy(path: Path) -> Iterator[Path]:
    """A path of this machine as it is; one in an object store as a copy in the folder for temporary files,
    which is removed with the block.

    Raises UsageError for what does not exist, or has names that no file may have here, and AdvpipeError
    without room for the copy.
    """
    remote = located(path)
    if not isinstance(remote, RemotePath):
        yield path
        return
    files = _files_of(remote)
    with scratch_folder() as scratch:
        needed, free = sum(size for _, size in files.values()), shutil.disk_usage(scratch).free
        if needed > free:
            raise NoRoomError(f"{remote}: {needed} bytes are needed in {scratch}, {free} are free; make room")
        target = scratch / remote.name
        with writing(target):
            for name, (source, _) in track(files.items(), f"copying {remote}", len(files)):
                file = target / name if name else target
                file.parent.mkdir(parents=True, exist_ok=True)
                with source.open("rb") as stream, file.open("xb") as out:
                    copy(stream.read, out.write, source.stat().st_size)
        yield target


def _files_of(remote: RemotePath) -> dict[str, tuple[RemotePath, int]]:
    """The files below a path by their names there, with their sizes; one that is a file has no name."""
    if remote.is_file():
        return {"": (remote, remote.stat().st_size)}
    found = remote.files() if remote.is_dir() else {}
    if not found:
        raise UsageError(f"{remote} does not exist; give a data set, a bag or an .mcap file")
    for name in found:
        if not is_portable(name):
            raise UsageError(f"{remote} has {name!r}, a name that no file may have here")
    return {name: (remote / name, size) for name, size in found.items()}
