"""A form of data sets that can be imported."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.stages.import_.drive import DriveSource
from advpipe.stages.import_.options import ImportOptions


class DriveForm(ABC):
    """One form, such as KITTI's folders.

    title: for people. licence: SPDX identifier under which the data set is published, None where it depends
    on the source. citation: what its authors ask to be cited. takes: names of the options beyond those that
    all forms take. classes: the source's classes and ours, or `IGNORED` or `DROPPED`.
    """

    title: ClassVar[str]
    licence: ClassVar[str | None] = None
    citation: ClassVar[str] = ""
    takes: ClassVar[tuple[str, ...]] = ()
    classes: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def open(self, source: Path, options: ImportOptions) -> DriveSource:
        """Open a drive: check the folders, count the frames, read what all frames share.

        Raises UsageError, one line with what is wrong, where, and how to fix it.
        """

    def class_map(self, options: ImportOptions) -> Mapping[str, str]:
        """The source's classes and ours, with the user's choice on top."""
        return {**self.classes, **options.classes}
