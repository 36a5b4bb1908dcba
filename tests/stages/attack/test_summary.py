"""What is printed of an attack."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.stages.attack.lidar.base import unchanged
from advpipe.stages.attack.summary import MAX_NOTES, AttackSummary


@pytest.fixture
def printed(make_cloud):
    def lines(notes):
        summary = AttackSummary("bag")
        cloud = make_cloud(np.zeros((2, 3)))
        for note in notes:
            summary.add(len(cloud), unchanged(cloud, note))
        return str(summary).splitlines()

    return lines


def test_notes_come_with_their_frames(printed):
    assert printed(["b", "a", "b"])[1:] == ["  1 of 3 frames: a", "  2 of 3 frames: b"]


def test_a_note_of_its_own_in_every_frame_does_not_fill_the_screen(printed):
    lines = printed([*(f"only {count} points lie near enough" for count in range(50)), "often", "often"])
    assert len(lines) == 1 + MAX_NOTES + 1
    assert "  2 of 52 frames: often" in lines
    assert lines[-1] == f"  {52 - 2 - (MAX_NOTES - 1)} of 52 frames: others, see frames.parquet"
