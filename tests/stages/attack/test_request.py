"""What is asked of the attack stage, and refused."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.run import AttackRequest

DETECTOR = "linear_detector:Shipped"


def request(**changes):
    given = {"type": "detach", "parameters": {"ratio": 0.1}, "detector": DETECTOR, "seed": 3, **changes}
    seed = given.pop("seed")
    return AttackRequest((AttackSpec(**given),), seed)


@pytest.mark.parametrize("frames", ["5:5", "9:2"])
def test_frames_that_no_bag_has(frames):
    with pytest.raises(AdvpipeError, match=rf"frames {frames}:1 choose none: the stop"):
        request(frames=frames).check()
