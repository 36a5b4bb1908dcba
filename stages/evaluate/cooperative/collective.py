"""The report's part on collective perception: what a vehicle knows by CPMs, clean and attacked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.bag.latched import V2xInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.perceived_objects import OBJECT_REMOVED, read_object_labels
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.topics import V2X_SENT
from advpipe.pipeline.messages.v2x import sent_of_message
from advpipe.pipeline.results.collective_perception import CollectivePerceptionRecord
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.facilities.cpm_tree import decode_cpm
from advpipe.pipeline.v2x.facilities.heard_objects import heard_objects
from advpipe.stages.evaluate.cooperative.heard_checks import (
    FEWEST_WITNESSES,
    OMISSION_M,
    SAME_M,
    WITNESS_M,
    Bool,
    in_free_space,
    omitting,
    without_witnesses,
)
from advpipe.stages.evaluate.cooperative.heard_picture import draw_heard
from advpipe.stages.evaluate.cooperative.heard_scenes import (
    NEAR_M,
    HeardScene,
    has_heard_objects,
    heard_scenes,
)
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

KEY = "collective_perception"
CLEAN_BAG = "clean"
REMOVED_KEPT_NS = 2_000_000_000
"""A report is silent for so long after an attack took an object from it."""

FORMULAS = (
    Formula(
        "collective_perception",
        f"unseen: road users within {NEAR_M:g} m with fewer than {MIN_POINTS} points of the vehicle's own "
        "LiDARs. One is known where an entry of the Local Dynamic Map, moved on with its speed, is within "
        f"{SAME_M:g} m of its centre. A heard object is false where no road user is within that distance",
        ("unseen", "known_by_cams", "known_with_cpms", "heard", "heard_false"),
        title="Known road users",
    ),
    Formula(
        "cpm_checks",
        "free space: most returns of the own LiDAR through the core of the object lie behind it. Witnesses: "
        f"{FEWEST_WITNESSES} other stations or more are within {WITNESS_M:g} m, and none of them, no station "
        "of the map and no road user with points of the own LiDAR confirms the object. Omission: a report "
        f"lacks an object within {OMISSION_M:g} m of its sender that the own LiDAR sees and another station "
        "reports. True positive rates are of attacked, false positive rates of honest objects or reports",
        (
            *("attacked", "free_space_tpr", "free_space_fpr", "witnesses_tpr", "witnesses_fpr"),
            *("silent", "omission_tpr", "omission_fpr"),
        ),
        title="Checks of CPMs",
    ),
)


def collective_sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, window: Window = WHOLE_DRIVE
) -> tuple[ReportSection, ...]:
    """One section where a vehicle received CPMs; else none. `seed` is not used."""
    reader = BagReader(clean)
    vehicles = [each for each in receiving_vehicles(reader) if has_heard_objects(reader, each)]
    if not vehicles:
        return ()
    bags = {CLEAN_BAG: clean, **{bag_name(bag): bag for bag in adversarial}}
    evaluated = [
        collective_drive(name, bag, vehicle, window)
        for vehicle in vehicles
        for name, bag in bags.items()
        if has_heard_objects(BagReader(bag), vehicle)
    ]
    records = tuple(each.record for each in evaluated)
    return (
        ReportSection(
            key=KEY,
            title="Collective perception by CPMs",
            lead="What a vehicle knows of road users that its own LiDARs do not see, and which of the "
            "objects that it hears of are doubtful.",
            tables=(_known_table(records), _checks_table(records)),
            pictures=tuple(_picture(each) for each in evaluated if each.worst is not None),
            records=records,
            formulas=FORMULAS,
            terminal=(_known_table(records),),
        ),
    )


class CollectiveDrive(NamedTuple):
    """The values of one bag and vehicle. worst: the instant with most attacked objects among those that are
    heard, and which these are (H,); None where there are none."""

    record: CollectivePerceptionRecord
    worst: tuple[HeardScene, Bool] | None


def collective_drive(name: str, bag: Path, vehicle: str, window: Window = WHOLE_DRIVE) -> CollectiveDrive:
    """Evaluate one bag and vehicle."""
    reader, counts = BagReader(bag), Counter[str]()
    labels = _Attacked(reader, bag)
    worst: tuple[HeardScene, Bool] | None = None
    for scene in track(heard_scenes(reader, vehicle, window), "collective perception"):
        counts["instants"] += 1
        _count_known(scene, counts)
        attacked = labels.of(scene)
        if attacked.sum() > (0 if worst is None else worst[1].sum()):
            worst = scene, attacked
        for check, flagged in (("free", in_free_space(scene)), ("witness", without_witnesses(scene))):
            counts[f"{check} attacked"] += int(flagged[attacked].sum())
            counts[f"{check} honest"] += int(flagged[~attacked].sum())
        counts["attacked"] += int(attacked.sum())
        counts["honest"] += int((~attacked).sum())
        for station, is_flagged in omitting(scene).items():
            if station not in labels.touched:
                kind = "open"
            elif labels.is_silent(station, scene.time_ns):
                kind = "silent"
            else:
                continue
            counts[kind] += 1
            counts[f"omission {kind}"] += is_flagged
    return CollectiveDrive(_record(name, vehicle, counts), worst)


def _record(name: str, vehicle: str, counts: Counter[str]) -> CollectivePerceptionRecord:
    return CollectivePerceptionRecord(
        bag=name,
        vehicle=vehicle,
        instants=counts["instants"],
        unseen=counts["unseen"],
        known_by_cams=_share(counts, "known by CAMs", "unseen"),
        known_with_cpms=_share(counts, "known", "unseen"),
        heard=counts["heard"],
        heard_false=_share(counts, "false", "heard"),
        attacked=counts["attacked"],
        free_space_tpr=_share(counts, "free attacked", "attacked"),
        free_space_fpr=_share(counts, "free honest", "honest"),
        witnesses_tpr=_share(counts, "witness attacked", "attacked"),
        witnesses_fpr=_share(counts, "witness honest", "honest"),
        silent=counts["silent"],
        omission_tpr=_share(counts, "omission silent", "silent"),
        omission_fpr=_share(counts, "omission open", "open"),
    )


def _picture(drive: CollectiveDrive) -> ReportPicture:
    assert drive.worst is not None
    name, vehicle = drive.record.bag, drive.record.vehicle
    caption = f"{name}: what {vehicle} hears of in CPMs, when most of it is false"
    figure = draw_heard(*drive.worst)
    drawn = picture_of(SECTION, name, f"{name}-{vehicle}-cpm.png", caption, figure, is_wide=False)
    return replace(drawn, is_worst=True)


class _Attacked:
    """Which objects and reports an attack falsified, by what CPMs say of them."""

    def __init__(self, reader: BagReader, bag: Path) -> None:
        labels = read_object_labels(bag)
        self.touched: set[int] = set()
        self._objects: set[tuple[int, int, int]] = set()
        self._silent_ns: dict[int, list[int]] = {}
        touched: dict[int, set[int]] = {}
        for label in labels:
            touched.setdefault(label.number, set())
            if label.action != OBJECT_REMOVED:
                touched[label.number].add(label.object_id)
        if not labels:
            return
        origin = read_scenario_info(reader, V2xInfo).map.origin
        geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        removed = {label.number for label in labels if label.action == OBJECT_REMOVED}
        for _, message in reader.messages(V2X_SENT.name):
            sent = sent_of_message(message)
            if sent.number not in touched:
                continue
            try:
                cpm = decode_cpm(sent.payload)
            except MessageError:
                continue
            self.touched.add(cpm.station_id)
            if sent.number in removed:
                self._silent_ns.setdefault(cpm.station_id, []).append(sent.request_ns)
            for one in heard_objects(cpm, geodesy) or ():
                if one.object_id in touched[sent.number]:
                    self._objects.add((one.station_id, one.object_id, one.measured_ns))

    def of(self, scene: HeardScene) -> Bool:
        """(H,) which of the heard objects are as an attack made them."""
        keys = [(one.station_id, one.object_id, one.measured_ns) for one in scene.heard]
        return np.array([key in self._objects for key in keys], bool)

    def is_silent(self, station: int, time_ns: int) -> bool:
        """Whether an attack has just taken an object from a station's report."""
        sent_ns = self._silent_ns.get(station, ())
        return any(0 <= time_ns - each <= REMOVED_KEPT_NS for each in sent_ns)


def _count_known(scene: HeardScene, counts: Counter[str]) -> None:
    away_m = np.hypot(*(scene.users[:, :2] - scene.at_m).T)
    unseen_m = scene.users[(scene.points < MIN_POINTS) & (away_m <= NEAR_M), :2]
    by_cams = _has_near(unseen_m, scene.entries_m)
    by_cpms = _has_near(unseen_m, scene.heard_m)
    counts["unseen"] += len(unseen_m)
    counts["known by CAMs"] += int(by_cams.sum())
    counts["known"] += int((by_cams | by_cpms).sum())
    there_m = np.concatenate([scene.users[:, :2], scene.stations_m, scene.at_m[None]])
    counts["heard"] += len(scene.heard)
    counts["false"] += int((~_has_near(scene.heard_m, there_m)).sum())


def _has_near(places_m: Float64, others_m: Float64) -> Bool:
    """(P,) whether one of the others (O, 2) is within `SAME_M` of each place (P, 2)."""
    if not len(places_m) or not len(others_m):
        return np.zeros(len(places_m), bool)
    offsets_m = places_m[:, None, :] - others_m[None, :, :]
    near: Bool = np.hypot(offsets_m[..., 0], offsets_m[..., 1]).min(axis=1) <= SAME_M
    return near


def _share(counts: Counter[str], part: str, whole: str) -> float:
    return counts[part] / counts[whole] if counts[whole] else float("nan")


def _known_table(records: Sequence[CollectivePerceptionRecord]) -> Table:
    heads = ("bag", "vehicle", "unseen", "known by CAMs", "with CPMs", "heard", "false")
    lines = tuple(
        (
            each.bag,
            each.vehicle,
            f"{each.unseen:,}",
            formatted_number(each.known_by_cams, 3),
            formatted_number(each.known_with_cpms, 3),
            f"{each.heard:,}",
            formatted_number(each.heard_false, 3),
        )
        for each in records
    )
    return Table("Collective perception: road users that the own LiDARs do not see", heads, lines)


def _checks_table(records: Sequence[CollectivePerceptionRecord]) -> Table:
    heads = ("bag", "vehicle", "attacked", "free space", "FPR", "witnesses", "FPR", "omission", "FPR")
    values = (
        *("free_space_tpr", "free_space_fpr", "witnesses_tpr"),
        *("witnesses_fpr", "omission_tpr", "omission_fpr"),
    )
    lines = tuple(
        (
            each.bag,
            each.vehicle,
            f"{each.attacked + each.silent:,}",
            *(formatted_number(getattr(each, value), 3) for value in values),
        )
        for each in records
    )
    return Table("Checks of CPMs: true and false positive rates", heads, lines)
