"""A form of data sets that clean and adversarial bags can be exported to."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted


@dataclass(frozen=True)
class ExportOptions:
    """lidar_topic: one of several LiDARs. frames: those of the clean bag."""

    lidar_topic: str | None = None
    frames: FrameSlice = ALL_FRAMES


@dataclass(frozen=True, repr=False)
class ExportSummary(Tabular):
    """What was written. bags: how many, the clean one included. notes: sentences.

    frames: instants of the clean bag. objects: labels of them, those of each agent; every other bag repeats
    frames and labels.
    """

    folder: Path
    form: str
    bags: int
    frames: int
    objects: int
    notes: tuple[str, ...] = ()

    def __fspath__(self) -> str:
        return str(self.folder)

    def __str__(self) -> str:
        counts = (counted(self.bags, "bag"), counted(self.frames, "frame"), counted(self.objects, "object"))
        about = f"{self.folder}: {', '.join(counts)} as {self.form}"
        return "\n".join([about, *self.notes])

    def to_dicts(self) -> Rows:
        """One row: the folder and the counts."""
        return [{**asdict(self), "folder": str(self.folder), "notes": " ".join(self.notes)}]


class ExportForm(ABC):
    """One form, such as KITTI's folders. title: for people."""

    title: ClassVar[str]

    @abstractmethod
    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """Write the bags, by the names `clean` and the attacks' ids, into the new folder `folder`.

        A frame has the same name in each of them. Raises AdvpipeError for a bag without what the form needs.
        """

    def taken_topics(self, bag: Path, options: ExportOptions) -> Sequence[str]:
        """The topics of the clouds that it writes: one LiDAR, where it does not say otherwise."""
        return [find_lidar_topic(BagReader(bag), options.lidar_topic)]
