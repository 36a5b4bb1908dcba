"""The report's part on radars."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_radars import RecordedRadar, recorded_radars
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.labels.scans import ADDED, CHANGED, REMOVED
from advpipe.pipeline.results.radar import RadarDetectionRecord, RadarRecord
from advpipe.pipeline.sensors.radar.association import MOVING_MPS
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.radar.picture import draw_radar
from advpipe.stages.evaluate.radar.scan_scores import (
    CONDITIONS,
    RANGES,
    ScanTotals,
    labelled_scans,
    score_scans,
)
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

ALL = "all"

FORMULAS = (
    Formula(
        "radar_detected",
        "a road user is in view if its centre is in the radar's range and field of view, hidden or not; "
        "detected in a scan with at least one return within 0.5 m of its box, and two standard deviations of "
        "the azimuth of a weak return",
        ("objects", "detected_clean", "detected", "detected_random", "lost", "lost_percent"),
        title="Road users that a radar detects",
    ),
    Formula(
        "radar_ghosts",
        f"returns of a scan whose radial velocity over the ground is above {MOVING_MPS:g} m/s, and "
        "that are at no road user's box: mirror images, false alarms, and what an attack added",
        ("ghosts_clean", "ghosts", "ghosts_random"),
        title="Ghosts",
    ),
    Formula(
        "radar_random",
        "the random baseline removes and adds as many returns of each attacked scan as the attack, chosen at "
        "random; a changed return counts as removed and added",
        ("ghosts_random", "detected_random", "lost_random_percent"),
        title="Random baseline of radars",
    ),
)


def radar_sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, window: Window = WHOLE_DRIVE
) -> tuple[ReportSection, ...]:
    """Two sections on all radars whose scans attacks touched, ghosts and detection; none without any.

    window: the part of the drive that is evaluated. seed: of the random baseline. Raises AdvpipeError for
    bags whose scans do not belong together.
    """
    reader = BagReader(clean)
    start_ns = min((int(t[0]) for t in map(reader.log_times_ns, reader.topics) if len(t)), default=0)
    attacked = list(_attacked(reader, adversarial))
    found: list[tuple[str, RecordedRadar, ScanTotals]] = []
    for bag, recorded in track(attacked, "radars", len(attacked)) if attacked else ():
        totals = score_scans(reader, bag, recorded, window, seed)
        if totals.attacked:
            found.append((bag_name(bag), recorded, totals))
    if not found:
        return ()
    scans = tuple(_record(*each) for each in found)
    detections = tuple(row for each in found for row in _detections(*each))
    overview = _scan_table(scans)
    return (
        ReportSection(
            key="radar",
            title="Radars under attack",
            lead="All figures are means over the attacked scans.",
            tables=(overview,),
            pictures=tuple(_picture(*each, start_ns) for each in found),
            records=scans,
            formulas=FORMULAS,
            terminal=(_terminal(scans, detections),),
        ),
        ReportSection(
            key="radar_detection",
            title="Road users that radars detect",
            tables=(_detection_table(detections),),
            records=detections,
        ),
    )


def _attacked(reader: BagReader, adversarial: Sequence[Path]) -> Iterator[tuple[Path, RecordedRadar]]:
    """Each adversarial bag with each radar whose scans it changes."""
    for bag in adversarial:
        topics = {topic for topic, _ in labelled_scans(bag)}
        if topics:
            yield from ((bag, one) for one in recorded_radars(reader) if one.scan_topic in topics)


def _record(bag: str, recorded: RecordedRadar, totals: ScanTotals) -> RadarRecord:
    count = totals.attacked
    return RadarRecord(
        bag=bag,
        vehicle=recorded.vehicle,
        radar=recorded.name,
        attacks=tuple(sorted(totals.attacks)),
        scans=totals.scans,
        attacked_scans=count,
        added=totals.touched[ADDED] / count,
        changed=totals.touched[CHANGED] / count,
        removed=totals.touched[REMOVED] / count,
        returns_clean=totals.returns["clean"] / count,
        returns=totals.returns["adv"] / count,
        ghosts_clean=totals.ghosts["clean"] / count,
        ghosts=totals.ghosts["adv"] / count,
        ghosts_random=totals.ghosts["random"] / count,
    )


def _detections(bag: str, recorded: RecordedRadar, totals: ScanTotals) -> Iterator[RadarDetectionRecord]:
    """All road users, then each class, then each class and range, as far as there are any."""
    for class_name in (ALL, *CLASSES):
        for distance in (ALL, *RANGES):
            chosen = [
                key for key in totals.objects if class_name in (ALL, key[0]) and distance in (ALL, key[1])
            ]
            if not chosen:
                continue
            found = {c: sum(totals.found[c][key] for key in chosen) for c in CONDITIONS}
            lost = {c: sum(totals.lost[c][key] for key in chosen) for c in CONDITIONS}
            yield RadarDetectionRecord(
                bag=bag,
                vehicle=recorded.vehicle,
                radar=recorded.name,
                class_name=class_name,
                range=distance,
                objects=sum(totals.objects[key] for key in chosen),
                detected_clean=found["clean"],
                detected=found["adv"],
                detected_random=found["random"],
                lost=lost["adv"],
                lost_percent=_percent(lost["adv"], found["clean"]),
                lost_random_percent=_percent(lost["random"], found["clean"]),
            )


def _percent(part: int, whole: int) -> float:
    return 100 * part / whole if whole else float("nan")


def _picture(bag: str, recorded: RecordedRadar, totals: ScanTotals, start_ns: int) -> ReportPicture:
    caption = f"{bag}: what {recorded.name} of {recorded.vehicle} detects, and ghosts, in each scan"
    file_name = f"{bag}-{recorded.vehicle}-{recorded.name}-radar.png"
    return picture_of(SECTION, bag, file_name, caption, draw_radar(totals, start_ns))


def _scan_table(rows: Sequence[RadarRecord]) -> Table:
    heads = (
        *("bag", "radar", "attack", "scans attacked", "added", "changed", "removed"),
        *("returns, clean → attacked", "ghosts, clean → attacked", "ghosts, random"),
    )
    lines = tuple(
        (
            *(row.bag, f"{row.vehicle}: {row.radar}", " + ".join(row.attacks)),
            f"{row.attacked_scans} of {row.scans}",
            *(formatted_number(value, 1) for value in (row.added, row.changed, row.removed)),
            f"{formatted_number(row.returns_clean, 1)} → {formatted_number(row.returns, 1)}",
            f"{formatted_number(row.ghosts_clean, 1)} → {formatted_number(row.ghosts, 1)}",
            formatted_number(row.ghosts_random, 1),
        )
        for row in rows
    )
    return Table("Returns of a scan", heads, lines, "Ghosts: moving returns that are at no road user.")


def _detection_table(rows: Sequence[RadarDetectionRecord]) -> Table:
    heads = (
        *("bag", "radar", "class", "range m", "in view", "detected, clean", "attacked", "random"),
        *("lost %", "lost %, random"),
    )
    lines = tuple(
        (
            *(row.bag, f"{row.vehicle}: {row.radar}", row.class_name, row.range, f"{row.objects:,}"),
            *(f"{count:,}" for count in (row.detected_clean, row.detected, row.detected_random)),
            *(formatted_number(value, 1) for value in (row.lost_percent, row.lost_random_percent)),
        )
        for row in rows
    )
    return Table("Road users in view and detected, in all attacked scans", heads, lines)


def _terminal(rows: Sequence[RadarRecord], detections: Sequence[RadarDetectionRecord]) -> Table:
    """The main columns of both tables, for a terminal."""
    of_all = {
        (row.bag, row.vehicle, row.radar): row
        for row in detections
        if row.class_name == ALL and row.range == ALL
    }
    lines = []
    for row in rows:
        users = of_all.get((row.bag, row.vehicle, row.radar))
        detected = "–" if users is None else f"{users.detected_clean:,} → {users.detected:,}"
        lost = None if users is None else users.lost_percent
        lines.append(
            (
                f"{row.bag}: {row.vehicle}: {row.radar}",
                detected,
                formatted_number(lost, 1),
                f"{formatted_number(row.ghosts_clean, 1)} → {formatted_number(row.ghosts, 1)}",
            )
        )
    heads = ("radar", "road users detected", "lost %", "ghosts a scan")
    return Table("Radars: clean → attacked, in the attacked scans", heads, tuple(lines))
