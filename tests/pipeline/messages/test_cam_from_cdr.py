"""CAMs as ROS 2 messages read back: the values of which rosbags' bytes are made."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cam_as_message import cam_message

from advpipe.pipeline.messages.cam_from_cdr import cam_tree_of_cdr
from advpipe.pipeline.messages.cam_types import full_name
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree

CamTree = dict[str, Any]


def test_random_cams_that_rosbags_serialised(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        tree = random_cam_tree(rng)
        assert cam_tree_of_cdr(serialise(cam_message(tree), full_name("CAM"))) == tree


def test_the_encoding_is_that_of_the_cam_that_was_sent(cam_vector: bytes) -> None:
    cdr = serialise(cam_message(decode_cam_tree(cam_vector)), full_name("CAM"))
    assert encode_cam_tree(cam_tree_of_cdr(cdr)) == cam_vector


def test_any_other_bytes_are_refused(cam_vector: bytes) -> None:
    """Truncated anywhere, or with any byte changed: an error of this kind, or other values."""
    cdr = serialise(cam_message(decode_cam_tree(cam_vector)), full_name("CAM"))
    rng = np.random.default_rng(3)
    for length in rng.integers(0, len(cdr) - 1, 200):
        with pytest.raises(CamError):
            cam_tree_of_cdr(cdr[:length])
    for place in rng.integers(0, len(cdr), 300):
        changed = bytearray(cdr)
        changed[place] = 255
        with contextlib.suppress(CamError):
            cam_tree_of_cdr(bytes(changed))
