"""The report's part on cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_pictures import RecordedCamera, recorded_cameras
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import working_on
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.detector.registry import detector_slug
from advpipe.pipeline.detector.training_maps import is_training_map, map_of
from advpipe.pipeline.image_detector.protocol import ImageDetector
from advpipe.pipeline.image_detector.registry import image_detector_named, image_detector_sha256
from advpipe.pipeline.image_detector.scoring import picture_scores
from advpipe.pipeline.metrics.kitti import KITTI_DIFFICULTIES
from advpipe.pipeline.results.camera import CameraRecord
from advpipe.stages.evaluate.camera.picture import draw_pictures
from advpipe.stages.evaluate.camera.seen import Moment, SeenPictures
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

NONE = "none"
"""Instead of an image detector: no camera is scored."""

CLEAN, ADVERSARIAL = "clean", "adv"
MODERATE = "moderate"

FORMULAS = (
    Formula(
        "camera_ap",
        "2D average precision at 40 recall positions, against the amodal boxes of `labels`; a detection "
        "matches by an overlap of 0.7 (car, truck) or 0.5 (cyclist, pedestrian), for ap_half of 0.5. "
        + "; ".join(
            f"{each.name}: higher than {each.min_height_px:g} px, occlusion at most {each.max_occlusion}, "
            f"truncation at most {100 * each.max_truncation:g} %"
            for each in KITTI_DIFFICULTIES
        )
        + "; harder objects and lower detections count neither way",
        ("ap", "ap_half", "objects"),
        title="Average precision in pictures",
    ),
    Formula(
        "camera_moments",
        "a moment is when the clean bag has a labelled picture; the detector sees the newest picture that "
        "has arrived by then, an old one where pictures are late, frozen or missing. Figures of an "
        "adversarial bag are of the moments at which this is not the clean picture",
        ("pictures", "condition"),
        title="What a camera shows at a moment",
    ),
    Formula(
        "camera_lost",
        "objects found in the clean pictures, with the score of the best F1 there and an overlap of 0.5, "
        "that are not found with it in the attacked ones",
        ("found", "lost", "min_score"),
        title="Objects lost in pictures",
    ),
)


@dataclass(frozen=True)
class _Attacked:
    """One camera in one bag: its moments, clean and attacked."""

    bag: Path
    camera: RecordedCamera
    clean: Sequence[Moment]
    adversarial: Sequence[Moment]


def camera_sections(
    clean: Path,
    adversarial: Sequence[Path],
    detector: str,
    device: str,
    window: Window = WHOLE_DRIVE,
) -> tuple[ReportSection, ...]:
    """One section on the cameras of the clean bag that have labelled pictures; none without objects.

    detector: as `image_detector_named` takes it, or `none`. Raises AdvpipeError for pictures that cannot be
    decoded and for an unknown detector.
    """
    reader = BagReader(clean)
    cameras = [] if detector == NONE else recorded_cameras(reader)
    if not cameras:
        return ()
    with working_on("cameras"):
        model = image_detector_named(detector, device)
        seen, records, attacked = SeenPictures(model), list[CameraRecord](), list[_Attacked]()
        empty: list[str] = []
        for camera in cameras:
            moments = seen.clean(reader, camera, window)
            records += _records("clean", camera, detector, seen, moments, moments)
            for bag in adversarial:
                differing = seen.attacked(reader, BagReader(bag), camera, moments, window)
                at = {each.stamp_ns for each in differing}
                same = [each for each in moments if each.stamp_ns in at]
                own = list(_records(bag_name(bag), camera, detector, seen, same, differing))
                records += own
                if differing:
                    attacked.append(_Attacked(bag, camera, same, differing))
                if differing and not own:
                    empty.append(_no_objects(bag, camera, len(differing)))
        pictures = tuple(_picture(reader, each, seen, window) for each in attacked)
    rows = tuple(records)
    if not rows and not empty:
        return ()
    terminal = _terminal(rows, " ".join(empty))
    return (
        ReportSection(
            key="camera",
            title="Pictures",
            lead=f"What the image detector {detector_slug(detector)} finds in the cameras' pictures.",
            tables=tuple(_tables(rows)),
            pictures=pictures,
            records=rows,
            notes=(*_notes(detector, model, reader), *empty),
            formulas=FORMULAS,
            terminal=(terminal,) if terminal.lines or empty else (),
        ),
    )


def check_image_detector(clean: Path, detector: str) -> None:
    """Raises UsageError for an image detector that cannot be loaded, where the clean bag has cameras."""
    if detector != NONE and recorded_cameras(BagReader(clean)):
        image_detector_named(detector)


def _records(
    bag: str,
    camera: RecordedCamera,
    detector: str,
    seen: SeenPictures,
    clean: Sequence[Moment],
    shown: Sequence[Moment],
) -> Iterator[CameraRecord]:
    """Of each class and difficulty with objects: the clean pictures, then those of an adversarial bag."""
    truths = [each.truth for each in clean]
    scores = picture_scores(truths, seen.found(clean), seen.found(shown), seen.detector.classes)
    for each in scores if clean else ():
        conditions = (
            ((CLEAN, each.clean),) if bag == CLEAN else ((CLEAN, each.clean), (ADVERSARIAL, each.shown))
        )
        for condition, result in conditions if each.objects else ():
            yield CameraRecord(
                bag=bag,
                vehicle=camera.vehicle,
                camera=camera.name,
                detector=detector_slug(detector),
                detector_sha256=image_detector_sha256(detector),
                condition=condition,
                class_name=each.class_name,
                difficulty=each.difficulty,
                pictures=len(clean),
                objects=each.objects,
                ap=result.strict,
                ap_half=result.half,
                min_score=each.min_score,
                found=int(result.is_found.sum()),
                lost=int((each.clean.is_found & ~result.is_found).sum()),
            )


def _notes(detector: str, model: ImageDetector, reader: BagReader) -> tuple[str, ...]:
    if is_training_map(model, map_of(reader.provenance)):
        return (
            f"The image detector {detector_slug(detector)} was trained on drives on this map. Its figures "
            "here are better than on a map that it has not seen.",
        )
    return ()


def _picture(reader: BagReader, one: _Attacked, seen: SeenPictures, window: Window) -> ReportPicture:
    name, camera = bag_name(one.bag), one.camera
    caption = f"{name}: what is found in a picture of {camera.name} of {camera.vehicle}, clean and attacked"
    figure = draw_pictures(reader, BagReader(one.bag), camera, one.clean, one.adversarial, seen, window)
    return picture_of(SECTION, name, f"{name}-{camera.vehicle}-{camera.name}-camera.png", caption, figure)


def _pairs(rows: Sequence[CameraRecord]) -> list[tuple[CameraRecord, CameraRecord | None]]:
    """The clean row of each camera, class and difficulty, with the attacked one, if there is one."""
    found: dict[tuple[str, ...], list[CameraRecord]] = {}
    for row in rows:
        key = (row.bag, row.vehicle, row.camera, row.class_name, row.difficulty)
        found.setdefault(key, []).append(row)
    return [(both[0], both[1] if len(both) > 1 else None) for both in found.values()]


def _tables(rows: Sequence[CameraRecord]) -> Iterator[Table]:
    heads = ("class", "difficulty", "objects", "AP %", "AP at 0.5 %", "found", "lost")
    for (bag, vehicle, camera), group in groupby(rows, key=lambda row: (row.bag, row.vehicle, row.camera)):
        mine = list(group)
        lines = tuple(
            (
                *(clean.class_name, clean.difficulty, f"{clean.objects:,}"),
                _change(clean.ap, attacked.ap if attacked else None),
                _change(clean.ap_half, attacked.ap_half if attacked else None),
                f"{clean.found:,}" + (f" → {attacked.found:,}" if attacked else ""),
                f"{attacked.lost:,}" if attacked else "–",
            )
            for clean, attacked in _pairs(mine)
        )
        what = "attacked picture" if bag != CLEAN else "picture"
        title = f"{bag}, {vehicle}: {camera}, {counted(mine[0].pictures, what)}"
        note = "" if bag == CLEAN else "Clean → attacked, at the same moments."
        yield Table(title, heads, lines, note)


def _change(clean: float, attacked: float | None) -> str:
    """Shares in percent."""
    text = formatted_number(100 * clean, 1)
    return text if attacked is None else f"{text} → {formatted_number(100 * attacked, 1)}"


def _no_objects(bag: Path, camera: RecordedCamera, pictures: int) -> str:
    what = counted(pictures, "attacked picture")
    return f"{bag_name(bag)}: in {what} of {camera.name} of {camera.vehicle}, no labelled object counts."


def _terminal(rows: Sequence[CameraRecord], note: str) -> Table:
    """The figures at moderate difficulty."""
    lines = tuple(
        (
            f"{clean.bag}: {clean.vehicle}: {clean.camera}",
            clean.class_name,
            f"{clean.objects:,}",
            _change(clean.ap, attacked.ap if attacked else None),
            f"{attacked.lost:,}" if attacked else "–",
        )
        for clean, attacked in _pairs([row for row in rows if row.difficulty == MODERATE])
    )
    title = "Pictures: 2D AP in percent at moderate difficulty"
    return Table(title, ("camera", "class", "objects", "AP", "lost"), lines, note)
