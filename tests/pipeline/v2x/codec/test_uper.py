"""Against pycrate itself, on the type that both are made from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pycrate_core.charpy import Charpy

from advpipe.pipeline.v2x.codec.codec import asn1_cam
from advpipe.pipeline.v2x.codec.uper import NotPlain, Uper

CamTree = dict[str, Any]


@pytest.fixture(scope="module")
def uper() -> Uper:
    return Uper(asn1_cam())


def test_pycrate_writes_the_same_bytes(uper: Uper, random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(0)
    plain = 0
    for _ in range(1000):
        tree = random_cam_tree(rng)
        expected = bytes(asn1_cam().to_uper(tree))
        try:
            assert uper.encode(tree) == expected
            assert uper.decode(expected) == tree
        except (NotPlain, KeyError):  # the one value that a release added to an enumeration
            assert "temporaryCenDsrcTolling" in str(tree)
        else:
            plain += 1
    assert plain > 600


def test_decoded_values_equal_those_of_pycrate(uper: Uper, cam_vector: bytes) -> None:
    rng = np.random.default_rng(1)
    read = 0
    for _ in range(2000):
        corrupt = bytearray(cam_vector)
        for at in rng.integers(64, 8 * len(corrupt), size=rng.integers(1, 4)):
            corrupt[at // 8] ^= 128 >> at % 8
        try:
            tree = uper.decode(bytes(corrupt))
        except (NotPlain, ValueError, IndexError):
            continue
        stream = Charpy(bytes(corrupt))
        asn1_cam().from_uper(stream)
        assert asn1_cam().get_val() == tree
        assert stream.len_bit() == 0
        read += 1
    assert read > 800


@pytest.mark.parametrize("value", [70_000, -1, 1.5, None, "1"])
def test_other_cases_are_left_to_pycrate(uper: Uper, cam_vector: bytes, value: object) -> None:
    tree = uper.decode(cam_vector)
    tree["cam"]["generationDeltaTime"] = value
    with pytest.raises((NotPlain, TypeError)):
        uper.encode(tree)


def test_unknown_members_are_not_dropped_silently(uper: Uper, cam_vector: bytes) -> None:
    tree = uper.decode(cam_vector)
    tree["cam"]["speeed"] = 3
    with pytest.raises(NotPlain):
        uper.encode(tree)
