"""The files that jobs read: a worker uses them where they lie if it sees them, or its node's copy of them.

What a worker needs is pickled with each path in it marked, so that neither the stages nor their jobs know
where a bag lies on the machine that reads it.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.remote_path import RemotePath

_ENDS_BYTES = 1 << 16


@dataclass(frozen=True)
class InputFile:
    """One file of an input. name: its path within the input's folder, or "" for an input that is a file.

    ends_sha256: of the first and the last 64 KiB; of an MCAP file, they hold provenance and checksums.
    """

    name: str
    size: int
    ends_sha256: str


@dataclass(frozen=True)
class Input:
    """A file or folder that jobs read, as it is on the driver; path: absolute."""

    path: str
    files: tuple[InputFile, ...]

    @classmethod
    def of(cls, path: Path) -> Input:
        """The input at a path of this machine. Raises OSError for one that cannot be read."""
        found = [_file(file, path) for file in _files_of(path)]
        return cls(str(path.absolute()), tuple(found))

    @property
    def size(self) -> int:
        """The bytes of all its files."""
        return sum(file.size for file in self.files)

    def is_at(self, path: Path) -> bool:
        """Whether this machine has the same files at a path."""
        try:
            return all(_file(path / file.name, path) == file for file in self.files)
        except OSError:
            return False


class MissingInputsError(Exception):
    """A worker sees neither these inputs nor a copy of them."""

    def __init__(self, inputs: tuple[Input, ...]) -> None:
        super().__init__(inputs)
        self.inputs = inputs


def packed(value: object) -> tuple[bytes, tuple[Input, ...]]:
    """A value as bytes for `unpacked`, and the inputs that it names: paths, and checkpoints as text."""
    stream, inputs = io.BytesIO(), dict[str, Input]()

    class Packer(pickle.Pickler):
        def persistent_id(self, one: object) -> Any:
            is_path = isinstance(one, Path)
            if isinstance(one, RemotePath):
                return None  # every node reads the store itself
            if not is_path and not (isinstance(one, str) and one.endswith(".safetensors")):
                return None
            path = Path(str(one))
            if not path.exists():
                return None
            key = str(path.absolute())
            if key not in inputs:
                inputs[key] = Input.of(path)
            return is_path, list(inputs).index(key)  # a text would be looked at in turn

    Packer(stream, protocol=pickle.HIGHEST_PROTOCOL).dump(value)
    return stream.getvalue(), tuple(inputs.values())


def unpacked(content: bytes, inputs: tuple[Input, ...], copies: Mapping[str, str]) -> Callable[[], Any]:
    """The value with paths of this machine. copies: by the driver's path, the copy that this node has.

    Raises MissingInputsError for inputs that are not here.
    """
    places: dict[str, str] = {}
    missing = []
    for one in inputs:
        for place in filter(None, (one.path, copies.get(one.path))):
            if one.is_at(Path(place)):
                places[one.path] = place
                break
        else:
            missing.append(one)
    if missing:
        raise MissingInputsError(tuple(missing))

    class Unpacker(pickle.Unpickler):
        def persistent_load(self, mark: tuple[bool, int]) -> Path | str:
            is_path, number = mark
            place = places[inputs[number].path]
            return Path(place) if is_path else place

    value: Callable[[], Any] = Unpacker(io.BytesIO(content)).load()
    return value


def _files_of(path: Path) -> Iterator[Path]:
    """The file itself, or all files in a folder but hidden ones, sorted."""
    if path.is_file():
        yield path
        return
    for folder, folders, names in os.walk(path):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(folder, name) for name in sorted(names) if not name.startswith("."))


def _file(file: Path, root: Path) -> InputFile:
    size = file.stat().st_size
    with file.open("rb") as stream:
        ends = hashlib.sha256(stream.read(_ENDS_BYTES))
        stream.seek(max(0, size - _ENDS_BYTES))
        ends.update(stream.read(_ENDS_BYTES))
    name = "" if file == root else file.relative_to(root).as_posix()
    return InputFile(name, size, ends.hexdigest())
