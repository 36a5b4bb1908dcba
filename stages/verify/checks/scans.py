"""Whether labels of radar scans state exactly what differs between both bags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_radars import RecordedRadar, recorded_radars
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.quantity import Range, beyond_all
from advpipe.pipeline.labels.scan_quantities import SCAN_QUANTITIES, ScanChange
from advpipe.pipeline.labels.scans import ADDED, CHANGED, FILE, MEASURED, REMOVED
from advpipe.pipeline.messages.radar import RETURN_DTYPE, StampedScan, radar_cloud_to_cdr, scan_from_cdr
from advpipe.pipeline.scenario.acting import Acting
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.declared_bounds import undeclared
from advpipe.stages.verify.result import Fault, Result

LabelRow = Mapping[str, Any]


@dataclass(frozen=True)
class _ScanPair:
    """A scan in both bags, its points in the attacked one, and their log time."""

    topic: str
    number: int
    time_ns: int
    clean: StampedScan
    attacked: StampedScan
    points: bytes


class Scans(BagCheck):
    """Compares each scan in both bags: returns without a label keep their bytes and their order. The points
    that repeat a scan follow from it."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        path = attacked.table(FILE)
        if not path.is_file():
            return
        where = self.bag.subject.place(path)
        attacks = attacked.of_family("radar")
        yield from undeclared(self.bag.place, attacks, SCAN_QUANTITIES)
        acts = attacked.acts(attacks, SCAN_QUANTITIES)
        labels = groupby(rows(path), key=lambda row: (row["topic"], row["scan"]))
        waiting = next(labels, None)
        for pair in _pairs(attacked):
            own: list[LabelRow] = []
            if waiting is not None and waiting[0] == (pair.topic, pair.number):
                own = list(waiting[1])
                waiting = next(labels, None)
            what = next(_faults(pair, own, acts), None)
            if what is not None:
                yield Fault(where, f"scan {pair.number} of {pair.topic} {what}")
        if waiting is not None:
            yield Fault(where, f"labels scan {waiting[0][1]} of {waiting[0][0]}, which the bags do not hold")


def _pairs(attacked: AttackedBag) -> Iterator[_ScanPair]:
    """The scans of both bags, by time, as the labels are. Raises AdvpipeError for bags with other scans."""
    radars = {one.scan_topic: one for one in recorded_radars(attacked.clean)}
    numbers = dict.fromkeys(radars, 0)
    pairs = zip(_scans(attacked.clean, radars), _scans(attacked.adversarial, radars), strict=False)
    for (topic, time_ns, clean, _), (other, other_ns, adversarial, points) in pairs:
        if (topic, time_ns) != (other, other_ns):
            raise AdvpipeError(
                f"{attacked.bag.place} holds other radar scans than its parent at {time_ns} ns"
            )
        expected = radar_cloud_to_cdr(
            adversarial.returns,
            radars[topic].radar.rcs_dbsm(adversarial.returns),
            adversarial.stamp_ns,
            adversarial.frame_id,
        )
        same = b"" if points == expected else points
        yield _ScanPair(topic, numbers[topic], time_ns, clean, adversarial, same)
        numbers[topic] += 1


def _scans(
    reader: BagReader, radars: Mapping[str, RecordedRadar]
) -> Iterator[tuple[str, int, StampedScan, bytes]]:
    """Each scan with its topic, log time, and the bytes of its points."""
    points_of = {one.points_topic: topic for topic, one in radars.items()}
    wanted = sorted({*radars, *points_of} & reader.topics.keys())
    for time_ns, group in groupby(reader.raw_messages(wanted), key=lambda raw: raw.log_time_ns):
        messages = list(group)
        points = {points_of[raw.topic.name]: raw.cdr for raw in messages if raw.topic.name in points_of}
        for raw in messages:
            if raw.topic.name in radars:
                yield raw.topic.name, time_ns, scan_from_cdr(raw.cdr), points.get(raw.topic.name, b"")


def _faults(
    pair: _ScanPair, labels: Sequence[LabelRow], acts: Mapping[str, tuple[Acting, Mapping[str, Range]]]
) -> Iterator[str]:
    clean, attacked = pair.clean, pair.attacked
    if (clean.stamp_ns, clean.frame_id) != (attacked.stamp_ns, attacked.frame_id):
        yield "has another header than in the clean bag"
    if pair.points:
        yield "is not what its points show"
    by_action: dict[str, list[LabelRow]] = {action: [] for action in (ADDED, CHANGED, REMOVED)}
    for label in labels:
        if label["action"] not in by_action:
            yield f"has a label with the unknown action {label['action']}"
            return
        if label["attack"] not in acts or not acts[label["attack"]][0](pair.time_ns):
            yield f"has a label of {label['attack']}, which was not active"
        if label["stamp_ns"] != clean.stamp_ns:
            yield "has a label with another stamp"
        by_action[label["action"]].append(label)
    removed = {label["clean"] for label in by_action[REMOVED]}
    added = {label["attacked"] for label in by_action[ADDED]}
    changed = {label["attacked"]: label["clean"] for label in by_action[CHANGED]}
    kept = [index for index in range(len(clean.returns)) if index not in removed]
    places = [index for index in range(len(attacked.returns)) if index not in added]
    if len(kept) != len(places):
        yield "has more or fewer returns than its labels say"
        return
    moved = set(changed.values())
    if len(moved) < len(by_action[CHANGED]) or not moved.issubset(kept) or not changed.keys() <= set(places):
        yield "has labels that confuse its returns"
        return
    same = zip((i for i in kept if i not in moved), (i for i in places if i not in changed), strict=True)
    for index, place in same:
        if clean.returns[index] != attacked.returns[place]:
            yield f"has a return {place} that was changed without a label"
    for label in labels:
        returns, key = (clean, "clean") if label["action"] == REMOVED else (attacked, "attacked")
        if not _is_stated(label, returns, label[key]):
            yield f"has a label that misstates its return {label[key]}"
    counts = ScanChange(len(by_action[ADDED]), len(by_action[REMOVED]), len(by_action[CHANGED]))
    names = {label["attack"] for label in labels if label["attack"] in acts}
    if len(names) == 1 and (what := beyond_all(counts, [acts[name][1] for name in names], SCAN_QUANTITIES)):
        yield f"exceeds the bounds of {names.pop()}: {what}"


def _is_stated(label: LabelRow, scan: StampedScan, index: int | None) -> bool:
    """Whether a label's measurements are those of the return with this index."""
    if index is None or not 0 <= index < len(scan.returns):
        return False
    one = scan.returns[index]
    names = RETURN_DTYPE.names or ()
    return all(np.float32(label[column]) == one[name] for column, name in zip(MEASURED, names, strict=True))
