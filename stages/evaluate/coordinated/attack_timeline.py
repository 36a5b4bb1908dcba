"""Which fixes, messages, clouds, radar scans and images of a bag were attacked when, by vehicle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.provenance_record import RecordedAttack
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.bounded_parquet import ColumnType, batches, rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.clouds import FRAMES, POINTS
from advpipe.pipeline.labels.images import read_image_labels
from advpipe.pipeline.labels.messages import read_labels
from advpipe.pipeline.labels.scans import read_scan_labels
from advpipe.pipeline.replay.recorded_filter import vehicles_with_filter
from advpipe.stages.evaluate.localisation.track import attacked_fixes_ns
from advpipe.stages.evaluate.v2x.recording import read_recording

COLUMNS: dict[str, ColumnType] = {"topic": "text", "stamp_ns": "whole"}

Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class AttackTimeline:
    """The attacks of one family on one vehicle.

    attacks: their names. what: "fixes", "messages", "clouds", "scans" or "images". times_ns: (N,) of
    each one, ascending, N > 0.
    """

    vehicle: str
    attacks: tuple[str, ...]
    what: str
    times_ns: Int64


def read_attack_timelines(
    clean: BagReader, bag: Path, window: Window = WHOLE_DRIVE
) -> dict[str, tuple[AttackTimeline, ...]]:
    """The attacks on each vehicle in a window; a message attack without a target attacks all but the senders.

    bag: the adversarial bag's folder, or the file in it. Raises AdvpipeError for labels that cannot be read.
    """
    reader = BagReader(bag)
    recorded = reader.provenance.fields.attacks
    found: dict[str, list[AttackTimeline]] = {}
    fixes, sent = (
        _fixes(clean, reader, recorded, window.last_ns),
        _messages(reader, bag, recorded, window.end_ns),
    )
    for one in (*fixes, *sent, *_clouds(bag), *_radar_scans(bag), *_images(bag)):
        times_ns = one.times_ns[window.holds(one.times_ns)]
        if len(times_ns):
            found.setdefault(one.vehicle, []).append(replace(one, times_ns=times_ns))
    return {vehicle: tuple(timelines) for vehicle, timelines in sorted(found.items())}


def touched_points(bag: Path, vehicle: str) -> dict[int, int]:
    """How many points of each of a vehicle's clouds in the bag were changed, by stamp; 0 where none was."""
    import pyarrow

    if not _beside(bag, FRAMES).exists():
        return {}
    counts = {row["stamp_ns"]: 0 for row in _cloud_rows(bag) if _vehicle(row["topic"]) == vehicle}
    with _labels(bag, POINTS) as path:
        for batch in batches(path, COLUMNS):
            by_cloud = pyarrow.Table.from_batches([batch]).group_by(list(COLUMNS))
            for row in by_cloud.aggregate([([], "count_all")]).to_pylist():
                if _vehicle(row["topic"]) == vehicle:
                    counts[row["stamp_ns"]] = counts.get(row["stamp_ns"], 0) + row["count_all"]
    return counts


def _fixes(
    clean: BagReader, reader: BagReader, recorded: Sequence[RecordedAttack], last_ns: int | None
) -> Iterator[AttackTimeline]:
    spoofs = [one for one in recorded if one.family == "gnss"]
    for vehicle in sorted({*vehicles_with_filter(clean)} & {*vehicles_with_filter(reader)}) if spoofs else ():
        times_ns = attacked_fixes_ns(clean, reader, vehicle, last_ns)
        if len(times_ns):
            names = dict.fromkeys(one.type for one in spoofs if one.victim in (None, vehicle))
            yield AttackTimeline(vehicle, tuple(names), "fixes", times_ns)


def _messages(
    reader: BagReader, bag: Path, recorded: Sequence[RecordedAttack], until_ns: int | None
) -> Iterator[AttackTimeline]:
    sent = [one for one in recorded if one.family == "v2x"]
    names = {one.type for one in sent}
    labels = [label for label in read_labels(bag) if label.attack in names] if sent else []
    for vehicle in read_recording(reader, until_ns).listeners if labels else ():
        names = {one.type for one in sent if one.victim in (None, vehicle)}
        own = [label for label in labels if label.attack in names and label.attacker != vehicle]
        if own:
            met = tuple(sorted({label.attack for label in own}))
            yield AttackTimeline(vehicle, met, "messages", np.array(sorted(label.time_ns for label in own)))


def _clouds(bag: Path) -> Iterator[AttackTimeline]:
    if not _beside(bag, FRAMES).exists():
        return
    attacked = [row for row in _cloud_rows(bag) if row["attack"]]
    for vehicle in sorted({_vehicle(row["topic"]) for row in attacked}):
        own = [row for row in attacked if _vehicle(row["topic"]) == vehicle]
        names = dict.fromkeys(row["attack"] for row in own)
        yield AttackTimeline(
            vehicle, tuple(names), "clouds", np.array(sorted(row["stamp_ns"] for row in own))
        )


def touched_returns(bag: Path, vehicle: str) -> dict[int, int]:
    """How many radar returns of a vehicle were added, changed or removed at each stamp with any."""
    rows_of_bag = (row for row in read_scan_labels(bag) if _vehicle(row["topic"]) == vehicle)
    return dict(Counter(row["stamp_ns"] for row in rows_of_bag))


def _radar_scans(bag: Path) -> Iterator[AttackTimeline]:
    return _touched("scans", read_scan_labels(bag))


def _images(bag: Path) -> Iterator[AttackTimeline]:
    return _touched("images", read_image_labels(bag))


def _touched(what: str, labels: Iterable[dict[str, Any]]) -> Iterator[AttackTimeline]:
    """By vehicle, from the topic, stamp and attack of each label."""
    touched: dict[str, dict[tuple[str, int], None]] = {}
    names: dict[str, dict[str, None]] = {}
    for row in labels:
        vehicle = _vehicle(row["topic"])
        touched.setdefault(vehicle, {})[row["topic"], row["stamp_ns"]] = None
        names.setdefault(vehicle, {})[row["attack"]] = None
    for vehicle, messages in sorted(touched.items()):
        times_ns = np.array(sorted(stamp_ns for _, stamp_ns in messages), np.int64)
        yield AttackTimeline(vehicle, tuple(names[vehicle]), what, times_ns)


def _cloud_rows(bag: Path) -> list[dict[str, Any]]:
    with _labels(bag, FRAMES) as path:
        return list(rows(path, {**COLUMNS, "attack": "text"}))


@contextmanager
def _labels(bag: Path, name: str) -> Iterator[Path]:
    path = _beside(bag, name)
    try:
        yield path
    except AdvpipeError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise AdvpipeError(f"{path} holds no cloud labels: {reason}; attack again") from None


def _vehicle(topic: str) -> str:
    return topic.strip("/").partition("/")[0]


def _beside(bag: Path, name: str) -> Path:
    return (bag if bag.is_dir() else bag.parent) / name
