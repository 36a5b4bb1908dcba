"""Imports benchmarks, which are scripts beside each other and no package."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@contextmanager
def benchmark_module(name: str) -> Iterator[ModuleType]:
    """benchmarks/NAME.py, which may import its neighbours; afterwards, all of them are forgotten."""
    before = set(sys.modules)
    sys.path.insert(0, str(BENCHMARKS))
    try:
        yield import_module(name)
    finally:
        sys.path.remove(str(BENCHMARKS))
        for each in set(sys.modules) - before:
            if Path(getattr(sys.modules[each], "__file__", None) or "/").parent == BENCHMARKS:
                del sys.modules[each]
