"""The verdict on drives of several lengths: only what was measured is judged."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest
from benchmark_modules import benchmark_module

COUNTS = (100, 1000, 10_000)
MADE = ("clean", "removed", "report")


@pytest.fixture
def benchmark() -> Iterator[ModuleType]:
    with benchmark_module("scale_length") as module:
        yield module


def costs(
    benchmark: ModuleType, last_s: float = 100.0, last_mb: float = 500.0, lengths: int = 3
) -> dict[int, dict[str, Any]]:
    """10 ms and no memory for each further frame, but for those of the longest drive."""
    of_counts = ((1.0, 400.0), (10.0, 400.0), (last_s, last_mb))
    found = {
        count: dict.fromkeys(MADE, benchmark.Cost(*each))
        for count, each in zip(COUNTS, of_counts, strict=True)
    }
    return dict([*found.items()][:lengths])


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "yes"),
        ({"last_s": 122.0}, "yes"),  # 1.24 times
        ({"last_s": 123.0}, "NO"),
        ({"last_mb": 600.0}, "NO"),  # 22 kB for each of 9,000 frames
        ({"lengths": 2}, "not judged; that takes 3 lengths"),
        ({"lengths": 0}, "not judged; that takes 3 lengths"),
    ],
)
def test_the_mark(benchmark: ModuleType, changes: dict[str, Any], verdict: str) -> None:
    assert benchmark.judged(costs(benchmark, **changes)) == verdict


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("count", COUNTS)
def test_what_was_made_before_is_not_judged(benchmark: ModuleType, name: str, count: int) -> None:
    found = costs(benchmark, last_s=1000.0)
    del found[count][name]
    reason = f"not judged; made before, and so not measured: {name} of {count:,} frames"
    assert benchmark.judged(found) == reason
