"""The report's part on V2X: lies found out, what the victim's map and warning make of them, the radio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.bag.v2x_drive import V2xDrive
from advpipe.pipeline.bag.v2x_statistics import read_statistics
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.report.numbers import number
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.section import SECTION, Picture, Section, Table
from advpipe.stages.evaluate.v2x.collision import Warnings, known_of_radio, warnings
from advpipe.stages.evaluate.v2x.detection import PUBLISHED_CATCH_F1, Detection, detect
from advpipe.stages.evaluate.v2x.labels import MessageLabel, read_labels
from advpipe.stages.evaluate.v2x.ldm_error import Known, LdmError, Moment, ldm_error, moments
from advpipe.stages.evaluate.v2x.picture import draw_detection, draw_errors, draw_maps
from advpipe.stages.evaluate.v2x.radio import RadioRow, radio_row
from advpipe.stages.evaluate.v2x.receptions import read_receptions

FORMULAS = (
    (
        "lie",
        "a received message that an attack changed, added or delayed so that it mattered; others are honest",
    ),
    ("F1, MCC", "2 TP / (2 TP + FP + FN); Matthews' correlation; a message is one reception of one listener"),
    (
        "latency",
        "from the first lie of a liar that a listener hears to its first lie that is flagged, the mean",
    ),
    (
        "ghost, missing, displaced",
        "entries of stations that are not there; stations within 150 m without an entry; entries, carried "
        "on with their speed, more than 3 m from their station",
    ),
    (
        "warning",
        "time to collision below 2.5 s with what is ahead in the own path; false alarms and misses against "
        "the same rule fed by the truth of all stations, within 1 s",
    ),
    (
        "delivered",
        "share of pairs of message and receiver within 300 m; busy: channel busy ratio of 100 ms windows",
    ),
)


@dataclass(frozen=True)
class Drive:
    """One bag under evaluation: the clean one has no labels."""

    name: str
    detection: Detection
    moments: dict[str, list[Moment]]
    errors: dict[str, LdmError]
    warned: dict[str, Warnings]
    radio: RadioRow | None
    labels: list[MessageLabel]


def has_v2x(bag: Path) -> bool:
    """Whether a bag holds V2X that can be evaluated."""
    topics = BagReader(bag).topics
    return V2X_STATIONS.name in topics and V2X_SENT.name in topics


def sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, config: DetectorConfig | None = None
) -> tuple[Section, ...]:
    """One section on all adversarial bags in which messages were attacked; none where there are none.

    `seed` serves no draw here. Raises AdvpipeError for bags whose V2X or labels cannot be read.
    """
    del seed
    lied = [bag for bag in adversarial if has_v2x(bag) and read_labels(bag)]
    if not lied or not has_v2x(clean):
        return ()
    drives = [read_drive(clean, "clean", config), *(read_drive(bag, bag_name(bag), config) for bag in lied)]
    return (section(drives[0], drives[1:], config or DetectorConfig()),)


def read_drive(bag: Path, name: str, config: DetectorConfig | None = None) -> Drive:
    """Everything that is evaluated of one bag."""
    reader = BagReader(bag)
    labels = read_labels(bag)
    drive = V2xDrive(reader)
    listeners = sorted(drive.listeners.values())
    found = {one: list(moments(reader, one, drive.v2x.ldm.expiry_s)) for one in listeners}
    return Drive(
        name,
        detect(read_receptions(reader), labels, config),
        found,
        {one: ldm_error(found[one]) for one in listeners},
        {one: warnings(found[one], _believed(reader, one, found[one])) for one in listeners},
        radio_row(read_statistics(reader)),
        labels,
    )


def section(clean: Drive, attacked: Sequence[Drive], config: DetectorConfig) -> Section:
    """Tables, pictures and records of drives that have been read."""
    told = [drive.detection for drive in attacked if drive.detection.lies]
    ours, theirs = [each.ours.f1 for each in told], [each.baseline.f1 for each in told]
    rate = clean.detection.ours.false_positive_rate
    lead = (
        f"Mean F1 over {len(told)} bags with lies {number(_mean(ours), 3)}, of the baseline built from "
        f"CaTCH's checks {number(_mean(theirs), 3)}; of {clean.detection.messages:,} honest messages of the "
        f"clean drive {number(100 * rate, 2)} % are flagged, by the baseline "
        f"{number(100 * clean.detection.baseline.false_positive_rate, 2)} %."
    )
    return Section(
        key="v2x",
        title="V2X: lies told, believed and found out",
        lead=lead,
        tables=(
            _detection_table(attacked),
            _victim_table([clean, *attacked]),
            _radio_table([clean, *attacked]),
            _check_table(config, attacked),
        ),
        pictures=tuple(_pictures(clean, attacked)),
        records=tuple(_record(drive, listener) for drive in (clean, *attacked) for listener in drive.errors),
        formulas=FORMULAS,
    )


def _detection_table(attacked: Sequence[Drive]) -> Table:
    heads = ("bag", "attack", "messages", "lies", "precision", "recall", "F1", "MCC", "latency s", "caught %")
    lines = []
    for drive in attacked:
        each = drive.detection
        lines.append(
            (
                *(drive.name, each.attack, number(each.messages, 0), number(each.lies, 0)),
                *(number(value, 3) for value in (each.ours.precision, each.ours.recall)),
                *(number(value, 3) for value in (each.ours.f1, each.ours.mcc)),
                *(number(each.ours.latency_s, 2), number(100 * each.ours.caught, 0)),
                *(number(each.baseline.f1, 3), number(PUBLISHED_CATCH_F1.get(each.attack), 3)),
            )
        )
    return Table("Detection of lies", (*heads, "baseline F1", "CaTCH published"), tuple(lines))


def _victim_table(drives: Sequence[Drive]) -> Table:
    heads = (
        *("bag", "vehicle", "entries", "ghosts", "at most", "missing", "displaced", "error m"),
        *("alarms", "dangers", "false alarms", "misses"),
    )
    lines = []
    for drive in drives:
        for listener, error in drive.errors.items():
            row, warned = error.row(), drive.warned[listener]
            lines.append(
                (
                    *(drive.name, listener, number(row["known"], 1), number(row["ghosts"], 2)),
                    *(number(row["ghosts_max"], 0), number(row["missing"], 2), number(row["displaced"], 2)),
                    number(row["error_m"], 2),
                    *(number(value, 0) for value in (warned.alarms, warned.dangers)),
                    *(number(value, 0) for value in (warned.false_alarms, warned.misses)),
                )
            )
    return Table("Local Dynamic Map and collision warning", heads, tuple(lines))


def _radio_table(drives: Sequence[Drive]) -> Table:
    heads = ("bag", "messages sent", "dropped", "delivered %", "busy %", "busy at most %", "delay ms")
    lines = []
    for drive in drives:
        if (row := drive.radio) is not None:
            shares = (row.delivered, row.busy_mean, row.busy_max)
            lines.append(
                (
                    *(drive.name, number(row.cams, 0), number(row.dropped, 0)),
                    *(number(100 * value, 2) for value in shares),
                    number(1000 * row.delay_s, 2),
                )
            )
    return Table("Radio channel", heads, tuple(lines))


def _check_table(config: DetectorConfig, attacked: Sequence[Drive]) -> Table:
    lines = []
    for name, check in CHECKS.items():
        if name in config.thresholds:
            hits = sum(drive.detection.objections.get(name, 0) for drive in attacked)
            threshold = f"{config.thresholds[name]:.3g} {check.unit}"
            lines.append((name, check.meaning, threshold, number(hits, 0), check.source))
    heads = ("check", "measures", "objects above", "lies it objects to", "after")
    return Table("The checks", heads, tuple(lines))


def _pictures(clean: Drive, attacked: Sequence[Drive]) -> list[Picture]:
    caption = "F1 of each attack; the published figures are of other data"
    figures = [("", "v2x-detection.png", caption, draw_detection([d.detection for d in attacked]))]
    for drive in attacked:
        listener = max(drive.errors, key=lambda one: float(np.nansum(_wrong(drive.errors[one]))))
        if not drive.moments[listener]:
            continue
        before, during = _telling(drive, listener)
        words = f"{drive.name}: the map of {listener}"
        figures.append((drive.name, f"{drive.name}-ldm.png", words, draw_maps(before, during, words)))
        errors = draw_errors(clean.errors[listener], drive.errors[listener], words)
        figures.append((drive.name, f"{drive.name}-ldm-error.png", f"{words} over time", errors))
    return [Picture(SECTION, bag, name, caption, to_png(figure)) for bag, name, caption, figure in figures]


def _telling(drive: Drive, listener: str) -> tuple[Moment, Moment]:
    """The last map before the first lie, or the first of all; and the one that is most wrong after it."""
    found = drive.moments[listener]
    first_ns = min((label.time_ns for label in drive.labels), default=0)
    before = [index for index, moment in enumerate(found) if moment.time_ns <= first_ns]
    wrong = _wrong(drive.errors[listener])
    after = np.array([moment.time_ns > first_ns for moment in found])
    worst = int(np.argmax(np.where(after, wrong, -1.0)))
    return found[before[-1] if before else 0], found[worst]


def _wrong(error: LdmError) -> Float64:
    return error.ghosts + error.missing + error.displaced


def _record(drive: Drive, listener: str) -> Row:
    each, warned = drive.detection, drive.warned[listener]
    record: Row = {"bag": drive.name, "vehicle": listener, "attack": each.attack, "lies": each.lies}
    record["messages"] = each.messages
    for prefix, found in (("", each.ours), ("baseline_", each.baseline)):
        for name in ("precision", "recall", "f1", "mcc", "latency_s", "caught", "false_positive_rate"):
            record[f"{prefix}{name}"] = getattr(found, name)
    record |= {f"ldm_{name}": value for name, value in drive.errors[listener].row().items()}
    record |= {f"warning_{name}": value for name, value in asdict(warned).items()}
    if drive.radio is not None:
        record |= {f"radio_{name}": value for name, value in asdict(drive.radio).items()}
    return record


def _believed(reader: BagReader, listener: str, found: Sequence[Moment]) -> list[Known] | None:
    """What the vehicle takes itself for at each moment: its on-board estimate; None where it has none."""
    topic = VehicleTopics(listener).odometry.name
    if topic not in reader.topics:
        return None
    times_ns, told = [], []
    for time_ns, message in reader.messages(topic):
        pose = messages.se3_from_pose(message.pose.pose)
        yaw_rad = float(np.arctan2(pose[1, 0], pose[0, 0]))
        told.append((float(pose[0, 3]), float(pose[1, 3]), yaw_rad, float(message.twist.twist.linear.x)))
        times_ns.append(time_ns)
    believed = []
    for moment in found:
        truth = known_of_radio(moment.own)
        nth = int(np.searchsorted(times_ns, moment.time_ns, "right")) - 1
        x_m, y_m, yaw_rad, speed_mps = told[max(nth, 0)]
        believed.append(truth._replace(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, speed_mps=speed_mps))
    return believed


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if value == value]
    return float(np.mean(known)) if known else float("nan")
