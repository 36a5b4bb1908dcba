"""The file of tuned values is what the benchmark's command writes."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def ship(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """benchmarks/misbehaviour_ship.py."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("misbehaviour_ship")


def test_the_shipped_file_is_as_the_command_writes_it(ship: ModuleType) -> None:
    assert ship.TunedFile.shipped().text() == ship.TUNED_FILE.read_text(encoding="utf-8")


def test_what_is_tuned_is_rounded_as_the_file_states_it(ship: ModuleType) -> None:
    assert ship._four_digits(1234.56) == 1235.0
    assert ship._items({"a": 1, "b": (2, 0.5)}) == '    "a": 1.0,\n    "b": (2.0, 0.5),\n'
