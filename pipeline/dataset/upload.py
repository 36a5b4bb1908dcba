"""A data set's files, which may lie anywhere, into an object store."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.core.hashing import copy
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.remote_path import RemotePath
from advpipe.pipeline.dataset import checksums


def upload(files: Mapping[str, Path], folder: RemotePath, *, overwrite: bool = False) -> None:
    """Upload files, SHA256SUMS among them and last, to their relative paths below a folder of a store.

    An upload that was interrupted has no SHA256SUMS, and may be repeated. Raises AdvpipeError for a file that
    is not what SHA256SUMS says, and, without `overwrite`, for a folder that has a SHA256SUMS.
    """
    if (folder / checksums.FILE).exists():
        if not overwrite:
            raise OutputExistsError(folder)
        folder.store.delete_file((folder / checksums.FILE).key)
    sums = checksums.of_files(files)
    in_order = sorted(files, key=lambda name: (name == checksums.FILE, name))
    for name in track(in_order, f"uploading to {folder}"):
        source, target = files[name], folder / name
        with source.open("rb") as stream, folder.store.open_output_stream(target.key) as out:
            digest, _ = copy(stream.read, out.write, source.stat().st_size)
        if name not in checksums.UNLISTED and digest != sums[name]:
            raise AdvpipeError(f"{source} changed while it was uploaded; {folder} has no {checksums.FILE}")
