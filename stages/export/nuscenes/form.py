"""Writes bags in nuScenes' form, which its development kit opens."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES
from advpipe.pipeline.core.option_names import option_name
from advpipe.stages.export.form import ExportForm, ExportOptions, ExportSummary
from advpipe.stages.export.nuscenes.scene import VERSION, SceneWriter
from advpipe.stages.export.nuscenes.tables import TableWriter
from advpipe.stages.export.recorded import drive_name, recorded_frames


class NuscenesExport(ExportForm):
    """A data set's folder for each bag (`clean`, and each attack's id), each with one scene.

    Scene, samples, instances and files have the same names and tokens in all of them. Every cloud is a key
    frame, since every cloud has boxes.
    """

    title: ClassVar[str] = "nuScenes"

    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """Write the bags. Raises UsageError for one without boxes."""
        counts: dict[str, int] = {}
        stamps_ns: set[int] | None = None
        frames = objects = 0
        scene = drive_name(bags)
        notes: dict[str, None] = {}
        for name, bag in bags.items():
            topic = find_lidar_topic(BagReader(bag), options.lidar_topic)
            chosen = options.frames if stamps_ns is None else ALL_FRAMES
            with TableWriter(folder / name / VERSION) as tables:
                writer = SceneWriter(folder / name, scene, tables, counts)
                for frame in recorded_frames(bag, topic, chosen, stamps_ns):
                    writer.add(frame)
                if not writer.stamps_ns:
                    raise UsageError(
                        f"{bag} has none of the clean bag's chosen frames; choose others "
                        f"({option_name('frames')})"
                    )
                writer.finish()
            if stamps_ns is None:
                frames, objects = len(writer.stamps_ns), writer.objects.count
            notes |= dict.fromkeys(sorted(writer.notes))
            stamps_ns = writer.stamps_ns if stamps_ns is None else stamps_ns
        note = f"NuScenes('{VERSION}', dataroot) opens each of {', '.join(bags)} as dataroot."
        return ExportSummary(folder, "nuscenes", len(bags), frames, objects, (note, *notes))
