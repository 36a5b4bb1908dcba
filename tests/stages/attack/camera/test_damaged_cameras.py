"""Bags whose cameras are damaged: one line each, never a traceback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.run import AttackRequest, attack

FRONT = "/ego/front"


def damaged(clean: Path, out: Path, topic: str, change: Callable[[Any], Any]) -> Path:
    """The bag with every message of a topic changed."""
    reader = BagReader(clean)
    with BagWriter(out, provenance=dict(reader.provenance)) as writer:
        for raw in reader.raw_messages(list(reader.topics)):
            if raw.topic.name == topic:
                raw = replace(raw, cdr=serialise(change(reader.decode(raw)), raw.topic.type))
            writer.copy(raw)
    return out


INFO, IMAGE, DEPTH, IDS = (
    "camera_info",
    *(f"{kind}/compressed" for kind in ("image", "depth", "instance_segmentation")),
)


@pytest.mark.parametrize(
    ("name", "topic", "change", "what"),
    [
        ("patch", INFO, lambda m: replace(m, width=1 << 31, height=1 << 31), "pixels"),
        ("blind", INFO, lambda m: replace(m, height=0), "pixels"),
        ("blind", INFO, lambda m: replace(m, k=np.full(9, np.nan)), "matrix nan"),
        ("patch", INFO, lambda m: replace(m, distortion_model="fov"), "distortion model 'fov'"),
        ("blind", IMAGE, lambda m: replace(m, data=m.data[:200]), "cannot be decompressed"),
        ("patch", IMAGE, lambda m: replace(m, data=m.data[:0]), "cannot be decompressed"),
        ("patch", IMAGE, lambda m: replace(m, header=replace(m.header, frame_id="x")), "no transform"),
        ("patch", DEPTH, lambda m: replace(m, data=m.data[:50]), "cannot be decompressed"),
        ("patch", IDS, lambda m: replace(m, data=m.data[:0]), "cannot be decompressed"),
    ],
)
def test_damaged_messages_are_one_line(
    name: str, topic: str, change: Callable[[Any], Any], what: str, camera_drive: Path, tmp_path: Path
) -> None:
    bag = damaged(camera_drive / "clean", tmp_path / "clean", f"{FRONT}/{topic}", change)
    parameters = {"camera": "front", **({"pattern": "random"} if name == "patch" else {})}
    request = AttackRequest((AttackSpec(type=f"camera-{name}", parameters=parameters),))
    with pytest.raises(AdvpipeError, match=what) as error:
        attack(bag, tmp_path / name, request)
    assert "\n" not in str(error.value)
