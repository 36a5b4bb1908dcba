"""Find an incomplete recording: in a killed run's hidden folder, or in a damaged bag."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.partial import final_path, leftovers, lock_leftover

SCENARIO_NAME = "scenario.yaml"


@dataclass(frozen=True)
class PartialRecording:
    """The .mcap files of a recording, and the file or folder where they were found.

    name: the path that it has or was to get. is_data_set: whether the bag is a data set's clean one.
    is_leftover: whether it is in the hidden folder of a killed run.
    """

    found: Path
    name: Path
    files: tuple[Path, ...]
    is_data_set: bool = False
    is_leftover: bool = False

    @property
    def bag(self) -> Path:
        """The .mcap file that was named, or the folder that holds the files."""
        return self.found if self.found.is_file() else self.files[0].parent

    @property
    def filled_files(self) -> tuple[Path, ...]:
        """The files that are not empty; all of them if all are empty."""
        return tuple(file for file in self.files if file.stat().st_size) or self.files


@contextmanager
def find_partial_recording(path: Path) -> Iterator[PartialRecording]:
    """The incomplete recording that a path names, protected from removal by other runs within the block.

    path: an .mcap file, a rosbag2 directory, a data set, a hidden folder, or the name that a killed run
    was to give; what such a run left comes first. Raises AdvpipeError where nothing is found, and where a
    living run is still writing.
    """
    if path.is_file():
        yield PartialRecording(path, final_path(path.with_suffix("")), (path,))
        return
    if path.name == CLEAN_NAME and (path.parent / SCENARIO_NAME).is_file():
        path = path.parent
    is_hidden = final_path(path).name != path.name
    for leftover in [path] if is_hidden and path.is_dir() else leftovers(path):
        if remains := _in_folder(leftover, final_path(leftover), is_leftover=True):
            with lock_leftover(leftover) as is_dead:
                if not is_dead:
                    raise AdvpipeError(f"{leftover} is still being written; wait for that run, or stop it")
                yield remains
            return
    if not path.is_dir() or not (remains := _in_folder(path, path, is_leftover=False)):
        raise UsageError(
            f"{path} holds no .mcap file, and no killed run left one next to it (in .{path.name}.partial-...)"
        )
    yield remains


def _in_folder(folder: Path, name: Path, is_leftover: bool) -> PartialRecording | None:
    clean = folder / CLEAN_NAME
    for bag in (*leftovers(clean), clean, folder):
        if files := sorted(bag.glob("*.mcap"), key=_number_last):
            return PartialRecording(folder, name, tuple(files), bag != folder, is_leftover)
    return None


def _number_last(file: Path) -> tuple[str, int]:
    """bag_2 before bag_10, as rosbag2 numbers the parts of a long recording."""
    stem = file.stem.rstrip("0123456789")
    return stem, int(file.stem[len(stem) :] or 0)
