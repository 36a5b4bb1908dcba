"""How much an import has read, and what it noticed, part by part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.document import Document, read_json, read_text
from advpipe.pipeline.core.text import counted, escape_unprintable
from advpipe.stages.import_.drive import DriveFrame
from advpipe.stages.import_.sparse import CloudSize

_NAME = "part.json"


@dataclass(frozen=True)
class FrameCounts:
    """Counts over frames and vehicles; objects are labelled ones that count, ignored those that do not,
    regions those in which nothing counts."""

    clouds: int = 0
    points: int = 0
    objects: int = 0
    ignored: int = 0
    regions: int = 0

    @classmethod
    def of(cls, frame: DriveFrame) -> FrameCounts:
        """The counts of one frame."""
        vehicles = frame.vehicles.values()
        return cls(
            clouds=sum(len(vehicle.clouds) for vehicle in vehicles),
            points=sum(len(cloud) for vehicle in vehicles for cloud in vehicle.clouds.values()),
            objects=sum(len(vehicle.boxes) for vehicle in vehicles if vehicle.boxes is not None),
            ignored=sum(len(vehicle.ignored) for vehicle in vehicles),
            regions=sum(len(vehicle.coverage.ignored) for vehicle in vehicles),
        )

    def __add__(self, other: FrameCounts) -> FrameCounts:
        return FrameCounts(*(a + b for a, b in zip(_values(self), _values(other), strict=True)))

    def __str__(self) -> str:
        mean = f"{self.points / max(self.clouds, 1):,.0f}"
        clouds = counted(self.clouds, "cloud")
        return f"{clouds} of {mean} points{' on average' if self.clouds > 1 else ''}, {self.labels}"

    @property
    def labels(self) -> str:
        """How much is labelled, and how much of it does not count, in words."""
        neither = [
            counted(count, what)
            for count, what in ((self.ignored, "other"), (self.regions, "region"))
            if count
        ]
        uncounted = f" (and {' and '.join(neither)} that count neither way)" if neither else ""
        return f"{counted(self.objects, 'labelled object')}{uncounted}"


def cloud_sizes(frame: DriveFrame) -> Iterator[CloudSize]:
    """The sizes of a frame's clouds."""
    for name, vehicle in frame.vehicles.items():
        for lidar, cloud in vehicle.clouds.items():
            shown = escape_unprintable(frame.name)
            yield CloudSize(lidar=f"{name}/{lidar}", frame=shown, points=len(cloud))


class PartSummary(Document):
    """What is kept beside a finished part: a run that resumes says the same as one that was not killed.

    counts: of its frames. sizes: of its clouds. warnings, near_boxes, hit_boxes: of
    the checks, up to its end.
    """

    counts: FrameCounts
    sizes: tuple[CloudSize, ...] = ()
    warnings: tuple[str, ...] = ()
    near_boxes: int = 0
    hit_boxes: int = 0

    def write(self, folder: Path) -> None:
        """Keep it in the folder of the part."""
        (folder / _NAME).write_text(self.model_dump_json(), encoding="utf-8")


def read_part_summary(folder: Path) -> PartSummary:
    """What was written into a folder."""
    where = folder / _NAME
    summary: PartSummary = read_json(read_text(where), PartSummary, str(where), "import again")
    return summary


def _values(counts: FrameCounts) -> tuple[int, ...]:
    return counts.clouds, counts.points, counts.objects, counts.ignored, counts.regions
