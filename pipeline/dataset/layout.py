"""What a data set's folder holds: a clean bag, adversarial bags, reports, the scenario."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.locate import CLEAN_NAME, adversarial_bags
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset.leftovers import Leftover, find_leftovers

SCENARIO_NAME = "scenario.yaml"
SOURCE_NAME = "source.yaml"
"""In place of a scenario, where the drive of an imported data set comes from."""
EXPORT_MARK = "advpipe-export.json"
"""The file by which an exported folder is recognised."""
CARD_NAME = "README.md"
REPORTS_NAME = "reports"
REPORT_NAME = "report.json"

MOST_LEVELS = 100
"""Of folders within each other. Ours has four; thousands take systems, and programs, to their limits."""

_NOT_EVERYWHERE = frozenset('\\:*?"<>|')
"""Signs that mean something else in a name on some systems, `C:x` another folder."""


@dataclass(frozen=True)
class Layout:
    """A data set; every path lies in `folder`.

    attacks: the adversarial bags by name. reports: the folders with a report.json. scenario: of a simulated
    drive. source: of an imported one. card: README.md. The last three are None where there is none.
    leftovers: of killed runs, and what living ones write; no part of the data set.
    """

    folder: Path
    clean: Path
    attacks: tuple[Path, ...]
    reports: tuple[Path, ...]
    scenario: Path | None
    source: Path | None
    card: Path | None
    leftovers: tuple[Leftover, ...]

    @property
    def bags(self) -> tuple[Path, ...]:
        """The clean bag and all adversarial ones."""
        return (self.clean, *self.attacks)

    def refuse_running(self) -> None:
        """Raises AdvpipeError where a living run is at work in the data set."""
        for leftover in self.leftovers:
            if leftover.is_running:
                raise AdvpipeError(f"{leftover.path} is locked by a run; wait until it ends, or stop it")


def read_layout(folder: Path) -> Layout:
    """Raises AdvpipeError for a folder that is no data set."""
    folder = Path(folder)
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "does not exist"
        raise UsageError(f"{folder} {what}; give a data set, a folder with {CLEAN_NAME}/")
    if not is_dataset(folder):
        raise UsageError(
            f"{folder} is not a data set: it holds no {CLEAN_NAME}/{METADATA_NAME}; `advpipe "
            "simulate` makes one"
        )
    reports = folder / REPORTS_NAME
    return Layout(
        folder,
        folder / CLEAN_NAME,
        tuple(adversarial_bags(folder)),
        tuple(sorted(path.parent for path in reports.glob(f"[!.]*/{REPORT_NAME}"))),
        _if_file(folder / SCENARIO_NAME),
        _if_file(folder / SOURCE_NAME),
        _if_file(folder / CARD_NAME),
        tuple(find_leftovers(folder, too_deep=refuse_deep)),
    )


def is_dataset(folder: Path) -> bool:
    """Whether a folder holds a clean bag."""
    return (folder / CLEAN_NAME / METADATA_NAME).is_file()


def files(folder: Path) -> list[str]:
    """Relative POSIX paths of all files below a folder, sorted by their bytes in UTF-8.

    Raises AdvpipeError for a link, a device, a name that a list of checksums cannot hold, and for folders
    that lie too deep.
    """
    return sorted(_files(folder, folder), key=lambda name: name.encode())


def _files(folder: Path, root: Path, level: int = 0) -> Iterator[str]:
    refuse_deep(level, root)
    with os.scandir(folder) as entries:
        for entry in entries:
            path = folder / entry.name
            if not is_portable(entry.name):
                raise AdvpipeError(
                    f"{str(path)!r}: a name with characters that not every system supports; rename it"
                )
            if entry.is_dir(follow_symlinks=False):
                yield from _files(path, root, level + 1)
            elif entry.is_file(follow_symlinks=False):
                yield path.relative_to(root).as_posix()
            else:
                raise AdvpipeError(
                    f"{path} is a link or not a regular file; a data set holds regular files only"
                )


def refuse_deep(level: int, place: Path) -> None:
    """Raises AdvpipeError for a file or folder below more folders than a data set has."""
    if level > MOST_LEVELS:
        raise AdvpipeError(
            f"{place} has folders nested more than {MOST_LEVELS} levels deep, which no data set needs"
        )


def is_portable(name: str) -> bool:
    """Whether a relative POSIX path stays in its folder and is spelt in one way on every system."""
    return (
        name.isprintable()
        and _NOT_EVERYWHERE.isdisjoint(name)
        and not name.startswith("/")
        and PurePosixPath(name).as_posix() == name
        and not {"..", "."} & set(name.split("/"))
    )


def is_hidden(name: str) -> bool:
    """Whether a relative path has a part that begins with a dot: such files are not shared."""
    return any(part.startswith(".") for part in name.split("/"))


def _if_file(path: Path) -> Path | None:
    return path if path.is_file() else None
