"""Which messages of an adversarial bag are lies, from the labels beside it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.core.bounded_parquet import Kind, flat_columns, rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.misbehaviour.scores import Bools

LABELS = "v2x_labels.parquet"
NOT_SENT, CORRUPT = "dropped", "corrupt"
PART = "part"
"""The column, where there is one, that says which attack of a mix a message was touched by."""

COLUMNS: dict[str, Kind] = {
    **dict.fromkeys(("number", "time_ns", "station_id"), "whole"),
    **dict.fromkeys(("attack", "attacker", "action", PART), "text"),
    "mattered": "truth",
}


@dataclass(frozen=True, slots=True)
class MessageLabel:
    """One message that an attack touched: who lies by which attack, how, and whether it mattered."""

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
    def is_lie(self) -> bool:
        """Whether receivers hear it and it mattered: a zero-speed report of a standing car is no lie.

        An attacker's message that is no CAM is one: no receiver may believe it.
        """
        return self.action != NOT_SENT and (self.mattered or self.action == CORRUPT)

    @property
    def word(self) -> str:
        """The attack that was carried out: of a mix, the part."""
        return self.part or self.attack

    @property
    def kind(self) -> str:
        """The attack, and which part of a mix."""
        return f"{self.attack} / {self.part}" if self.part else self.attack


def read_labels(bag: Path) -> list[MessageLabel]:
    """The labels of an adversarial bag, in their order; none for a bag without attacks on messages.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no labels.
    """
    if not has_labels(bag):
        return []
    path = _path(bag)
    try:
        columns = COLUMNS if PART in flat_columns(path) else {k: v for k, v in COLUMNS.items() if k != PART}
        return [_label(row) for row in rows(path, columns)]
    except AdvpipeError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise AdvpipeError(f"{path} holds no labels of messages: {reason}; attack again") from None


def _label(row: dict[str, Any]) -> MessageLabel:
    """The label, which shares its texts with the others: there may be a million of them."""
    for name, value in row.items():
        row[name] = sys.intern(value) if isinstance(value, str) else value
    return MessageLabel(**row)


def has_labels(bag: Path) -> bool:
    """Whether messages of a bag were attacked, if only in vain."""
    return _path(bag).exists()


def _path(bag: Path) -> Path:
    return (bag if bag.is_dir() else bag.parent) / LABELS


def lies(numbers: Sequence[int | None], labels: Iterable[MessageLabel]) -> Bools:
    """Which messages (M,) are lies, by their numbers in /v2x/sent; None is of an unknown message, no lie."""
    lying = {label.number for label in labels if label.is_lie}
    return np.array([number in lying for number in numbers], bool)
