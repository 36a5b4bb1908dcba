"""The numbers by which OPV2V knows agents and objects."""

from __future__ import annotations

import re
from collections.abc import Iterable

_AGENT = re.compile(r"(cav|rsu)_(\d{1,15})", re.ASCII)
_NUMBER = re.compile(r"0|[1-9]\d{0,14}", re.ASCII)
EGO_NUMBER = 0
"""Smallest, since OpenCOOD takes the agent that comes first for ego."""

_FIRST_FREE = 1_000_000


class Numbers:
    """Numbers of agents by their namespaces, and of objects by their ids.

    `cav_650` is 650 and `rsu_1` is -1, as they are imported; an id that is a number keeps it; others are
    counted from a million as they come.
    """

    def __init__(self, vehicles: Iterable[str]) -> None:
        self._numbers: dict[str, int] = {}
        self._taken = {EGO_NUMBER}
        for vehicle in vehicles:
            found = _AGENT.fullmatch(vehicle)
            if vehicle == "ego":
                self._numbers[vehicle] = EGO_NUMBER
            elif found:
                self._numbers[vehicle] = int(found[2]) * (-1 if found[1] == "rsu" else 1)
                self._taken.add(self._numbers[vehicle])
            else:
                self.of(vehicle)

    def of(self, name: str) -> int:
        """The number of an id, always the same."""
        if name not in self._numbers:
            number = int(name) if _NUMBER.fullmatch(name) else _FIRST_FREE
            while number in self._taken:
                number = max(number + 1, _FIRST_FREE)
            self._taken.add(number)
            self._numbers[name] = number
        return self._numbers[name]

    def names(self) -> dict[int, str]:
        """The ids by their numbers."""
        return {number: name for name, number in self._numbers.items()}
