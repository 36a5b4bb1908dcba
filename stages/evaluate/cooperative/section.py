"""The report's part on cooperative perception: fused clouds and detections by false poses, and CPMs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.detector.adaptation import AS_THEY_ARE, Adaptation
from advpipe.pipeline.detector.adapted import adapted_detector
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.perceived_objects import read_object_labels
from advpipe.pipeline.metrics.average_precision import RankedMatches
from advpipe.pipeline.metrics.matching import FrameMatches
from advpipe.pipeline.replay.recorded_filter import vehicles_with_filter
from advpipe.pipeline.results.cooperative import CooperativeRecord
from advpipe.stages.evaluate.cooperative.conditions import CLEAN, CLOUDS, HEARD, TRUE, Condition, Conditions
from advpipe.stages.evaluate.cooperative.fusion import fuse_clouds
from advpipe.stages.evaluate.cooperative.heard_detections import HEARD_SCORE
from advpipe.stages.evaluate.cooperative.instants import asked_for, false_span, fused_instants
from advpipe.stages.evaluate.cooperative.pair import (
    Alignment,
    Pair,
    SharedFrame,
    find_pair,
    misalignment_deg,
    misalignment_m,
    shared_frames,
)
from advpipe.stages.evaluate.cooperative.picture import Fused, draw_fused
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.detection.scoring import CachedDetector, Truth, ground_truth, match
from advpipe.stages.evaluate.localisation.track import attacked_fixes_ns
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

SHOWN_SCORE = 0.3
"""The lowest score of the boxes in the picture."""
KEY = "cooperative"
"""The key under which `report.json` lists the section's records."""
CRITERIA = ("strict", "loose")

FORMULAS = (
    Formula(
        "cooperative",
        "the shared cloud, or the detections in it, are transformed to the fusing vehicle's frame by the "
        "poses that both vehicles report (their odometry). Truth: objects around the fusing vehicle with at "
        "least 5 points in both clouds together, aligned by true poses. CPMs: the vehicle's own detections, "
        "and the objects in its Local Dynamic Map that stations report in CPMs, by its own reported pose; "
        f"each counts with a score of {HEARD_SCORE:g}. Boxes around the fusing vehicle itself do not count. "
        "All rows are of the same instants, while poses or CPMs of any bag are false",
        ("ap_strict", "ap_loose", "objects", "frames"),
        title="Cooperative detection",
    ),
    Formula(
        "misalignment",
        "mean distance and mean angle between the other vehicle's sensor poses by true and by reported poses",
        ("misalignment_m", "misalignment_deg"),
        title="Misalignment of poses",
    ),
)


def cooperative_sections(
    clean: Path,
    adversarial: Sequence[Path],
    seed: int = 0,
    detector: str = "small",
    device: str = CPU,
    frames: FrameSlice = ALL_FRAMES,
    lidar_topic: str | None = None,
    adaptation: Adaptation = AS_THEY_ARE,
) -> tuple[ReportSection, ...]:
    """One section where two vehicles with LiDARs share clouds, and the GPS of one or CPMs were attacked; else
    none.

    frames: the clouds of `lidar_topic` at which to fuse; at most `MOST_FRAMES` of them, equally spaced.
    `seed` is not used. Raises AdvpipeError for bags without the sensors' mounting poses.
    """
    reader = BagReader(clean)
    pair = find_pair(reader)
    if pair is None:
        return ()
    attacked = [bag for bag in adversarial if _moves(reader, BagReader(bag), pair) or read_object_labels(bag)]
    if not attacked:
        return ()
    moved = {bag_name(bag): BagReader(bag) for bag in attacked}
    asked = asked_for(reader, pair, frames, lidar_topic)
    rows, most_displaced = cooperative_rows(reader, pair, moved, detector, device, asked, adaptation)
    title = "Cooperative perception: fused clouds, detections and CPMs under attack"
    if not rows:
        if frames == ALL_FRAMES:
            return ()
        lead = (
            f"No pose and no CPM is false in the frames {frames}, so nothing was fused. Choose later or "
            "more frames."
        )
        return (ReportSection(key=KEY, title=title, lead=lead),)
    own, other = pair.own.vehicle, pair.other.vehicle
    return (
        ReportSection(
            key=KEY,
            title=title,
            lead=f"{own} fuses its own perception with what {other} shares, or with the objects of all CPMs "
            "that it hears, while poses or CPMs are false.",
            tables=(_table(rows),),
            pictures=_pictures(most_displaced, own, other),
            records=tuple(rows),
            formulas=FORMULAS,
            terminal=(_overview(rows),),
        ),
    )


def _pictures(fused: Fused | None, own: str, other: str) -> tuple[ReportPicture, ...]:
    if fused is None:
        return ()
    caption = (
        f"Perception of {own}, fused with that of {other}, when the pose error is largest relative to their "
        "distance"
    )
    return (picture_of(SECTION, "", "cooperative.png", caption, draw_fused(fused, own, other)),)


def cooperative_rows(
    reader: BagReader,
    pair: Pair,
    adversarial: Mapping[str, BagReader],
    detector: str,
    device: str = CPU,
    asked: range | None = None,
    adaptation: Adaptation = AS_THEY_ARE,
) -> tuple[list[CooperativeRecord], Fused | None]:
    """The fusing vehicle alone, fused by clean and attacked poses, and with the objects of clean and attacked
    CPMs; a row for each class with objects.

    All rows are of the same instants, from the first to the last at which the poses of any bag differ from
    the clean bag's, or at which a CPM is false. asked: the clouds to choose from, by default all. The second
    value is the instant at which the smallest pose error was largest relative to the distance between both
    vehicles, for a picture; None without false poses.
    """
    bags = {CLEAN: reader, **adversarial}
    reported = {name: Alignment(bag, pair) for name, bag in bags.items()}
    moved_ns = {name: reported[name].changed_ns(reported[CLEAN]) for name in adversarial}
    spoken_ns = [label.time_ns for bag in adversarial.values() for label in read_object_labels(bag.path)]
    false = false_span(reader, pair, [*spoken_ns, *chain.from_iterable(moved_ns.values())])
    chosen = fused_instants(asked if asked is not None else asked_for(reader, pair), false)
    if chosen is None:
        return [], None
    cached = CachedDetector(adapted_detector(load_detector(detector, device), adaptation))
    conditions = Conditions(cached, pair, bags, reported, [name for name, at_ns in moved_ns.items() if at_ns])
    true = Alignment(reader, pair, true=True)
    poses_at = {TRUE: true, **{name: reported[name] for name in (CLEAN, *conditions.moved)}}
    matches: dict[tuple[Condition, str, str], list[FrameMatches]] = {}
    off: dict[str, list[tuple[float, float]]] = {name: [] for name in poses_at}
    picture = _LargestError()
    count = len(range(chosen.start, chosen.stop or 0, chosen.step))
    for frame in track(shared_frames(reader, pair, chosen), "cooperative perception", count):
        own_SE3_other = true.at(frame.own.stamp_ns)
        together = fuse_clouds(frame.own.cloud, frame.other, own_SE3_other)
        truth = ground_truth(frame.own, cached.classes, cached.range_m).counted_on(together)
        poses = {name: alignment.at(frame.own.stamp_ns) for name, alignment in poses_at.items()}
        for name, pose in poses.items():
            off[name].append((misalignment_m(pose, own_SE3_other), misalignment_deg(pose, own_SE3_other)))
        found = {each: _in_range(cached, conditions.see(each, frame, poses)) for each in conditions.all}
        for each, seen in found.items():
            for (criterion, label), one in match(truth, seen, cached.classes, CRITERIA).items():
                matches.setdefault((each, criterion, label), []).append(one)
        if conditions.moved:
            error_m = min(off[name][-1][0] for name in conditions.moved)
            by_clouds = {
                each.poses: (poses[each.poses], found[each]) for each in found if each.fusion == CLOUDS
            }
            picture.offer(error_m / float(np.linalg.norm(own_SE3_other[:3, 3])), frame, truth, by_clouds)
    rows = [
        _row(each, label, matches, off.get(each.poses, []) if each.fusion != HEARD else [])
        for each in conditions.all
        for label in cached.classes
        if sum(one.n_truth for one in matches.get((each, "strict", label), []))
    ]
    return rows, picture.fused


class _LargestError:
    """Keeps the instant of the largest relative error of poses, for a picture."""

    def __init__(self) -> None:
        self._greatest = -1.0
        self.fused: Fused | None = None

    def offer(
        self,
        relative_error: float,
        frame: SharedFrame,
        truth: Truth,
        by_clouds: Mapping[str, tuple[Float64, Detections]],
    ) -> None:
        """by_clouds: by whose poses clouds are fused, the pose of the other LiDAR and what is found."""
        if relative_error <= self._greatest:
            return
        boxes = truth.boxes.geometry[truth.is_evaluated]
        shown = {
            name: (pose, found.boxes[found.scores >= SHOWN_SCORE])
            for name, (pose, found) in by_clouds.items()
        }
        self._greatest, self.fused = relative_error, Fused(frame.own.cloud, frame.other, boxes, shown)


def _row(
    condition: Condition,
    label: str,
    matches: Mapping[tuple[Condition, str, str], Sequence[FrameMatches]],
    off: Sequence[tuple[float, float]],
) -> CooperativeRecord:
    strict, loose = (RankedMatches.of(matches[condition, criterion, label]) for criterion in CRITERIA)
    off_m, off_deg = np.mean(off, axis=0) if off else (np.nan, np.nan)
    return CooperativeRecord(
        poses=condition.poses,
        fusion=condition.fusion,
        label=label,
        frames=len(strict.n_truth),
        objects=int(strict.n_truth.sum()),
        ap_strict=strict.average_precision(),
        ap_loose=loose.average_precision(),
        misalignment_m=float(off_m),
        misalignment_deg=float(off_deg),
    )


def _in_range(cached: CachedDetector, found: Detections) -> Detections:
    """The detections in the detector's range: fused ones may lie beyond it."""
    kept = np.flatnonzero(cached.range_m.contains_centres(found.boxes))
    return Detections(found.boxes[kept], found.scores[kept], found.labels[kept])


def _moves(clean: BagReader, adversarial: BagReader, pair: Pair) -> bool:
    """Whether the fixes of one of the two vehicles were attacked."""
    known = {*vehicles_with_filter(clean)} & {*vehicles_with_filter(adversarial)}
    vehicles = [topics.vehicle for topics in (pair.own, pair.other) if topics.vehicle in known]
    return any(len(attacked_fixes_ns(clean, adversarial, vehicle)) for vehicle in vehicles)


def _table(rows: Sequence[CooperativeRecord]) -> Table:
    heads = ("poses", "fusion", "class", "boxes", "AP strict", "AP loose", "misaligned m", "misaligned °")
    lines = tuple(
        (
            row.poses,
            row.fusion or "–",
            row.label,
            str(row.objects),
            formatted_number(row.ap_strict, 3),
            formatted_number(row.ap_loose, 3),
            formatted_number(row.misalignment_m, 2),
            formatted_number(row.misalignment_deg, 1),
        )
        for row in rows
    )
    return Table("Average precision after fusion", heads, lines)


def _overview(rows: Sequence[CooperativeRecord]) -> Table:
    """The main columns, for a terminal."""
    heads = ("poses", "fusion", "class", "boxes", "AP strict", "AP loose", "misaligned m")
    lines = tuple(line[: len(heads)] for line in _table(rows).lines)
    return Table("Cooperative perception: average precision after fusion", heads, lines)
