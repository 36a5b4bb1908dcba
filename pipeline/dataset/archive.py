"""A data set as one plain .tar, or its parts; the same data set gives the same bytes.

Bags are compressed already. Unpacking treats its input as untrusted: each header must be the one that packing
writes, names stay inside the folder, sizes fit the archive, the disk and the limits, every file has the
checksum that SHA256SUMS states, and between and after them lie zeros alone. A bit that is changed anywhere
is found before the folder gets its name.
"""

from __future__ import annotations

import errno
import shutil
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError, writing
from advpipe.pipeline.core.hashing import copy
from advpipe.pipeline.core.partial import PartialFolder, finish_moves, move_items
from advpipe.pipeline.core.phases import Phase
from advpipe.pipeline.core.progress import track, working_on
from advpipe.pipeline.dataset import checksums, layout, signature, tar_header
from advpipe.pipeline.dataset.parts import PartsReader, PartsWriter, existing_parts, sums_path, whole_name


class NoRoomError(AdvpipeError):
    """The disk has no room for what an archive holds; nothing is wrong with the archive."""


_BAD_NAME = (errno.ENAMETOOLONG, errno.EINVAL, errno.EILSEQ)


@dataclass(frozen=True)
class Limits:
    """The most that unpacking takes, whatever an archive declares."""

    files: int = 100_000
    bytes: int = 1 << 44


def contents(folder: Path) -> dict[str, Path]:
    """All files of a folder by relative path: what `pack` takes."""
    return {name: folder / name for name in layout.files(folder)}


def pack(
    files: Mapping[str, Path],
    archive: Path,
    split_size_bytes: int | None = None,
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Pack files, SHA256SUMS among them, under the archive's stem; returns what was made.

    files: by relative path in the data set; they may lie anywhere. archive: NAME.tar, beside which
    NAME.tar.sha256 appears; with `split_size_bytes`, NAME.tar.000 and so on in its place. Raises
    AdvpipeError for a file that is not what SHA256SUMS says, and for an output that exists.
    """
    if archive.suffix != ".tar" or not layout.is_portable(archive.stem):
        raise UsageError(
            f"{archive}: an archive's name must end in .tar and hold no characters that paths reserve"
        )
    if split_size_bytes is not None and split_size_bytes < tar_header.RECORD_BYTES:
        raise UsageError(f"parts of {split_size_bytes} bytes are too small; choose 1 MB or more")
    sums = checksums.of_files(files)
    old = refuse_existing_archive(archive, overwrite)
    partial = PartialFolder(archive)
    try:
        with writing(archive):
            _write(files, sums, PartsWriter(partial.path / archive.name, split_size_bytes), archive.stem)
            made = sorted(path.name for path in partial.path.iterdir() if not path.name.startswith("."))
            move_items(partial.path, archive.parent, [path for path in old if path.name not in made])
        partial.discard(is_finished=True)
    except BaseException:
        partial.discard()
        raise
    return [archive.with_name(name) for name in made]


def refuse_existing_archive(archive: Path, overwrite: bool) -> list[Path]:
    """Raises AdvpipeError for an output that exists, unless it may be replaced; returns what there is.

    Where a run was killed while it named an archive's files, the rest of them is named first.
    """
    finish_moves(archive, archive.parent, lambda made: _outdated(archive, made))
    old = [path for path in (archive, *existing_parts(archive), sums_path(archive)) if path.exists()]
    if old and not overwrite:
        raise OutputExistsError(old[0])
    if folders := [path for path in old if not path.is_file()]:
        raise UsageError(f"{folders[0]} is not a file and is not replaced; choose another name")
    return old


def _outdated(archive: Path, made: Path) -> list[Path]:
    """The files of an earlier archive that a new one, still in the folder `made`, does not replace."""
    sums = made / sums_path(archive).name  # named last
    if not sums.is_file():
        return []
    names = {sums.name, *checksums.parse_checksums(checksums.read_bytes(sums), sums)}
    return [path for path in (archive, *existing_parts(archive)) if path.exists() and path.name not in names]


def _write(files: Mapping[str, Path], sums: Mapping[str, str], out: PartsWriter, top: str) -> None:
    for name in track(sorted(files, key=str.encode), f"packing {top}.tar"):
        size_bytes = files[name].stat().st_size
        out.write(tar_header.tar_header(f"{top}/{name}", size_bytes))
        with files[name].open("rb") as stream:
            sha256, copied_bytes = copy(stream.read, out.write, size_bytes)
        if copied_bytes != size_bytes or (name not in checksums.UNLISTED and sha256 != sums[name]):
            raise AdvpipeError(f"{files[name]} changed while it was packed; nothing was written, run again")
        out.write(bytes(tar_header.padding(size_bytes)))
    out.write(bytes(_end_bytes(out.count_bytes)))
    out.finish()


def _end_bytes(position_bytes: int) -> int:
    """The zeros that end an archive: two blocks, filled up to a whole record."""
    end = 2 * tar_header.BLOCK_BYTES
    return end + -(position_bytes + end) % tar_header.RECORD_BYTES


def unpack_archive(archive: Path, folder: Path | None = None, limits: Limits = Limits()) -> Path:
    """Unpack an archive that `pack` made; returns the folder, which holds every file as it was shared.

    archive: NAME.tar, or any of its parts. folder: to be made; the default is NAME beside the archive.
    Raises AdvpipeError for an output that exists and for every archive that is not whole and unchanged:
    then no folder appears. Memory stays flat.
    """
    archive = whole_name(archive)
    if archive.is_dir():
        raise UsageError(f"{archive} is a folder; give the archive, NAME.tar, or one of its parts")
    folder = folder or archive.with_suffix("")
    if folder.exists():
        raise UsageError(f"{folder} already exists; choose another name with --out")
    with closing(PartsReader(archive)) as stream:
        if stream.length_bytes > limits.bytes:
            raise AdvpipeError(f"{archive} has {stream.length_bytes} bytes; the limit is {limits.bytes}")
        partial = PartialFolder(folder)
        try:
            free_bytes = shutil.disk_usage(partial.path).free
            if stream.length_bytes > free_bytes:
                raise NoRoomError(
                    f"{folder}: {stream.length_bytes} bytes are needed, {free_bytes} are free; make room"
                )
            with writing(folder), working_on("reading files") as phase:
                found = _read(stream, partial.path, limits, phase)
            _check(found, partial.path, archive)
            partial.commit(may_replace=lambda _: False)
        except BaseException:
            partial.discard()
            raise
    return folder


def _read(stream: PartsReader, folder: Path, limits: Limits, phase: Phase) -> dict[str, str]:
    """Write every file of an archive below a folder; returns their digests by relative path."""
    found: dict[str, str] = {}
    top, last = "", b""
    while (entry := _next_entry(stream)) is not None:
        path, size_bytes = entry
        head, _, name = path.partition("/")
        if not layout.is_portable(path) or not name or head != (top or head):
            raise AdvpipeError(f"{stream.archive}: {path!r} is outside the data set's folder; not unpacked")
        layout.refuse_deep(name.count("/"), stream.archive)
        if name.encode() <= last:
            raise AdvpipeError(f"{stream.archive}: {path!r} comes twice or out of order; not unpacked")
        if len(found) == limits.files:
            raise AdvpipeError(f"{stream.archive} holds more than {limits.files} files; not unpacked")
        if size_bytes > stream.length_bytes - stream.position_bytes:
            raise AdvpipeError(
                f"{stream.archive}: {path} has {size_bytes} bytes, more than the archive; it is truncated or "
                "damaged, download it again"
            )
        top, last = head, name.encode()
        found[name] = _copy(stream, folder, name, size_bytes)
        if any(stream.read(tar_header.padding(size_bytes))):
            raise _damaged(stream)
        phase.reach(stream.position_bytes / stream.length_bytes)
    return found


def _next_entry(stream: PartsReader) -> tuple[str, int] | None:
    """Path and size of the next file; None at a whole archive's end."""
    start_bytes = stream.position_bytes
    block = stream.read(tar_header.BLOCK_BYTES)
    if not any(block):
        rest_bytes = _end_bytes(start_bytes) - len(block)
        if any(stream.read(rest_bytes)):
            raise _damaged(stream)
        stream.finish()
        if stream.position_bytes != stream.length_bytes:
            raise AdvpipeError(f"{stream.archive}: there is data after the archive's end; download it again")
        return None
    try:
        pax_bytes = tar_header.pax_length(block)
        records = b"" if pax_bytes is None else stream.read(pax_bytes)
        own = block if pax_bytes is None else stream.read(tar_header.BLOCK_BYTES)
        path, size_bytes = tar_header.parse_header(records, own)
        is_ours = tar_header.tar_header(path, size_bytes) == (
            own if pax_bytes is None else block + records + own
        )
    except ValueError:  # also UnicodeDecodeError
        is_ours = False
    if not is_ours:
        raise _damaged(stream)
    return path, size_bytes


def _damaged(stream: PartsReader) -> AdvpipeError:
    return AdvpipeError(
        f"{stream.archive}: the data before byte {stream.position_bytes} is not what `advpipe share` writes "
        "there: damaged, or packed by another tool (unpack it with that, then run `advpipe verify`)"
    )


def _copy(stream: PartsReader, folder: Path, name: str, size_bytes: int) -> str:
    target = folder / name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        out = target.open("xb")
    except (FileExistsError, NotADirectoryError):
        raise AdvpipeError(
            f"{stream.archive}: {name} comes twice on this file system; not unpacked"
        ) from None
    except OSError as error:
        if error.errno not in _BAD_NAME:
            raise
        raise AdvpipeError(
            f"{stream.archive}: this file system does not support names like {name[:60]!r}...; not unpacked"
        ) from None
    with out:
        return copy(stream.read, out.write, size_bytes)[0]


def _check(found: Mapping[str, str], folder: Path, archive: Path) -> None:
    """Every file is listed, as it is; the signature, which no list holds, is that of the signer beside it."""
    if checksums.FILE not in found:
        raise UsageError(f"{archive} holds no {checksums.FILE}: `advpipe share` did not pack it")
    sums = checksums.parse_checksums(checksums.read_bytes(folder / checksums.FILE), archive / checksums.FILE)
    listed = {name: digest for name, digest in found.items() if name not in checksums.UNLISTED}
    for name in sorted({*sums, *listed}):
        if name not in listed:
            raise AdvpipeError(f"{archive}: {name} is missing, though {checksums.FILE} lists it")
        if sums.get(name) != listed[name]:
            raise AdvpipeError(f"{archive}: {name} does not match {checksums.FILE}; download it again")
    if {signature.FILE, signature.KEY_FILE} <= found.keys():
        with suppress(signature.NoLibraryError):  # then `advpipe verify` says that nobody looked
            signature.verify_signature(folder)
