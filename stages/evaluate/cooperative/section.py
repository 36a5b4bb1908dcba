"""The report's part on cooperative perception: two vehicles fuse clouds or detections by false poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from advpipe.pipeline.metrics.average_precision import RankedMatches
from advpipe.pipeline.metrics.matching import FrameMatches
from advpipe.pipeline.replay.recorded_filter import vehicles_with_filter
from advpipe.pipeline.results.cooperative import CooperativeRecord
from advpipe.stages.evaluate.cooperative.fusion import fuse_clouds, fuse_detections, without_oneself
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
from advpipe.stages.evaluate.detection.scoring import CachedDetector, ground_truth, match
from advpipe.stages.evaluate.localisation.track import attacked_fixes_ns
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportSection, Table

SHOWN_SCORE = 0.3
"""The lowest score of the boxes in the picture."""
KEY = "cooperative"
"""The key under which `report.json` lists the section's records."""
CRITERIA = ("strict", "loose")
ALONE, TRUE, CLEAN = "alone", "true poses", "clean poses"

See = Callable[[CachedDetector, SharedFrame, Float64], Detections]

FUSIONS: dict[str, See] = {
    "clouds": lambda cached, frame, pose: cached.detect(fuse_clouds(frame.own.cloud, frame.other, pose)),
    "detections": lambda cached, frame, pose: fuse_detections(
        cached.detect(frame.own.cloud), cached.detect(frame.other), pose
    ),
}
"""Ways to fuse both vehicles' perception."""

FORMULAS = (
    Formula(
        "cooperative",
        "the shared cloud, or the detections in it, are transformed to the fusing vehicle's frame by the "
        "poses that both vehicles report (their odometry). Truth: objects around the fusing vehicle with at "
        "least 5 points in both clouds together, aligned by true poses. Boxes around the fusing vehicle "
        "itself do not count. All rows are of the same instants, while the poses of any bag are false",
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
    """One section where two vehicles with LiDARs share clouds and the GPS of one was attacked; else none.

    frames: the clouds of `lidar_topic` at which to fuse; at most `MOST_FRAMES` of them, equally spaced.
    `seed` is not used. Raises AdvpipeError for bags without the sensors' mounting poses.
    """
    reader = BagReader(clean)
    pair = find_pair(reader)
    if pair is None:
        return ()
    attacked = [bag for bag in adversarial if _moves(reader, BagReader(bag), pair)]
    if not attacked:
        return ()
    moved = {bag_name(bag): BagReader(bag) for bag in attacked}
    asked = asked_for(reader, pair, frames, lidar_topic)
    rows, most_displaced = cooperative_rows(reader, pair, moved, detector, device, asked, adaptation)
    title = "Cooperative perception under GPS attacks"
    if most_displaced is None:
        if frames == ALL_FRAMES:
            return ()
        lead = f"No pose is false in the frames {frames}, so nothing was fused. Choose later or more frames."
        return (ReportSection(key=KEY, title=title, lead=lead),)
    names = pair.own.vehicle, pair.other.vehicle
    caption = (
        f"Perception of {names[0]}, fused with that of {names[1]}, when the pose error is largest relative "
        "to their distance"
    )
    picture = picture_of(SECTION, "", "cooperative.png", caption, draw_fused(most_displaced, *names))
    return (
        ReportSection(
            key=KEY,
            title=title,
            lead=f"{names[0]} fuses its own perception with what {names[1]} shares, while poses are false.",
            tables=(_table(rows),),
            pictures=(picture,),
            records=tuple(rows),
            formulas=FORMULAS,
            terminal=(_overview(rows),),
        ),
    )


def cooperative_rows(
    reader: BagReader,
    pair: Pair,
    adversarial: Mapping[str, BagReader],
    detector: str,
    device: str = CPU,
    asked: range | None = None,
    adaptation: Adaptation = AS_THEY_ARE,
) -> tuple[list[CooperativeRecord], Fused | None]:
    """The fusing vehicle alone, and fused by clean and attacked poses; a row for each class with objects.

    All rows are of the same instants, from the first to the last at which the poses of any bag differ from
    the clean bag's. asked: the clouds to choose from, by default all. The second value is the instant at
    which the smallest pose error was largest relative to the distance between both vehicles, for a picture;
    None without instants.
    """
    true = Alignment(reader, pair, true=True)
    reported = {
        TRUE: true,
        CLEAN: Alignment(reader, pair),
        **{name: Alignment(other, pair) for name, other in adversarial.items()},
    }
    false = false_span(reader, pair, reported[CLEAN], [reported[name] for name in adversarial])
    chosen = fused_instants(asked if asked is not None else asked_for(reader, pair), false)
    if chosen is None:
        return [], None
    cached = CachedDetector(adapted_detector(load_detector(detector, device), adaptation))
    conditions = [(ALONE, ""), *((name, fusion) for fusion in FUSIONS for name in reported)]
    matches: dict[tuple[str, str, str, str], list[FrameMatches]] = {}
    off: dict[str, list[tuple[float, float]]] = {name: [] for name in reported}
    greatest, most_displaced = -1.0, None
    count = len(range(chosen.start, chosen.stop or 0, chosen.step))
    for frame in track(shared_frames(reader, pair, chosen), "cooperative perception", count):
        stamp_ns, own_SE3_other = frame.own.stamp_ns, true.at(frame.own.stamp_ns)
        together = fuse_clouds(frame.own.cloud, frame.other, own_SE3_other)
        truth = ground_truth(frame.own, cached.classes, cached.range_m).counted_on(together)
        poses = {name: alignment.at(stamp_ns) for name, alignment in reported.items()}
        for name, pose in poses.items():
            off[name].append((misalignment_m(pose, own_SE3_other), misalignment_deg(pose, own_SE3_other)))
        seen: dict[str, tuple[Float64, Float64]] = {}
        for name, fusion in conditions:
            own = frame.own.cloud
            seen_by = cached.detect(own) if name == ALONE else FUSIONS[fusion](cached, frame, poses[name])
            found = _in_range(cached, without_oneself(seen_by))
            if fusion == "clouds":
                seen[name] = poses[name], found.boxes[found.scores >= SHOWN_SCORE]
            for (criterion, label), one in match(truth, found, cached.classes, CRITERIA).items():
                matches.setdefault((name, fusion, criterion, label), []).append(one)
        error_m = min(off[name][-1][0] for name in adversarial)
        if (relative_error := error_m / float(np.linalg.norm(own_SE3_other[:3, 3]))) > greatest:
            boxes = truth.boxes.geometry[truth.is_evaluated]
            greatest, most_displaced = relative_error, Fused(frame.own.cloud, frame.other, boxes, seen)
    rows = [
        _row(name, fusion, label, matches, off.get(name, []))
        for name, fusion in conditions
        for label in cached.classes
        if sum(one.n_truth for one in matches.get((name, fusion, "strict", label), []))
    ]
    return rows, most_displaced


def _row(
    name: str,
    fusion: str,
    label: str,
    matches: Mapping[tuple[str, str, str, str], Sequence[FrameMatches]],
    off: Sequence[tuple[float, float]],
) -> CooperativeRecord:
    strict, loose = (RankedMatches.of(matches[name, fusion, criterion, label]) for criterion in CRITERIA)
    off_m, off_deg = np.mean(off, axis=0) if off else (np.nan, np.nan)
    return CooperativeRecord(
        poses=name,
        fusion=fusion,
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
