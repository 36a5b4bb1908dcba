"""The logs of VeReMi NextGen: a file for each receiving vehicle, with a list of all that it received.

Key list: `Documentation/Eclipse MOSAIC/Application` of VeReMi-dataset/VeReMi-NextGen at 1643972f. Numbers may
be texts, and vectors texts with commas, as the simulation writes them before attacks are added.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.plain_json import load_json
from advpipe.pipeline.dataset.layout import EXPORT_MARK
from advpipe.stages.import_.beacons.record import (
    EPOCH_NS,
    RECEIVED,
    TRUTH,
    BeaconRecord,
    BeaconState,
    number,
    text_of,
    vector,
    word,
)

LARGEST_BYTES = 1 << 30


def is_truth(path: Path) -> bool:
    """Whether a file holds what was truly sent: `..._groundTruth.json` or `..._ground_truth.json`."""
    return "groundtruth" in path.name.lower().replace("_", "")


def nextgen_files(source: Path, receiver: str | None = None) -> list[Path]:
    """The files of a folder. receiver: of this vehicle and of the truth alone. Raises UsageError for a folder
    without logs."""
    found = sorted(source.glob("*.json")) if source.is_dir() else []
    found = [path for path in found if path.name != EXPORT_MARK]
    found = [path for path in found if is_truth(path) or receiver in (None, path.stem)]
    if all(is_truth(path) for path in found):
        which = "" if receiver is None else f" of {receiver}"
        raise UsageError(
            f"{source} holds no log{which} of VeReMi NextGen, such as veh_12.json; name the folder with them"
        )
    return found


def nextgen_records(files: list[Path]) -> Iterator[BeaconRecord]:
    """The records of files, one file in memory at a time."""
    for path in files:
        try:
            document = load_json(path.read_bytes(), LARGEST_BYTES)
        except (ValueError, RecursionError) as error:
            raise AdvpipeError(f"{path.name}: not valid JSON: {error}; download the log again") from None
        if not isinstance(document, list):
            raise AdvpipeError(f"{path.name}: no list of records; download the log again")
        for place, values in enumerate(document):
            where = f"{path.name}, record {place + 1}"
            if not isinstance(values, dict) or not isinstance(values.get("sender"), dict):
                raise AdvpipeError(f"{where}: no record with a sender; download the log again")
            yield _record(values, path, place, where)


def _record(values: Mapping[str, Any], path: Path, place: int, where: str) -> BeaconRecord:
    truth = is_truth(path)
    received, sent = number(values, "rcvTime", where, math.nan), number(values, "sendTime", where)
    if not truth and math.isnan(received):
        raise AdvpipeError(f"{where}: rcvTime is missing; download the log again")
    own = values.get("receiver")
    return BeaconRecord(
        TRUTH if truth else RECEIVED,
        path.name,
        place,
        EPOCH_NS + int(sent if truth else received),
        EPOCH_NS + int(sent),
        "" if truth else path.stem,
        word(values, "sender_id"),
        word(values, "sender_alias"),
        word(values, "messageID"),
        received,
        sent,
        int(number(values, "attacker", where, -1)),
        math.nan,
        _state(values["sender"], where),
        _state(own, where) if isinstance(own, dict) else BeaconState(),
        text_of(values),
    )


def _state(values: Mapping[str, Any], where: str) -> BeaconState:
    def first(key: str) -> tuple[float, float, float]:
        return number(values, key, where, math.nan), math.nan, math.nan

    return BeaconState(
        vector(values, "pos", where),
        vector(values, "pos_noise", where),
        *(first(key) for key in ("spd", "spd_noise", "acl", "acl_noise", "hed", "hed_noise")),
    )
