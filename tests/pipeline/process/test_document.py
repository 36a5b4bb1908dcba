"""A document for programs: strict JSON whatever is in it."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.process.document import strict_json


@dataclass
class Found:
    path: Path
    counts: Counter[str]


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def test_all_values_become_json_types() -> None:
    text = strict_json(
        {
            "found": Found(Path("a/b"), Counter(cars=2)),
            "nan": math.nan,
            "infinite": [math.inf, -np.float32("inf")],
            "numpy": (np.int64(3), np.float32(0.5), np.bool_(True)),
            "set": frozenset({"b", "a"}),
            "bytes": "caf\udce9",
            "control": "\x1b\x7f",
            1: None,
        }
    )
    assert json.loads(text, parse_constant=refuse) == {
        "found": {"path": "a/b", "counts": {"cars": 2}},
        "nan": None,
        "infinite": [None, None],
        "numpy": [3, 0.5, True],
        "set": ["a", "b"],
        "bytes": "caf\\udce9",
        "control": "\x1b\x7f",
        "1": None,
    }
    assert text.isascii()
    assert "\x7f" not in text


def test_a_value_of_another_type_is_refused() -> None:
    with pytest.raises(TypeError):
        strict_json({"what": object()})
