"""CAMs in CDR: the very bytes that rosbags makes of the message's objects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cam_as_message import cam_message

from advpipe.pipeline.messages.cam_cdr import cam_cdr
from advpipe.pipeline.messages.cam_types import full_name
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree

CamTree = dict[str, Any]


def test_random_cams_are_serialised_as_by_rosbags(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        tree = random_cam_tree(rng)
        assert cam_cdr(tree) == serialise(cam_message(tree), full_name("CAM"))


@pytest.mark.parametrize(
    ("name", "value"), [("curvatureCalculationMode", "_ext_0"), ("pathDeltaTime", 70_000)]
)
def test_values_of_a_later_release_are_refused(cam_vector: bytes, name: str, value: object) -> None:
    tree = decode_cam_tree(cam_vector)
    parameters = tree["cam"]["camParameters"]
    point = parameters["lowFrequencyContainer"][1]["pathHistory"][0]
    (point if name in point else parameters["highFrequencyContainer"][1])[name] = value
    with pytest.raises(CamError, match="etsi_its_cam_msgs/CAM cannot hold"):
        cam_cdr(tree)
