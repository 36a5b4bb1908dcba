"""Which beacons of a log are false, as the log says it, in the form of our own labels."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.document import read_json
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.columns import arrow_schema
from advpipe.pipeline.labels.messages import CHANGED, FILE, MESSAGE_COLUMNS
from advpipe.stages.import_.beacons.cams import StationIds
from advpipe.stages.import_.beacons.record import RECEIVED, TRUTH, BeaconRecord
from advpipe.stages.import_.beacons.veremi import TRACE, attack_of_file

ATTACKS_FILE = "attacks.json"
"""Names of attacks by number, in an export of ours."""
_Key = tuple[str, str, int]


class LogLabels:
    """The truth of a log's beacons.

    NextGen: each record has it. VeReMi: the attackerType of what was truly sent or, where the log does not
    have it, the number in the name of the sender's own file, by which all messages of an attacker are false.
    Received copies of a message share a number, where the log says the same of them.

    attacker_files: one file of each attacker without imported records, whose name alone says that it attacks.
    """

    def __init__(self, form: str, source: Path, records: Sequence[BeaconRecord]) -> None:
        self._form, self._source = form, source
        self._by_message = {
            (record.sender, record.message): record.attacker
            for record in records
            if record.kind == TRUTH and record.attacker >= 0
        }
        imported = {record.file for record in records}
        self._by_sender: dict[str, int] = {}
        others: dict[str, str] = {}
        for file in (*sorted(_siblings(form, source) - imported), *sorted(imported)):
            if form != "nextgen" and (found := attack_of_file(file, form)) is not None:
                sender, self._by_sender[sender] = found
                others[sender] = file
        self.attacker_files = [
            file for sender, file in others.items() if self._by_sender[sender] and file not in imported
        ]
        self._numbers: dict[_Key, int] = {}
        self._names = _attack_names(source)
        for record in records:
            if record.kind == RECEIVED:
                self._numbers.setdefault(self._key(record), len(self._numbers))

    def attacker_type(self, record: BeaconRecord) -> int:
        """The number of the attack that made a beacon false; 0 for an honest one."""
        if record.attacker >= 0:
            return record.attacker
        known = self._by_message.get((record.sender, record.message))
        return self._by_sender.get(record.sender, 0) if known is None else known

    def is_false(self, record: BeaconRecord) -> bool:
        """Whether a received or sent beacon is false."""
        return record.sender != "" and self.attacker_type(record) > 0

    def number(self, record: BeaconRecord) -> int:
        """The number of the message that was received."""
        return self._numbers[self._key(record)]

    def attack_of(self, record: BeaconRecord) -> str:
        """The name of the attack that made a beacon false."""
        if self._form == "nextgen":
            return self._folder_attack() or "nextgen"
        found = self.attacker_type(record)
        return self._names.get(found, f"{self._form}-A{found}")

    @property
    def attack(self) -> str:
        """The name of the log's attack or attacks."""
        if self._form == "nextgen":
            return self._folder_attack() or "nextgen"
        numbers = {n for n in (*self._by_message.values(), *self._by_sender.values()) if n > 0}
        return "+".join(sorted(self._names.get(each, f"{self._form}-A{each}") for each in numbers))

    def _folder_attack(self) -> str:
        """The end of the data set's folder names, such as InTAS_urban_2_randomSpeedOffset."""
        found = re.search(r"_([a-z]+[A-Z]\w*)$", self._source.resolve().name)
        return found[1] if found else ""

    def _key(self, record: BeaconRecord) -> _Key:
        return record.sender, record.message or f"{record.file}:{record.place}", self.attacker_type(record)


def write_labels(folder: Path, records: Sequence[BeaconRecord], labels: LogLabels, ids: StationIds) -> None:
    """The false messages as a bag's labels, one row each; what the log does not say is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = {labels.number(r): r for r in records if r.kind == RECEIVED and labels.is_false(r)}
    numbers = sorted(rows)
    columns: dict[str, list[object]] = {name: [None] * len(numbers) for name in MESSAGE_COLUMNS}
    columns["number"] = [*numbers]
    columns["station_id"] = [ids.of(rows[number].sender) for number in numbers]
    times_ns = [rows[number].sent_ns for number in numbers]
    columns["time_ns"] = columns["sent_ns"] = [*times_ns]
    columns["attack"] = [labels.attack_of(rows[number]) for number in numbers]
    columns["attacker"] = columns["sender"] = [rows[number].sender for number in numbers]
    columns["action"] = [CHANGED] * len(numbers)
    columns["part"] = columns["fields"] = [""] * len(numbers)
    columns["mattered"] = np.ones(len(numbers), bool).tolist()
    pq.write_table(pa.Table.from_pydict(columns, arrow_schema(MESSAGE_COLUMNS)), str(folder / FILE))


def _siblings(form: str, source: Path) -> set[str]:
    """Names of all files of the log, of receivers that are not imported, too."""
    if form == "nextgen":
        return set()
    folder = source / TRACE if (source / TRACE).is_dir() else source
    return {path.name for path in folder.iterdir()}


def _attack_names(source: Path) -> dict[int, str]:
    path = source / ATTACKS_FILE
    if not path.is_file():
        return {}
    try:
        names: dict[str, int] = read_json(path.read_bytes(), dict[str, int], str(path), "export it again")
    except OSError as error:
        raise AdvpipeError(f"{path}: {error}") from None
    return {number: name for name, number in names.items()}
