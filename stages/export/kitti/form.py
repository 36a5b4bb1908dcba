"""Writes bags as folders of KITTI's object benchmark."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.frames import Frame, has_ground_truth
from advpipe.pipeline.image_labels.frame_labels import frame_labels
from advpipe.pipeline.image_labels.label_camera import CameraAtFrame, LabelCamera
from advpipe.pipeline.kitti.calibration import format_object_calibration
from advpipe.pipeline.messages.cloud import Cloud, xyzi
from advpipe.stages.export.form import ExportForm, ExportOptions, ExportSummary
from advpipe.stages.export.frames import (
    attacked_clouds,
    clean_frames,
    select_bags,
    validation_names,
    write_splits,
)
from advpipe.stages.export.kitti.toolboxes import write_kitti_configurations

_SHARED = ("calib", "image_2", "label_2")
"""Folders that adversarial bags have from the clean one."""


class KittiExport(ExportForm):
    """A folder a bag, each a data set of its own: training/{velodyne,label_2,calib,image_2} and ImageSets."""

    title: ClassVar[str] = "KITTI's object benchmark"

    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """Write the clean bag, then the clouds of the attacked ones beside copies of its labels."""
        chosen = select_bags(bags)
        writer = _CleanWriter(folder / chosen.clean_name, chosen.clean, options)
        for frame in clean_frames(chosen.clean, options):
            writer.write(frame)
        validation = validation_names(writer.labelled)
        write_splits(folder / chosen.clean_name, writer.labelled, validation)
        for name, bag in chosen.attacked.items():
            _write_attacked(folder, chosen.clean_name, name, bag, writer, options)
        write_kitti_configurations(folder, chosen.clean_name, list(chosen.attacked))
        notes = (*writer.notes, *chosen.notes)
        return ExportSummary(
            folder, "kitti", 1 + len(chosen.attacked), len(writer.names), writer.objects, notes
        )


class _CleanWriter:
    """Writes the frames of the clean bag, and remembers their names."""

    def __init__(self, folder: Path, bag: Path, options: ExportOptions) -> None:
        self._training = folder / "training"
        self._is_labelled = has_ground_truth(bag, options.lidar_topic)
        self._naming = read_frame_names(bag, as_numbers=True)
        self._camera = LabelCamera(bag, options.lidar_topic)
        self.names: dict[int, str] = {}
        self.labelled: list[str] = []
        self.objects = self._outside = 0
        for name in ("velodyne", "calib", "image_2", *(["label_2"] if self._is_labelled else [])):
            (self._training / name).mkdir(parents=True)

    def write(self, frame: Frame) -> None:
        """Write the files of a frame."""
        name = self._naming.of(frame.stamp_ns, frame.index)
        camera = self._camera.at(frame.stamp_ns)
        self.names[frame.stamp_ns] = name
        write_velodyne(self._training / "velodyne" / f"{name}.bin", frame.cloud)
        calibration = format_object_calibration(camera.calibration)
        (self._training / "calib" / f"{name}.txt").write_text(calibration, encoding="utf-8")
        _write_black_picture(self._training / "image_2" / f"{name}.png", camera.size_px)
        if self._is_labelled:
            self._write_labels(name, frame, camera)

    def _write_labels(self, name: str, frame: Frame, camera: CameraAtFrame) -> None:
        labels, outside = frame_labels(frame, camera)
        text = "".join(f"{label}\n" for label in labels)
        (self._training / "label_2" / f"{name}.txt").write_text(text, encoding="utf-8")
        self.objects += sum(label.has_box for label in labels)
        self._outside += outside
        if labels:
            self.labelled.append(name)

    @property
    def notes(self) -> list[str]:
        """What a user should know of the files."""
        notes = ["labels are rounded to .01 (m, rad, pixels), as KITTI's are; image_2 holds black pictures"]
        if not self._is_labelled:
            return [*notes, "the bag has no ground truth: there is no label_2, and ImageSets are empty"]
        if self._camera.is_virtual:
            notes.append("the bag has no camera 2: labels are those of a virtual one that looks forward")
        if self._outside:
            notes.append(f"objects outside the picture ({self._outside}) are left out, as in KITTI")
        if len(self.labelled) < len(self.names):
            share = f"{len(self.names) - len(self.labelled)} of {len(self.names)}"
            notes.append(f"frames without objects ({share}) are not in ImageSets: toolboxes cannot read them")
        return notes


def _write_attacked(
    folder: Path, clean_name: str, name: str, bag: Path, clean: _CleanWriter, options: ExportOptions
) -> None:
    """The clouds of an adversarial bag, and copies of what belongs to the same clean frames."""
    source, training = folder / clean_name / "training", folder / name / "training"
    shared = [each for each in _SHARED if (source / each).is_dir()]
    for each in ("velodyne", *shared):
        (training / each).mkdir(parents=True)
    written = set()
    for frame, cloud in attacked_clouds(bag, clean.names, options):
        write_velodyne(training / "velodyne" / f"{frame}.bin", cloud)
        for each in shared:
            suffix = ".png" if each == "image_2" else ".txt"
            shutil.copyfile(source / each / f"{frame}{suffix}", training / each / f"{frame}{suffix}")
        written.add(frame)
    validation = validation_names(clean.labelled)
    write_splits(folder / name, [each for each in clean.labelled if each in written], validation)


def write_velodyne(file: Path, cloud: Cloud) -> None:
    """Write x, y, z and intensity as little-endian float32; KITTI knows no ring and no time of a point."""
    xyzi(cloud).astype("<f4", copy=False).tofile(file)


def _write_black_picture(file: Path, size_px: tuple[int, int]) -> None:
    """A picture of the right size: toolboxes read it from there."""
    from PIL import Image

    Image.new("L", size_px).save(file)
