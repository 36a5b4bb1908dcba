"""The report's part with KITTI's own rules."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.image_labels.label_camera import CameraAtFrame, LabelCamera
from advpipe.pipeline.metrics.kitti import KITTI_CLASSES, KITTI_DIFFICULTIES, kitti_precisions
from advpipe.pipeline.results.kitti import KittiRecord
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.kitti.objects import detected_objects, labelled_objects
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Formula, ReportSection, Table

CONDITIONS = ("clean", "adv")

FORMULAS = (
    Formula(
        "kitti_difficulty",
        "; ".join(
            f"{each.name}: 2D box higher than {each.min_height_px:g} px, occlusion at most "
            f"{each.max_occlusion}, truncation at most {100 * each.max_truncation:g} %"
            for each in KITTI_DIFFICULTIES
        )
        + "; harder objects, Van for Car, Person_sitting for Pedestrian, and regions DontCare count neither "
        "way",
        ("difficulty",),
        title="KITTI's levels of difficulty",
    ),
    Formula(
        "kitti_ap",
        "precision by KITTI's own program, read at 40 recall positions (R40) and, as before 2019, at 11 "
        "(R11); official overlaps: Car .7, Pedestrian and Cyclist .5. Only detections in the image of "
        "camera 2, or of the drive's own camera, take part",
        ("r11", "r40"),
        title="Average precision by KITTI's own program",
    ),
)


def kitti_sections(clean: Path, summaries: Sequence[Summary], options: Options) -> tuple[ReportSection, ...]:
    """One section on all comparisons, where the clean bag has KITTI's labels of images; none elsewhere."""
    if not summaries or LabelCamera(clean, options.lidar_topic).is_virtual:
        return ()
    cameras = dict(_cameras(clean, summaries, options))
    records = tuple(record for summary in summaries for record in _records(summary, cameras))
    if not records:
        return ()
    bags = dict.fromkeys((each.bag, each.detector) for each in records)
    tables = tuple(_table(bag, detector, records) for bag, detector in bags)
    return (
        ReportSection(
            key="kitti",
            title="By KITTI's own rules",
            lead="The same detections, scored as KITTI's benchmark does: other objects and regions count, "
            "and other recall positions. The tables above are by our rules.",
            tables=tables,
            records=records,
            formulas=FORMULAS,
            terminal=tuple(_table(bag, detector, records, is_short=True) for bag, detector in bags),
        ),
    )


Instant = tuple[Frame, CameraAtFrame]


def _cameras(clean: Path, summaries: Sequence[Summary], options: Options) -> Iterator[tuple[int, Instant]]:
    """The frames that any comparison has, with their camera, by index."""
    wanted = sorted({frame.index for each in summaries for frame in each.comparison.frames})
    camera = LabelCamera(clean, options.lidar_topic)
    chosen = FrameSlice(wanted[0], wanted[-1] + 1)
    for frame in read_frames(clean, chosen, lidar_topic=options.lidar_topic):
        if frame.index in wanted:
            yield frame.index, (frame, camera.at(frame.stamp_ns))


def _records(summary: Summary, cameras: dict[int, Instant]) -> Iterator[KittiRecord]:
    comparison = summary.comparison
    frames = [frame for frame in comparison.frames if cameras[frame.index][1].labels is not None]
    truth = [labelled_objects(*cameras[frame.index]) for frame in frames]
    for condition in CONDITIONS:
        clouds = [_cloud(frame, condition) for frame in frames]
        if not clouds or None in clouds:
            continue
        detections = [
            detected_objects(cloud.detections, cameras[frame.index][1])
            for cloud, frame in zip(clouds, frames, strict=True)
            if cloud is not None
        ]
        for each in kitti_precisions(truth, detections):
            yield KittiRecord(
                bag=comparison.name,
                detector=comparison.detector,
                condition=condition,
                class_name=each.class_name,
                difficulty=each.difficulty,
                space=each.space,
                overlaps=each.overlaps,
                min_iou=each.min_iou,
                objects=each.objects,
                frames=len(frames),
                r11=each.r11,
                r40=each.r40,
            )


def _cloud(frame: FrameResult, condition: str) -> CloudResult | None:
    return frame.clean if condition == "clean" else frame.adversarial


COLUMNS = (
    ("3d", "r40", "3D R40"),
    ("bev", "r40", "BEV R40"),
    ("bbox", "r40", "2D R40"),
    ("3d", "r11", "3D R11"),
)
"""Space, value and head of the columns; the terminal shows the first two."""

_SHORT = 2


def _table(bag: str, detector: str, records: Sequence[KittiRecord], *, is_short: bool = False) -> Table:
    """Classes and difficulties with objects, and their average precision in percent at official overlaps."""
    mine = [
        each
        for each in records
        if (each.bag, each.detector, each.overlaps) == (bag, detector, "official") and each.objects
    ]
    conditions = [name for name in CONDITIONS if any(each.condition == name for each in mine)]
    percent = {
        (each.condition, each.class_name, each.difficulty, each.space, value): 100 * getattr(each, value)
        for each in mine
        for value in ("r11", "r40")
    }
    objects = {(each.class_name, each.difficulty): each.objects for each in mine}
    columns = COLUMNS[:_SHORT] if is_short else COLUMNS
    lines = [
        (
            name,
            difficulty.name,
            str(objects[name, difficulty.name]),
            *(
                formatted_number(percent[condition, name, difficulty.name, space, value], 2)
                for space, value, _ in columns
                for condition in conditions
            ),
        )
        for name in KITTI_CLASSES
        for difficulty in KITTI_DIFFICULTIES
        if (name, difficulty.name) in objects
    ]
    heads = tuple(
        f"{head} {condition}" if len(conditions) > 1 else head
        for _, _, head in columns
        for condition in conditions
    )
    frames = mine[0].frames if mine else 0
    return Table(
        f"{bag}, {detector}: KITTI's average precision in percent, {counted(frames, 'frame')}",
        ("class", "difficulty", "objects", *heads),
        tuple(lines),
        "Classes without an object that counts are left out; with few objects a value says little.",
    )
