"""Writes bags in OPV2V's form, which OpenCOOD reads."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.frames import find_lidar_topic, vehicle_topics
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.option_names import option_name
from advpipe.stages.export.form import ExportForm, ExportOptions, ExportSummary
from advpipe.stages.export.opv2v.frame import write_frame
from advpipe.stages.export.opv2v.ids import Numbers
from advpipe.stages.export.opv2v.ticks import Ticks
from advpipe.stages.export.recorded import drive_name, recorded_frames

NAMES = "ids.json"
"""Beside the agents' folders: our ids by the numbers that stand for them."""


class Opv2vExport(ExportForm):
    """A folder of scenarios for each bag (`clean`, and each attack's id), each with one scenario.

    Every vehicle with a LiDAR is an agent; `ego` has the number 0, which OpenCOOD takes for ego. Agents,
    objects and frames have the same numbers in all bags.
    """

    title: ClassVar[str] = "OPV2V"

    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """Write the bags. Raises AdvpipeError for one without boxes or poses."""
        first = next(iter(bags.values()))
        topics = self.taken_topics(first, options)
        numbers = Numbers(vehicle_topics(topic).vehicle for topic in topics)
        writer = _Writer(numbers, Ticks(read_frame_names(first, as_numbers=True, is_ordered=True).names))
        objects = 0
        scenario = drive_name(bags)
        for name, bag in bags.items():
            has = BagReader(bag).topics
            for topic in (topic for topic in topics if topic in has):
                number = numbers.of(vehicle_topics(topic).vehicle)
                chosen = ALL_FRAMES if writer.ticks else options.frames
                writer.write(bag, topic, chosen, folder / name / scenario / str(number))
            objects = objects or writer.objects  # of the clean bag, which comes first
        for name in bags:
            text = json.dumps(numbers.names(), indent=1) + "\n"
            (folder / name / scenario / NAMES).write_text(text, encoding="utf-8")
        note = f"OpenCOOD opens each of {', '.join(bags)} as root_dir or validate_dir."
        return ExportSummary(
            folder, "opv2v", len(bags), len(writer.ticks), objects, (note, *sorted(writer.notes))
        )

    def taken_topics(self, bag: Path, options: ExportOptions) -> Sequence[str]:
        """The LiDAR of each vehicle."""
        return _topics(bag, options.lidar_topic)


class _Writer:
    """Writes agents; the ticks are those of the first one."""

    def __init__(self, numbers: Numbers, ticks: Ticks) -> None:
        self.numbers, self.ticks = numbers, ticks
        self.objects = 0
        self.notes: set[str] = set()

    def write(self, bag: Path, topic: str, chosen: FrameSlice, folder: Path) -> None:
        folder.mkdir(parents=True)
        is_first = not self.ticks
        is_empty = True
        for frame in recorded_frames(bag, topic, chosen, None if is_first else self.ticks):
            if not frame.has_pose:
                raise AdvpipeError(f"{bag}: no transform says where {topic} is in the map; OPV2V needs poses")
            if is_first:
                self.ticks.add(frame.stamp_ns)
            if len(frame.ignored):
                self.notes.add("Objects that count neither way are left out, since this form has none.")
            if frame.covers_view_only:
                self.notes.add("Only a part of the surroundings is labelled, which this form cannot say.")
            written = write_frame(folder / self.ticks.name(frame.stamp_ns), frame, self.numbers)
            if written < len(frame.boxes):
                self.notes.add("Pedestrians are left out: this form has vehicles alone.")
            is_empty = False
            self.objects += written
        if is_empty:
            raise UsageError(
                f"{bag}: no cloud of {topic} has the stamp of a chosen one of the first LiDAR in the clean "
                f"bag; choose other frames ({option_name('frames')}), or one LiDAR ({option_name('lidar')})"
            )
        self.notes |= self.ticks.notes


def _topics(bag: Path, lidar_topic: str | None) -> Sequence[str]:
    """The LiDAR of each vehicle, `ego` first: its `lidar`, or the first by name."""
    reader = BagReader(bag)
    if lidar_topic is not None:
        return [find_lidar_topic(reader, lidar_topic)]
    chosen: dict[str, str] = {}
    for topic in lidar_topics(reader):
        own = vehicle_topics(topic)
        if own.lidar == "lidar":
            chosen[own.vehicle] = topic
        else:
            chosen.setdefault(own.vehicle, topic)
    if not chosen:
        return [find_lidar_topic(reader)]  # which raises
    return [chosen[vehicle] for vehicle in sorted(chosen, key=lambda vehicle: (vehicle != "ego", vehicle))]
