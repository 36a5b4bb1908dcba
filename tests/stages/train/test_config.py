from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.train.config import TrainConfig


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bags": ()}, "at least one bag"),
        ({"preset": "huge"}, "unknown detector preset 'huge'; known: small"),
        ({"preset": "kitti"}, "preset kitti has other classes"),
        ({"batch_size": 0}, "batch_size is 0"),
        ({"epochs": -1.0}, "epochs is -1"),
        ({"learning_rate": float("nan")}, "learning_rate is nan"),
        ({"learning_rate": float("inf")}, "learning_rate is inf"),
        ({"seed": 10**23}, r"seed is 1e\+23; it has to be in 0 to 2\^63 - 1"),
        ({"seed": -1}, "seed is -1"),
        ({"steps": 0}, "steps is 0"),
        ({"warmup": 1.0}, "warmup is 1.0"),
    ],
)
def test_invalid_values_are_one_line_errors(changes, message):
    settings = {"bags": (Path("a"),), "out": Path("b"), **changes}
    with pytest.raises(AdvpipeError, match=message):
        TrainConfig(**settings)
