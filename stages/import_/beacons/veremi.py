"""The logs of VeReMi (2018) and of VeReMi Extension, which F2MD writes: one object of JSON a line.

A file for each receiving vehicle holds its own states (type 2) and the beacons that it received (type 3); one
more what was truly sent (type 4). Key lists: van der Heijden et al., SecureComm 2018, and Kamel et al., IEEE
ICC 2020, with the code that writes them (`veins`, branch securecomm2018; `veins-f2md`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.plain_json import load_json
from advpipe.stages.import_.beacons.record import (
    EPOCH_NS,
    NOTHING,
    OWN,
    RECEIVED,
    TRUTH,
    BeaconRecord,
    BeaconState,
    number,
    vector,
    word,
)

_RECEIVER = {
    "veremi": re.compile(r"JSONlog-\d+-(?P<id>\d+)-A(?P<attack>\d+)\.json"),
    "f2md": re.compile(r"traceJSON-(?P<id>\d+)-\d+-A(?P<attack>\d+)-\d+-\d+\.json"),
}
_TRUTH = {
    "veremi": re.compile(r"GroundTruthJSONlog\.json"),
    "f2md": re.compile(r"traceGroundTruthJSON-\d+\.json"),
}
TRACE = "trace"
"""The folder of the logs in an export of ours."""


def veremi_folder(source: Path, form: str) -> Path:
    """The folder with the logs. Raises UsageError where there are none of this form."""
    for folder in (source / TRACE, source):
        if folder.is_dir() and any(_RECEIVER[form].fullmatch(path.name) for path in folder.iterdir()):
            return folder
    example = {"veremi": "JSONlog-0-7-A0.json", "f2md": "traceJSON-21-19-A0-25206-7.json"}[form]
    raise UsageError(f"{source} holds no logs of {form}, such as {example}; name the folder with them")


def veremi_records(folder: Path, form: str, receiver: str | None = None) -> Iterator[BeaconRecord]:
    """The records of a folder, file by file. receiver: of this vehicle and of the truth alone."""
    for path in sorted(folder.iterdir()):
        own = _RECEIVER[form].fullmatch(path.name)
        if own is None and not _TRUTH[form].fullmatch(path.name):
            continue
        if own is not None and receiver is not None and own["id"] != receiver:
            continue
        with path.open(encoding="utf-8", errors="replace") as lines:
            texts = (line.strip() for line in lines)
            for place, text in enumerate(text for text in texts if text):
                where = f"{path.name}, record {place + 1}"
                yield _record(_values(text, where), text, path.name, place, own and own["id"], where)


def attack_of_file(name: str, form: str) -> tuple[str, int] | None:
    """The vehicle of a receiver's file and the number of its attack, 0 for none; None for other files."""
    found = _RECEIVER[form].fullmatch(name)
    return None if found is None else (found["id"], int(found["attack"]))


def _values(text: str, where: str) -> dict[str, Any]:
    try:
        values = load_json(text)
    except (ValueError, RecursionError) as error:
        raise AdvpipeError(f"{where}: not valid JSON: {error}; download the log again") from None
    if not isinstance(values, dict):
        raise AdvpipeError(f"{where}: no JSON object; download the log again")
    return values


def _record(
    values: Mapping[str, Any], text: str, file: str, place: int, receiver: str | None, where: str
) -> BeaconRecord:
    kind = int(number(values, "type", where, TRUTH))
    if kind not in (OWN, RECEIVED, TRUTH):
        raise AdvpipeError(f"{where}: type {kind} is none of 2, 3 and 4; download the log again")
    sent = math.nan
    if kind != OWN:
        sent = number(values, "time" if "sendTime" not in values else "sendTime", where)
    received = math.nan if kind == TRUTH else number(values, "rcvTime", where)
    state = _state(values, where)
    return BeaconRecord(
        kind,
        file,
        place,
        _time_ns(sent if kind == TRUTH else received),
        None if kind == OWN else _time_ns(sent),
        "" if receiver is None else receiver,
        word(values, "sender"),
        word(values, "senderPseudo"),
        word(values, "messageID"),
        received,
        sent,
        int(number(values, "attackerType", where, -1)),
        number(values, "RSSI", where, math.nan),
        BeaconState() if kind == OWN else state,
        state if kind == OWN else BeaconState(),
        text,
    )


def _state(values: Mapping[str, Any], where: str) -> BeaconState:
    noise = vector(values, "pos_noise", where)
    return BeaconState(
        vector(values, "pos", where),
        vector(values, "noise", where) if noise is NOTHING else noise,  # as own states of 2018 name it
        *(vector(values, key, where) for key in ("spd", "spd_noise", "acl", "acl_noise", "hed", "hed_noise")),
    )


def _time_ns(time_s: float) -> int:
    return EPOCH_NS + round(time_s * 1e9)
