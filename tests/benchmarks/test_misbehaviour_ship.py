"""The file of tuned values is what the benchmark's command writes."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import pytest
from benchmark_modules import benchmark_module


@pytest.fixture
def ship() -> Iterator[ModuleType]:
    with benchmark_module("misbehaviour_ship") as module:
        yield module


def test_the_shipped_file_is_as_the_command_writes_it(ship: ModuleType) -> None:
    assert ship.TunedFile.shipped().text() == ship.TUNED_FILE.read_text(encoding="utf-8")


def test_what_is_tuned_is_rounded_as_the_file_states_it(ship: ModuleType) -> None:
    assert ship._four_digits(1234.56) == 1235.0
    assert ship._items({"a": 1, "b": (2, 0.5)}) == '    "a": 1.0,\n    "b": (2.0, 0.5),\n'
