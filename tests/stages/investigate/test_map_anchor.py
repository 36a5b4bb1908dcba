"""The map's origin follows from fixes and estimates that agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_drive import EARTH, record_small_drive

from advpipe.pipeline.bag.reader import BagReader
from advpipe.stages.investigate.evidence_topics import find_evidence
from advpipe.stages.investigate.map_anchor import anchored_geodesy


def test_the_origin_is_found_to_the_millimetre(tmp_path: Path) -> None:
    reader = BagReader(record_small_drive(tmp_path / "d", only=frozenset({"fix", "estimate"}), steps=25))
    found = anchored_geodesy(reader, find_evidence(reader))
    assert found is not None
    place = EARTH.to_geographic([400.0, -300.0, 2.0])
    np.testing.assert_allclose(found.to_map(place), [400.0, -300.0, 2.0], atol=1e-3)


def test_with_fixes_alone_the_first_one_is_the_origin(tmp_path: Path) -> None:
    reader = BagReader(record_small_drive(tmp_path / "d", only=frozenset({"fix"}), steps=25))
    found = anchored_geodesy(reader, find_evidence(reader))
    assert found is not None
    np.testing.assert_allclose(found.to_map(EARTH.to_geographic([0.0, 0.0, 0.0])), 0.0, atol=1e-6)


def test_without_fixes_there_is_none(tmp_path: Path) -> None:
    reader = BagReader(record_small_drive(tmp_path / "d", only=frozenset({"messages"}), steps=5))
    assert anchored_geodesy(reader, find_evidence(reader)) is None
