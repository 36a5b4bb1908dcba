"""The form `pcd`: a file a cloud, with boxes, poses and times as text; `advpipe import files` reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.frames import Frame, find_lidar_topic, has_ground_truth, read_frames, vehicle_topics
from advpipe.pipeline.bag.ground_truth import LATENCY_NS, GroundTruth
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.topics import MAP_FRAME, TF
from advpipe.stages.export.form import ExportForm, ExportOptions, ExportSummary

_KINDS = {"f": "F", "u": "U", "i": "I"}
_IGNORED = "ignore"


class PcdExport(ExportForm):
    """`<bag>/points/000000.pcd`, `labels/000000.txt`, `poses.txt`, `times.txt`; frames keep their names."""

    title = "folders of .pcd files with boxes, poses and times as text"

    def write(self, bags: Mapping[str, Path], folder: Path, options: ExportOptions) -> ExportSummary:
        """See `ExportForm.write`."""
        names: dict[int, str] = {}
        counts: list[tuple[int, int]] = []
        notes = []
        for bag_name, bag in bags.items():
            exported = _BagExport(bag, folder / bag_name, options.lidar_topic)
            chosen = _named_frames(bag, options, names) if names else _first_frames(bag, options, names)
            for name, frame in track(chosen, f"exporting {bag_name}"):
                exported.write(name, frame)
            exported.finish()
            counts.append((exported.frames, exported.objects))
            if exported.frames and len(exported.poses) < exported.frames:
                notes.append(f"{bag_name}: no poses.txt, as the bag has no pose for each cloud.")
        return ExportSummary(folder, "pcd", len(bags), *counts[0], tuple(notes))


def _first_frames(bag: Path, options: ExportOptions, names: dict[int, str]) -> Iterator[tuple[str, Frame]]:
    """The chosen frames of the first bag, which name those of the others by their stamps."""
    naming = read_frame_names(bag, is_ordered=True)  # as poses and times have a line a file
    for frame in read_frames(bag, options.frames, lidar_topic=options.lidar_topic):
        names[frame.stamp_ns] = naming.of(frame.stamp_ns, frame.index)
        yield names[frame.stamp_ns], frame


def _named_frames(bag: Path, options: ExportOptions, names: Mapping[int, str]) -> Iterator[tuple[str, Frame]]:
    for frame in read_frames(bag, lidar_topic=options.lidar_topic):
        if frame.stamp_ns in names:
            yield names[frame.stamp_ns], frame


class _BagExport:
    """The folder of one bag in the making."""

    def __init__(self, bag: Path, folder: Path, lidar_topic: str | None) -> None:
        self._reader = BagReader(bag)
        self._topic = find_lidar_topic(self._reader, lidar_topic)
        self._times_ns = self._reader.log_times_ns(self._topic)
        self._has_truth = has_ground_truth(bag, lidar_topic)
        self._frame_id = ""
        self._folder = folder
        self.frames = self.objects = 0
        self.poses: list[str] = []
        self._stamps: list[str] = []
        (folder / "points").mkdir(parents=True)
        if self._has_truth:
            (folder / "labels").mkdir()

    def write(self, name: str, frame: Frame) -> None:
        (self._folder / "points" / f"{name}.pcd").write_bytes(pcd_bytes(frame.cloud))
        if self._has_truth:
            lines = list(_label_lines(frame))
            (self._folder / "labels" / f"{name}.txt").write_text("".join(lines), encoding="utf-8")
            self.objects += len(frame.boxes)
        self.frames += 1
        seconds, nanoseconds = divmod(frame.stamp_ns, 1_000_000_000)
        self._stamps.append(f"{seconds}.{nanoseconds:09d}\n")
        pose = self._map_SE3_lidar(frame)
        if pose is not None:
            self.poses.append(" ".join(repr(float(value)) for value in pose[:3].ravel()) + "\n")

    def finish(self) -> None:
        """Write what all clouds have a line in."""
        (self._folder / "times.txt").write_text("".join(self._stamps), encoding="utf-8")
        if self.poses and len(self.poses) == self.frames:
            (self._folder / "poses.txt").write_text("".join(self.poses), encoding="utf-8")

    def _map_SE3_lidar(self, frame: Frame) -> Float64 | None:
        """The LiDAR's pose at a cloud, None where the bag has none."""
        topics, time_ns = vehicle_topics(self._topic), int(self._times_ns[frame.index])
        if not self._frame_id:
            raw = next(self._reader.raw_messages([self._topic], time_ns, time_ns))
            self._frame_id = self._reader.cloud(raw).frame_id
        truth = GroundTruth(self._reader, topics, "")
        latency_ns = 0 if time_ns == frame.stamp_ns else LATENCY_NS
        wanted = [topics.true_odometry.name, TF.name]
        for raw in self._reader.raw_messages(wanted, max(0, time_ns - latency_ns), time_ns + latency_ns):
            truth.take(raw)
        try:
            return invert(truth.lidar_SE3(MAP_FRAME, frame.stamp_ns, self._frame_id))
        except AdvpipeError:  # no transform connects the two
            return None


def _label_lines(frame: Frame) -> Iterator[str]:
    """`x y z dx dy dz heading class id`, as OpenPCDet's custom form has it, with the id behind."""
    boxes, ignored = frame.boxes, frame.uncounted.boxes
    for box, label, name in zip(boxes.geometry, boxes.labels, boxes.ids, strict=True):
        yield _label_line(box, CLASSES[label], name)
    for box, name in zip(ignored.geometry, ignored.ids, strict=True):
        yield _label_line(box, _IGNORED, name)


def _label_line(box: Float64, class_name: str, name: str) -> str:
    words = [*(repr(float(value)) for value in box), class_name, "_".join(name.replace(",", " ").split())]
    return " ".join(filter(None, words)) + "\n"


def pcd_bytes(cloud: Cloud) -> bytes:
    """The points (N,) of any structured type as a binary PCD file: the same bits, in the same order."""
    names = cloud.dtype.names or ()
    kinds = [cloud.dtype[name] for name in names]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\n"
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}\n"
        f"TYPE {' '.join(_KINDS[kind.kind] for kind in kinds)}\n"
        f"COUNT {' '.join('1' for _ in names)}\n"
        f"WIDTH {len(cloud)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud)}\nDATA binary\n"
    )
    return header.encode() + cloud.tobytes()
