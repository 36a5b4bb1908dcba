"""The files of a rosbag2 directory: which .mcap files it holds, in the order of recording."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import yaml
from pydantic import Field

from advpipe.pipeline.bag.foreign import refuse_foreign
from advpipe.pipeline.core import plain_yaml
from advpipe.pipeline.core.document import Document, ShortText, validated
from advpipe.pipeline.core.errors import AdvpipeError, UsageError

METADATA_NAME = "metadata.yaml"
_Path = Annotated[str, Field(min_length=1, max_length=4096)]


class _Information(Document):
    """What is needed of a metadata.yaml to read its bag; `stages/verify` compares the rest of it."""

    storage_identifier: ShortText | None = None
    compression_mode: ShortText | None = None
    relative_file_paths: Annotated[tuple[_Path, ...], Field(max_length=100_000)] | None = None


def mcap_files(path: Path) -> list[Path]:
    """The .mcap file(s) of a rosbag2 directory, or the one file itself."""
    try:
        if path.is_file():
            refuse_foreign(path)
            return [path]
        if not path.is_dir():
            raise UsageError(f"{path} does not exist; give a rosbag2 directory or an .mcap file")
        return _files_of_directory(path)
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None


def _files_of_directory(directory: Path) -> list[Path]:
    metadata_path = directory / METADATA_NAME
    if not metadata_path.is_file():
        raise UsageError(
            f"{directory} is not a rosbag2 directory, it holds no {METADATA_NAME}; "
            "pass the .mcap file itself, or restore it with `ros2 bag reindex`"
        )
    information: _Information = validated(
        read_information(metadata_path),
        _Information,
        str(metadata_path),
        "rebuild it with `ros2 bag reindex`",
    )
    storage = information.storage_identifier
    if storage != "mcap":
        raise UsageError(
            f"{directory} is stored as {storage!r}, but advpipe reads mcap; make a data set of it with "
            f"`advpipe import rosbag {directory} --out NEW`, or convert it with "
            f"`rosbags-convert --src {directory} --dst NEW --dst-storage mcap`"
        )
    if (information.compression_mode or "none").lower() != "none":
        raise UsageError(
            f"{directory} is compressed per file or message, which advpipe does not read; make a data set of "
            f"it with `advpipe import rosbag {directory} --out NEW`, or convert it with "
            f"`rosbags-convert --src {directory} --dst NEW --dst-storage mcap`"
        )
    if not information.relative_file_paths:
        raise AdvpipeError(f"{metadata_path} lists no files (relative_file_paths)")
    files = [directory / PurePosixPath(name).name for name in information.relative_file_paths]
    for file in files:
        if not file.is_file():
            raise AdvpipeError(f"{file} is missing, though {metadata_path} lists it")
    return files


@lru_cache(4)
def _document(text: str) -> object:
    return plain_yaml.load_yaml(text)


def read_information(metadata_path: Path) -> dict[str, Any]:
    """What a metadata.yaml says of its bag; AdvpipeError for a file that is none."""
    if metadata_path.stat().st_size > plain_yaml.LIMIT_BYTES:
        raise AdvpipeError(f"{metadata_path} is too large for a rosbag2 {METADATA_NAME}")
    try:
        document = _document(metadata_path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, ValueError, RecursionError):
        raise AdvpipeError(f"{metadata_path} is not valid YAML") from None
    information = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(information, dict):
        raise AdvpipeError(f"{metadata_path} is not rosbag2 metadata: rosbag2_bagfile_information is missing")
    return information
