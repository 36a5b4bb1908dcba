"""Consistency over time: what is detected in a cloud follows from what was detected in the two before it.

The idea is that of 3D-TC2 (You et al., "Temporal Consistency Checks to Detect LiDAR Spoofing Attacks on
Autonomous Vehicle Perception", MAISP 2021): motion is an invariant of real objects, so that a prediction from
earlier clouds tells spoofed ones. The paper predicts with a learnt network (MotionNet), which is not here:
objects go on at the velocity, relative to the sensor, of their last two detections. Unlike the paper's, the
check counts objects that vanish, too, as an attack that hides objects makes them do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from advpipe.pipeline.detector.protocol import Detections

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

MAX_GAP_S = 0.25
"""Clouds farther apart are not consecutive: objects may have gone anywhere."""

MIN_RUN = 30
"""Consecutive clouds that a verdict takes."""

GATE_MPS = 15.0
"""An object that is this much faster or slower than predicted is another one."""

MAX_SPEED_MPS = 60.0
"""Of objects relative to the sensor."""


def temporal_scores(stamps_ns: npt.ArrayLike, detections: Sequence[Detections], min_score: float) -> Float64:
    """How inconsistent the detections in each cloud (F,) are with those of the two clouds before it, from 0
    to 1; NaN in the first two of a run of consecutive clouds, and in runs of fewer than `MIN_RUN`.

    stamps_ns: (F,), ascending. Detections of at least `min_score` are judged; fainter ones may explain them,
    as scores go up and down. Each weighs as much as its score: one that is near its predicted place counts
    the square of its distance over the gate; one that was not predicted, or was predicted and is not there,
    counts 1.
    """
    stamps_s = np.asarray(stamps_ns, np.int64) / 1e9
    scores = np.full(len(stamps_s), np.nan)
    for run in consecutive_runs(stamps_s):
        for now in run[2:].tolist():
            steps_s = np.diff(stamps_s[now - 2 : now + 1])
            scores[now] = _inconsistency(detections[now - 2 : now + 1], steps_s, min_score)
    return scores


def consecutive_runs(stamps_s: Float64) -> list[Int64]:
    """The indices of clouds (F,) in each run of at least `MIN_RUN` consecutive ones."""
    runs = np.split(np.arange(len(stamps_s)), np.flatnonzero(np.diff(stamps_s) > MAX_GAP_S) + 1)
    return [run for run in runs if len(run) >= MIN_RUN]


def _inconsistency(three: Sequence[Detections], steps_s: Float64, min_score: float) -> float:
    """Of the last of three clouds' detections; steps_s: (2,) between the clouds."""
    earlier, before, now = three
    same, first = _mutual_nearest(before, before.boxes[:, :3], earlier, MAX_SPEED_MPS * float(steps_s[0]))
    velocity_mps = (before.boxes[same, :3] - earlier.boxes[first, :3]) / steps_s[0]
    predicted = before.boxes[:, :3].copy()
    predicted[same] += velocity_mps * steps_s[1]
    gate_m = GATE_MPS * float(steps_s[1])
    source, found = _mutual_nearest(before, predicted, now, gate_m)
    off = np.linalg.norm(predicted[source] - now.boxes[found, :3], axis=1) / gate_m
    cost = np.ones(len(now))
    cost[found] = off**2
    is_judged = now.scores >= min_score
    # What was seen once may have been false, and is not missed.
    vanished = np.setdiff1d(same[before.scores[same] >= min_score], source)
    lost = before.scores[vanished].sum()
    weight = now.scores[is_judged].sum() + lost
    return float(((now.scores * cost)[is_judged].sum() + lost) / weight) if weight else 0.0


def _mutual_nearest(
    known: Detections, places_m: Float64, others: Detections, reach_m: float
) -> tuple[Int64, Int64]:
    """Pairs (P,) of detections, at these places (K, 3), and others (M,) of their class that are nearest to
    each other, within a reach."""
    if not (len(places_m) and len(others)):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    distance_m = cdist(places_m, others.boxes[:, :3])
    distance_m[known.labels[:, None] != others.labels] = np.inf
    nearest = distance_m.argmin(axis=1)
    here = np.arange(len(places_m))
    is_pair = (distance_m.argmin(axis=0)[nearest] == here) & (distance_m[here, nearest] <= reach_m)
    return np.flatnonzero(is_pair), nearest[is_pair]
