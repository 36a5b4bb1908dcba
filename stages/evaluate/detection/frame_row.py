"""One frame in counts: objects lost and displaced, and false positives, in each of its clouds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.results.frame_row import CloudCounts, FrameRow
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.scoring import false_positives, found_objects, new_boxes

Bool = npt.NDArray[np.bool_]


def lost_objects(clean: CloudResult, cloud: CloudResult, min_score: float, criterion: str = "loose") -> Bool:
    """Which objects (M,) the detector finds on the clean cloud and misses on the other one."""
    found, still = (found_objects(each.matches, min_score, criterion) for each in (clean, cloud))
    return found & ~still


def displaced_objects(clean: CloudResult, cloud: CloudResult, min_score: float) -> Bool:
    """Which objects (M,) are found strictly on the clean cloud, and on the other at loose overlap only."""
    loosely = found_objects(cloud.matches, min_score)
    return lost_objects(clean, cloud, min_score, "strict") & loosely


def new_false_positives(clean: CloudResult, cloud: CloudResult, min_score: float) -> Bool:
    """Which detections (K,) on a cloud find nothing and overlap no detection on the clean one."""
    wrong = false_positives(cloud.matches, min_score)
    new = new_boxes(cloud.detections, clean.detections, min_score)
    return wrong & new


def frame_row(frame: FrameResult, min_score: float) -> FrameRow:
    """The counts of each cloud of a frame, of detections with at least the score `min_score`."""
    return FrameRow(
        frame=frame.index,
        stamp_ns=frame.stamp_ns,
        objects=int(frame.truth.is_evaluated.sum()),
        ignored_objects=len(frame.truth.uncounted.boxes),
        ignored_regions=len(frame.truth.uncounted.coverage.ignored),
        clouds={condition: _counts(frame, cloud, min_score) for condition, cloud in frame.clouds().items()},
    )


def _counts(frame: FrameResult, cloud: CloudResult, min_score: float) -> CloudCounts:
    lost, way = lost_objects(frame.clean, cloud, min_score), cloud.displacement
    return CloudCounts(
        points=cloud.points,
        points_removed=cloud.points_removed,
        points_added=cloud.points_added,
        points_moved=cloud.points_moved,
        mean_displacement_m=way.mean_m,
        rms_displacement_m=way.rms_m,
        median_displacement_m=way.median_m,
        p95_displacement_m=way.p95_m,
        max_displacement_m=way.max_m,
        max_added_m=way.max_added_m,
        chamfer_distance_m2=cloud.chamfer_distance_m2,
        objects_below_min_points=int(cloud.emptied.sum()),
        found_objects=int(found_objects(cloud.matches, min_score).sum()),
        false_positives=int(false_positives(cloud.matches, min_score).sum()),
        lost_objects=int(lost.sum()),
        new_false_positives=int(new_false_positives(frame.clean, cloud, min_score).sum()),
        lost_objects_recounted=int((lost & ~cloud.emptied).sum()),
        displaced_objects=int(displaced_objects(frame.clean, cloud, min_score).sum()),
    )
