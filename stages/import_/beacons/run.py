"""Imports a published log of beacons as a data set: the honest beacons in its clean bag, all of them beside.

`advpipe evaluate` scores misbehaviour detectors on it as on a drive of ours.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from advpipe.pipeline.bag.provenance import attack_provenance, imported_provenance
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.summary import BagSummary
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import OutputExistsError, UsageError, as_usage_error
from advpipe.pipeline.core.licence import licence_line
from advpipe.pipeline.core.partial import FolderKind, finish_moves, staged_folder
from advpipe.pipeline.core.progress import plan_progress, track
from advpipe.pipeline.core.tabular import Rows
from advpipe.pipeline.core.text import counted, escape_unprintable
from advpipe.pipeline.dataset.layout import SOURCE_NAME
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.stages.import_.beacons.bag import LogBag
from advpipe.stages.import_.beacons.cams import LOSSES, CamsOfLog, StationIds
from advpipe.stages.import_.beacons.labels import LogLabels, write_labels
from advpipe.stages.import_.beacons.motion import motion_of_numbers, motion_of_vectors
from advpipe.stages.import_.beacons.nextgen import nextgen_files, nextgen_records
from advpipe.stages.import_.beacons.record import RECEIVED, TRUTH, BeaconRecord
from advpipe.stages.import_.beacons.veremi import veremi_folder, veremi_records
from advpipe.stages.import_.options import ImportRequest

CLEAN, ATTACKED = "clean", "attacked"
LOG_DATA_SET = FolderKind("data set", (SOURCE_NAME, CLEAN, ATTACKED), (SOURCE_NAME, f"{CLEAN}/metadata.yaml"))
ORIGIN_DEG = (48.76, 11.42)
"""Where the log's map is put on the Earth: logs have no geographic origin, and no check depends on it."""


@dataclass(frozen=True, repr=False)
class LogSummary(BagSummary):
    """What was imported of a log. bag: the one with all beacons."""

    form: str
    receivers: int
    received: int
    false: int
    licence: str | None
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        about = (
            f"{self.bag}: {counted(self.received, 'beacon')} received by "
            f"{counted(self.receivers, 'vehicle')}, {self.false:,} of them false"
        )
        return "\n".join([about, licence_line(self.licence), *self.notes])

    def to_dicts(self) -> Rows:
        """One row: the bag and its counts."""
        return [
            {
                "bag": str(self.bag),
                "form": self.form,
                "receivers": self.receivers,
                "received": self.received,
                "false": self.false,
                "licence": self.licence,
            }
        ]


def import_log(request: ImportRequest, out: Path, *, overwrite: bool = False) -> LogSummary:
    """Import a log as the data set folder `out`: source.yaml, clean/ and, where there are false beacons,
    attacked/ with labels.

    Raises AdvpipeError, one line, for a source that is not of the form or is damaged.
    """
    finish_moves(out, out)
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    request.options.refuse_others(request.form, ("drive",))
    if request.options.frames != "::":
        raise UsageError(f"a log has no frames; leave {request.options.frames} out")
    plan_progress({READING: 3, WRITING: 7})
    with as_usage_error():
        records = sorted(track(_records(request), READING), key=lambda record: record.stamp_ns)
    labels = LogLabels(request.form, request.source, records)
    description = _description(request, labels)
    text = yaml.safe_dump(description, sort_keys=False, allow_unicode=True)
    provenance = imported_provenance(description["name"], text)
    with staged_folder(out, overwrite, LOG_DATA_SET) as folder:
        (folder / SOURCE_NAME).write_text(text, encoding="utf-8")
        false = sum(labels.is_false(record) for record in records if record.kind == RECEIVED)
        ids = StationIds()
        left_out = _write(request, folder / CLEAN, provenance, records, labels, ids, is_clean=True)
        if false:
            attacked = attack_provenance(
                folder / CLEAN,
                provenance,
                attack=labels.attack,
                recipe="",
                parameters={},
                seed=0,
                frames="::",
            )
            left_out = _write(request, folder / ATTACKED, attacked, records, labels, ids, is_clean=False)
    receivers = {record.receiver for record in records if record.kind == RECEIVED}
    received = sum(record.kind == RECEIVED for record in records)
    notes: tuple[str, ...] = LOSSES
    if left_out:
        notes += (f"{counted(left_out, 'beacon')} without a place on a map became no CAM.",)
    bag = out / (ATTACKED if false else CLEAN)
    return LogSummary(bag, request.form, len(receivers), received, false, request.options.licence, notes)


READING, WRITING = "reading the log", "writing the bags"


def _records(request: ImportRequest) -> Iterator[BeaconRecord]:
    drive = request.options.drive
    if request.form == "nextgen":
        yield from nextgen_records(nextgen_files(request.source, drive))
        return
    folder = veremi_folder(request.source, request.form)
    found = 0
    for record in veremi_records(folder, request.form, drive):
        found += record.kind != TRUTH
        yield record
    if not found:
        raise UsageError(f"{folder} holds no log of the vehicle {drive}")


def _write(
    request: ImportRequest,
    bag: Path,
    provenance: dict[str, str],
    records: list[BeaconRecord],
    labels: LogLabels,
    ids: StationIds,
    *,
    is_clean: bool,
) -> int:
    """Write a bag, and count the received beacons that became no CAM. is_clean: without false beacons."""
    geodesy = Geodesy(*ORIGIN_DEG, 0.0)
    motion = (lambda state, _: motion_of_numbers(state)) if request.form == "nextgen" else motion_of_vectors
    cams: dict[str, CamsOfLog] = {}
    names = {record.receiver: vehicle_name(record.receiver) for record in records if record.receiver}
    left_out = 0
    with BagWriter(bag, provenance=Provenance(provenance, str(bag))) as writer:
        log = LogBag(writer, ORIGIN_DEG, names, partial(motion))
        log.begin(records)
        for record in track(records, f"{WRITING}: {bag.name}", len(records)):
            if is_clean and labels.is_false(record):
                continue
            log.write_record(record)
            if record.kind != RECEIVED:
                continue
            log.write_own(record)
            of_receiver = cams.setdefault(record.receiver, CamsOfLog(geodesy, ids, motion))
            payload = of_receiver.payload(record)
            left_out += payload is None
            if payload is not None:
                log.write_received(record, payload, labels.number(record), ids.of(record.sender))
        if not is_clean:
            write_labels(writer.folder, records, labels, ids)
    return left_out


def vehicle_name(receiver: str) -> str:
    """A receiver's name as topics take it, such as vehicle_21 and veh_12."""
    plain = re.sub(r"[^a-z0-9_]", "_", receiver.lower())
    return plain if plain[:1].isalpha() else f"vehicle_{plain}"


def _description(request: ImportRequest, labels: LogLabels) -> dict[str, Any]:
    attackers = {"attacker_files": labels.attacker_files} if labels.attacker_files else {}
    return {
        "form": request.form,
        "name": escape_unprintable(request.source.resolve().name),
        "source": escape_unprintable(request.source.resolve().name),
        "licence": request.options.licence,
        "citation": CITATIONS[request.form],
        "notes": list(LOSSES),
        "options": {"drive": request.options.drive} if request.options.drive else {},
        **attackers,
    }


CITATIONS = {
    "veremi": "van der Heijden et al., VeReMi, SecureComm 2018",
    "f2md": "Kamel et al., VeReMi Extension, IEEE ICC 2020",
    "nextgen": "VeReMi NextGen, https://github.com/VeReMi-dataset/VeReMi-NextGen",
}
