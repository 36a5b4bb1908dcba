"""What attacks did to messages, as Parquet beside an adversarial bag: a row for each attack on a message."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.bounded_parquet import ColumnType, flat_columns, rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.columns import Columns, Type
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS

FILE = "v2x_labels.parquet"

ADDED, CHANGED, DELAYED, DROPPED, CORRUPT = "added", "changed", "delayed", "dropped", "corrupt"
ACTIONS = (ADDED, CHANGED, DELAYED, DROPPED, CORRUPT)
"""Corrupt: no CAM, left as it is."""

AXES = ("x_m", "y_m")
_UNITS = ("deg", "m", "rad", "mps", "mps2", "radps")


def _type(field: str) -> Type:
    return "float64" if field.rpartition("_")[2] in _UNITS else "int64"


MESSAGE_COLUMNS: Columns = {
    "number": "uint64",
    "station_id": "uint32",
    "time_ns": "int64",
    "sent_ns": "int64",
    **dict.fromkeys(("attack", "part", "attacker", "sender", "action", "fields"), "string"),
    "mattered": "bool",
    **{f"{kind}_{name}": _type(name) for kind in ("true", "false") for name in (*AXES, *FIELDS)},
}
"""number, station_id: of the message as in /v2x/sent (the radio's, whatever is claimed). time_ns: when it was
handed to the radio, as recorded; sent_ns: the same after the attack, null for never. part: of a mix, what
its attacker carries out; else empty. attacker: the vehicle or roadside unit; empty where the sender
is no attacker, as with a spoofed GPS. action: one of `ACTIONS`. fields: what the attack changed, with commas
between them ("other" for what has no column). mattered: see `pipeline/v2x/facilities/effect.py`. true_...,
false_...: of each field of a CAM, with x and y in the map's frame.

True values are those of the recorded message. Of one that was added or delayed, they are what the station
that it claims to be from had said itself by then; null for a station that does not exist.
"""

NEWER_COLUMNS = ("part", "fields")
"""Columns that older versions left out, or wrote as lists."""

_READ: dict[str, ColumnType] = {
    **dict.fromkeys(("number", "time_ns", "station_id"), "whole"),
    **dict.fromkeys(("attack", "attacker", "action", "part"), "text"),
    "mattered": "truth",
}


@dataclass(frozen=True, slots=True)
class MessageLabel:
    """A message that an attack changed: the attacker, the attack, the action, and whether it mattered."""

    number: int
    attack: str
    attacker: str
    action: str
    mattered: bool
    time_ns: int
    station_id: int
    """Of the radio that sends it."""
    part: str = ""

    @property
    def is_false(self) -> bool:
        """Whether it gave receivers false data that mattered: zero speed of a standing car does not.

        An attacker's message that is no valid CAM counts as false: no receiver may accept it.
        """
        return self.action != DROPPED and (self.mattered or self.action == CORRUPT)

    @property
    def attack_or_part(self) -> str:
        """The attack that was carried out: of a mix, the part."""
        return self.part or self.attack

    @property
    def attack_and_part(self) -> str:
        """The attack, and which part of a mix."""
        return f"{self.attack} / {self.part}" if self.part else self.attack


def read_labels(bag: Path) -> list[MessageLabel]:
    """The labels of an adversarial bag in their order; empty for a bag without attacks on messages.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no labels.
    """
    if not has_labels(bag):
        return []
    path = _path(bag)
    try:
        columns = {k: v for k, v in _READ.items() if k not in NEWER_COLUMNS or k in flat_columns(path)}
        return [_label(row) for row in rows(path, columns)]
    except AdvpipeError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise AdvpipeError(
            f"{path} does not hold V2X message labels: {reason}; run the attack again"
        ) from None


def _label(row: dict[str, Any]) -> MessageLabel:
    """The label, which shares its texts with the others: there may be a million of them."""
    for name, value in row.items():
        row[name] = sys.intern(value) if isinstance(value, str) else value
    return MessageLabel(**row)


def has_labels(bag: Path) -> bool:
    """Whether attacks on messages made the bag, even if they changed none."""
    return _path(bag).exists()


def _path(bag: Path) -> Path:
    return (bag if bag.is_dir() else bag.parent) / FILE


def are_false(numbers: Sequence[int | None], labels: Iterable[MessageLabel]) -> npt.NDArray[np.bool_]:
    """Which messages (M,) are false, by their numbers in /v2x/sent; an unknown one (None) counts as true."""
    false_numbers = {label.number for label in labels if label.is_false}
    return np.array([number in false_numbers for number in numbers], bool)
