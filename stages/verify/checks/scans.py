"""Whether labels of radar scans state exactly what differs between both bags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, zip_longest
from typing import Any, NamedTuple

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
    """The scans of both bags in the order of the clean one, as the labels are: the scans of an instant may
    follow one another otherwise in the attacked one. Raises AdvpipeError for bags with other scans."""
    radars = {one.scan_topic: one for one in recorded_radars(attacked.clean)}
    numbers = dict.fromkeys(radars, 0)
    instants = zip_longest(_instants(attacked.clean, radars), _instants(attacked.adversarial, radars))
    for clean, adversarial in instants:
        if clean is None or adversarial is None or _held_by(clean) != _held_by(adversarial):
            time_ns = min(each.time_ns for each in (clean, adversarial) if each is not None)
            raise AdvpipeError(
                f"{attacked.bag.place} holds other radar scans than its parent at {time_ns} ns"
            )
        for key, scan in clean.scans.items():
            topic, attacked_scan = key[0], adversarial.scans[key]
            expected = radar_cloud_to_cdr(
                attacked_scan.returns,
                radars[topic].radar.rcs_dbsm(attacked_scan.returns),
                attacked_scan.stamp_ns,
                attacked_scan.frame_id,
            )
            points = adversarial.points.get(key, b"")
            same = b"" if points == expected else points
            yield _ScanPair(topic, numbers[topic], clean.time_ns, scan, attacked_scan, same)
            numbers[topic] += 1


class _Instant(NamedTuple):
    """The scans with one log time, and the bytes of their points, by topic and number within the instant."""

    time_ns: int
    scans: dict[tuple[str, int], StampedScan]
    points: dict[tuple[str, int], bytes]


def _held_by(instant: _Instant) -> tuple[int, set[tuple[str, int]]]:
    """What both bags have to agree on: the time, and which scans there are."""
    return instant.time_ns, set(instant.scans)


def _instants(reader: BagReader, radars: Mapping[str, RecordedRadar]) -> Iterator[_Instant]:
    """All instants with scans, by time."""
    points_of = {one.points_topic: topic for topic, one in radars.items()}
    wanted = sorted({*radars, *points_of} & reader.topics.keys())
    for time_ns, group in groupby(reader.raw_messages(wanted), key=lambda raw: raw.log_time_ns):
        instant, counts = _Instant(time_ns, {}, {}), Counter[str]()
        for raw in group:
            name = raw.topic.name
            if name in radars:
                instant.scans[name, counts[name]] = scan_from_cdr(raw.cdr)
            else:
                instant.points[points_of[name], counts[name]] = raw.cdr
            counts[name] += 1
        if instant.scans:
            yield instant


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
