"""Writes bags as OpenPCDet's custom data sets: points/*.npy, labels/*.txt, ImageSets/*.txt."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.frames import Frame, has_ground_truth
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.messages.cloud import xyzi
from advpipe.stages.export.form import ExportForm, ExportOptions, ExportSummary
from advpipe.stages.export.frames import (
    attacked_clouds,
    clean_frames,
    select_bags,
    validation_names,
    write_splits,
)
from advpipe.stages.export.openpcdet_files import write_openpcdet_configurations


class OpenPcdetExport(ExportForm):
    """A folder a bag, each a data set of its own; labels are as exact as the bag."""

    title: ClassVar[str] = "OpenPCDet's custom data sets"

    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """Write the clean bag, then the clouds of the attacked ones beside copies of its labels."""
        chosen = select_bags(bags)
        is_labelled = has_ground_truth(chosen.clean, options.lidar_topic)
        root = folder / chosen.clean_name
        for name in ("points", "labels"):
            (root / name).mkdir(parents=True)
        names: dict[int, str] = {}
        naming = read_frame_names(chosen.clean)
        labelled, objects = [], 0
        for frame in clean_frames(chosen.clean, options):
            name = names[frame.stamp_ns] = naming.of(frame.stamp_ns, frame.index)
            np.save(root / "points" / f"{name}.npy", xyzi(frame.cloud))
            lines = list(_lines(frame)) if is_labelled else []
            (root / "labels" / f"{name}.txt").write_text("".join(lines), encoding="utf-8")
            objects += len(lines)
            if lines:
                labelled.append(name)
        validation = validation_names(labelled)
        write_splits(root, labelled, validation)
        for name, bag in chosen.attacked.items():
            written = _write_attacked(folder / name, root, _attacked_tables(bag, names, options))
            write_splits(folder / name, [each for each in labelled if each in written], validation)
        write_openpcdet_configurations(folder, chosen.clean_name, list(chosen.attacked))
        notes = [*chosen.notes]
        if not is_labelled:
            notes.append("the bag has no ground truth: labels and ImageSets are empty")
        elif len(labelled) < len(names):
            share = f"{len(names) - len(labelled)} of {len(names)}"
            notes.append(f"frames without objects ({share}) are not in ImageSets: OpenPCDet cannot read them")
        bag_count = 1 + len(chosen.attacked)
        return ExportSummary(folder, "openpcdet", bag_count, len(names), objects, tuple(notes))


def _write_attacked(folder: Path, clean: Path, clouds: Iterator[tuple[str, np.ndarray]]) -> set[str]:
    for name in ("points", "labels"):
        (folder / name).mkdir(parents=True)
    written = set()
    for name, points in clouds:
        np.save(folder / "points" / f"{name}.npy", points)
        shutil.copyfile(clean / "labels" / f"{name}.txt", folder / "labels" / f"{name}.txt")
        written.add(name)
    return written


def _attacked_tables(
    bag: Path, names: Mapping[int, str], options: ExportOptions
) -> Iterator[tuple[str, np.ndarray]]:
    """The tables (N, 4) of an adversarial bag by the names of frames."""
    for name, cloud in attacked_clouds(bag, names, options):
        yield name, xyzi(cloud)


def _lines(frame: Frame) -> Iterator[str]:
    """A line an object, those included that count neither way: by their class, if it is no class of ours.

    The form cannot say where objects are not labelled: those outside the labelled regions are written too.
    """
    ignored = frame.uncounted.boxes
    geometry = np.concatenate([frame.boxes.geometry, ignored.geometry])
    names: Sequence[str] = [*(CLASSES[label] for label in frame.boxes.labels), *ignored.class_names]
    for box, name in zip(geometry, names, strict=True):
        numbers = " ".join(repr(float(value)) for value in box)
        yield f"{numbers} {KITTI_NAMES.get(name, name.replace(' ', '_'))}\n"
