"""What each scan of a radar shows of the true road users, and what it shows besides."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_radars import RecordedRadar
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.scans import ADDED, CHANGED, REMOVED, read_scan_labels
from advpipe.pipeline.messages.radar import RETURN_DTYPE, RadarReturns, StampedScan, scan_from_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.radar.association import MOVING_MPS, in_view, over_ground_mps, returns_of_boxes

CONDITIONS = ("clean", "adv", "random")
"""Random: as many returns of the scan removed and added as the attack did, at random."""

RANGES = {"0-50": (0.0, 50.0), "50-100": (50.0, 100.0), "100+": (100.0, np.inf)}


def _empty_counts() -> dict[str, Counter[tuple[str, str]]]:
    return {condition: Counter() for condition in CONDITIONS}


@dataclass
class ScanTotals:
    """Sums over the attacked scans of a radar, by condition.

    touched: by action. objects, found, lost: by class and range. times_ns, found_series, ghost_series: of
    each scan in the window, attacked or not: road users in view that are detected, and ghosts, clean and
    attacked.
    """

    attacks: set[str] = field(default_factory=set)
    scans: int = 0
    attacked: int = 0
    touched: Counter[str] = field(default_factory=Counter)
    returns: Counter[str] = field(default_factory=Counter)
    ghosts: Counter[str] = field(default_factory=Counter)
    objects: Counter[tuple[str, str]] = field(default_factory=Counter)
    found: dict[str, Counter[tuple[str, str]]] = field(default_factory=_empty_counts)
    lost: dict[str, Counter[tuple[str, str]]] = field(default_factory=_empty_counts)
    times_ns: list[int] = field(default_factory=list)
    attacked_ns: list[int] = field(default_factory=list)
    found_series: list[tuple[int, int]] = field(default_factory=list)
    ghost_series: list[tuple[int, int]] = field(default_factory=list)


@dataclass(frozen=True)
class _ScanLabels:
    attacks: frozenset[str]
    counts: Counter[str]


def labelled_scans(bag: Path) -> dict[tuple[str, int], _ScanLabels]:
    """What the labels of a bag say of each touched scan, by topic and stamp."""
    found: dict[tuple[str, int], _ScanLabels] = {}
    labels = groupby(read_scan_labels(bag), key=lambda row: (row["topic"], row["stamp_ns"]))
    for key, group in labels:
        actions: Counter[str] = Counter()
        attacks: set[str] = set()
        for row in group:
            actions[row["action"]] += 1
            attacks.add(row["attack"])
        found[key] = _ScanLabels(frozenset(attacks), actions)
    return found


def score_scans(
    clean: BagReader, bag: Path, recorded: RecordedRadar, window: Window, seed: int
) -> ScanTotals:
    """The totals of one radar over the scans of a window. Raises AdvpipeError for bags whose scans differ in
    their times, and for a clean bag without ground truth."""
    labels, totals = labelled_scans(bag), ScanTotals()
    for clean_scan, attacked_scan, boxes, velocity_mps in _scan_pairs(
        clean, BagReader(bag), recorded, window
    ):
        stamp_ns = clean_scan.stamp_ns
        touched = labels.get((recorded.scan_topic, stamp_ns))
        totals.scans += 1
        lists = {"clean": clean_scan.returns, "adv": attacked_scan.returns}
        if touched is not None:
            rng = named_generator(seed, "radar baseline", recorded.scan_topic, totals.scans)
            lists["random"] = random_change(recorded, clean_scan.returns, touched.counts, rng)
        _add(totals, recorded, lists, boxes, velocity_mps)
        totals.times_ns.append(stamp_ns)
        if touched is not None:
            totals.attacked += 1
            totals.attacked_ns.append(stamp_ns)
            totals.attacks |= touched.attacks
            totals.touched.update(touched.counts)
    return totals


def random_change(
    recorded: RecordedRadar, returns: RadarReturns, counts: Counter[str], rng: np.random.Generator
) -> RadarReturns:
    """A scan (N,) with as many returns removed, and added anywhere, as an attack did.

    A changed return counts as removed and added. Added ones have the power of false alarms.
    """
    section = recorded.radar.section
    removed = min(counts[REMOVED] + counts[CHANGED], len(returns))
    kept = np.sort(rng.permutation(len(returns))[removed:])
    count = counts[ADDED] + counts[CHANGED]
    half = np.deg2rad([section.horizontal_fov, section.vertical_fov]) / 2
    added = np.zeros(count, RETURN_DTYPE)
    added["range"] = rng.uniform(0, section.range, count)
    added["azimuth"] = rng.uniform(-half[0], half[0], count)
    if section.elevation_resolution_deg:
        added["elevation"] = rng.uniform(-half[1], half[1], count)
    added["velocity"] = rng.uniform(-section.max_velocity_mps, section.max_velocity_mps, count)
    return np.concatenate([returns[kept], added])


def _add(
    totals: ScanTotals,
    recorded: RecordedRadar,
    lists: dict[str, RadarReturns],
    boxes: Boxes,
    velocity_mps: Float64,
) -> None:
    section, is_attacked = recorded.radar.section, "random" in lists
    seen = in_view(section, boxes)
    away_m = np.linalg.norm(boxes.geometry[:, :2], axis=1)
    keys = [
        (CLASSES[label], next(name for name, (low, high) in RANGES.items() if low <= m < high))
        for label, m in zip(boxes.labels.tolist(), away_m.tolist(), strict=True)
    ]
    if is_attacked:
        totals.objects.update(key for key, visible in zip(keys, seen.tolist(), strict=True) if visible)
    found: dict[str, npt.NDArray[np.bool_]] = {}
    ghosts: dict[str, int] = {}
    for condition, returns in lists.items():
        near = returns_of_boxes(section, returns, boxes)
        found[condition] = np.array([len(one) > 0 for one in near], bool).reshape(-1) & seen
        ghost = np.abs(over_ground_mps(section, returns, velocity_mps)) > MOVING_MPS
        ghost[np.concatenate([*near, np.zeros(0, np.int64)])] = False
        ghosts[condition] = int(ghost.sum())
        if is_attacked:
            totals.returns[condition] += len(returns)
            totals.ghosts[condition] += ghosts[condition]
            totals.found[condition].update(keys[index] for index in np.flatnonzero(found[condition]))
            lost = np.flatnonzero(found["clean"] & ~found[condition])
            totals.lost[condition].update(keys[index] for index in lost)
    totals.found_series.append((int(found["clean"].sum()), int(found["adv"].sum())))
    totals.ghost_series.append((ghosts["clean"], ghosts["adv"]))


def _scan_pairs(
    clean: BagReader, attacked: BagReader, recorded: RecordedRadar, window: Window
) -> Iterator[tuple[StampedScan, StampedScan, Boxes, Float64]]:
    """Each scan of both bags, with the true road users and the radar's velocity, both in its axes."""
    topics = VehicleTopics(recorded.vehicle)
    if topics.objects.name not in clean.topics or topics.true_odometry.name not in clean.topics:
        raise UsageError(
            f"{clean.path} has no true road users of {recorded.vehicle}, by which radars are scored; record "
            "the drive with a LiDAR on it"
        )
    truth = GroundTruth(clean, topics, topics.objects.name)
    others = attacked.raw_messages([recorded.scan_topic], last_ns=window.last_ns)
    wanted = sorted({recorded.scan_topic, *truth.topic_names} & clean.topics.keys())
    raws = clean.raw_messages(wanted, last_ns=window.last_ns)
    base_SE3_radar = recorded.radar.base_SE3_radar
    for time_ns, group in groupby(raws, key=lambda raw: raw.log_time_ns):
        scan, velocity_mps = None, np.zeros(3)
        for raw in group:
            if raw.topic.name == recorded.scan_topic:
                scan = raw
                continue
            truth.take(raw)
            if raw.topic.name == topics.true_odometry.name:
                velocity_mps = _sensor_velocity_mps(clean.decode(raw).twist.twist, base_SE3_radar)
        if scan is None:
            continue
        other = next(others, None)
        if other is None or other.log_time_ns != time_ns:
            raise AdvpipeError(
                f"{attacked.path} holds scans of {recorded.scan_topic} at other times than {clean.path}"
            )
        before, after = scan_from_cdr(scan.cdr), scan_from_cdr(other.cdr)
        if window.holds([time_ns])[0] and before.stamp_ns in truth.stamps_ns:
            yield before, after, truth.boxes(before.stamp_ns, before.frame_id), velocity_mps


def _sensor_velocity_mps(twist: object, base_SE3_radar: Float64) -> Float64:
    linear, angular = (
        np.array([part.x, part.y, part.z])
        for part in (twist.linear, twist.angular)  # type: ignore[attr-defined]
    )
    velocity: Float64 = base_SE3_radar[:3, :3].T @ (linear + np.cross(angular, base_SE3_radar[:3, 3]))
    return velocity
