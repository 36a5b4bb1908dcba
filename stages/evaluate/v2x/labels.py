"""Which messages of an adversarial bag are lies, from the labels beside it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.misbehaviour.scores import Bools

LABELS = "v2x_labels.parquet"
NOT_SENT = "dropped"


@dataclass(frozen=True)
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


def read_labels(bag: Path) -> list[MessageLabel]:
    """The labels of an adversarial bag, in their order; none for a bag without attacks on messages.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no labels.
    """
    folder = bag if bag.is_dir() else bag.parent
    path = folder / LABELS
    if not path.exists():
        return []
    import pyarrow.parquet as pq

    names = ("number", "attack", "attacker", "action", "mattered", "time_ns", "station_id")
    try:
        rows = pq.read_table(path, columns=list(names)).to_pylist()
    except (OSError, ValueError, KeyError) as error:
        reason = str(error).splitlines()[0]
        raise AdvpipeError(f"{path} holds no labels of messages: {reason}; attack again") from None
    return [MessageLabel(*(row[name] for name in names)) for row in rows]


def lies(numbers: Sequence[int], labels: Iterable[MessageLabel]) -> Bools:
    """Which messages (M,) an attack touched so that it mattered, by their numbers in /v2x/sent.

    A message that was touched without effect is none: a zero-speed report of a standing car is no lie.
    """
    lying = {label.number for label in labels if label.mattered and label.action != NOT_SENT}
    return np.array([number in lying for number in numbers], bool)
