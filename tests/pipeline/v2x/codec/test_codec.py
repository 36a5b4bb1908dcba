from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree

CamTree = dict[str, Any]


def bits(data: bytes) -> str:
    return "".join(f"{byte:08b}" for byte in data)


def packed(text: str) -> bytes:
    text += "0" * (-len(text) % 8)
    return bytes(int(text[at : at + 8], 2) for at in range(0, len(text), 8))


def test_the_test_vector_is_decoded_and_encoded(cam_vector: bytes) -> None:
    tree = decode_cam_tree(cam_vector)
    assert tree["header"]["stationID"] == 0xCAFE01
    high = tree["cam"]["camParameters"]["highFrequencyContainer"][1]
    assert high["heading"] == {"headingValue": 1234, "headingConfidence": 10}
    assert high["speed"]["speedValue"] == 1389
    assert encode_cam_tree(tree) == cam_vector


def test_decoding_again_leaves_earlier_values_alone(
    cam_vector: bytes, random_cam_tree: Callable[..., CamTree]
) -> None:
    first, copy = decode_cam_tree(cam_vector), decode_cam_tree(cam_vector)
    decode_cam_tree(encode_cam_tree(random_cam_tree(np.random.default_rng(0))))
    assert first == copy


def test_random_values_round_trip(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        tree = random_cam_tree(rng)
        payload = encode_cam_tree(tree)
        assert decode_cam_tree(payload) == tree
        assert encode_cam_tree(decode_cam_tree(payload)) == payload


def test_threads_do_not_interfere(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(2)
    trees = [random_cam_tree(rng) for _ in range(100)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda tree: decode_cam_tree(encode_cam_tree(tree)), trees)) == trees


def test_truncated_cams_are_refused(cam_vector: bytes) -> None:
    for length in range(len(cam_vector)):
        with pytest.raises(CamError, match=f"^{length} bytes are not a CAM"):
            decode_cam_tree(cam_vector[:length])


def test_flipped_bits_decode_to_something_or_are_refused(cam_vector: bytes) -> None:
    rng = np.random.default_rng(3)
    refused = 0
    for _ in range(2000):
        corrupt = bytearray(cam_vector)
        for at in rng.integers(8 * len(corrupt), size=rng.integers(1, 6)):
            corrupt[at // 8] ^= 128 >> at % 8
        try:
            encode_cam_tree(decode_cam_tree(bytes(corrupt)))
        except CamError:
            refused += 1
    assert 200 < refused < 1800


def test_random_bytes_never_raise_another_error() -> None:
    rng = np.random.default_rng(4)
    for length in range(300):
        with pytest.raises(CamError):
            decode_cam_tree(bytes([2, 2]) + rng.bytes(6) + bytes([0xFF]) + rng.bytes(length))


def test_bytes_after_the_end_are_refused(cam_vector: bytes) -> None:
    with pytest.raises(CamError, match="3 bytes follow a CAM of 88 bytes"):
        decode_cam_tree(cam_vector + b"abc")


@pytest.mark.parametrize(("version", "message"), [(1, 2), (2, 1), (0, 0)])
def test_other_messages_are_refused(cam_vector: bytes, version: int, message: int) -> None:
    with pytest.raises(CamError, match=f"message {message} of protocol version {version} is not a CAM"):
        decode_cam_tree(bytes([version, message]) + cam_vector[2:])


def test_extensions_of_a_later_release_are_skipped(cam_vector: bytes) -> None:
    """CamParameters with its extension bit, and one addition of two bytes behind it."""
    root = bits(cam_vector)[:673]  # 84 bytes and a bit, then padding
    extended = root[:64] + "1" + root[65:] + "0000000" + "1" + "00000010" + "0001001000110100"
    assert decode_cam_tree(packed(extended)) == decode_cam_tree(cam_vector)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("header", "stationID"), 1 << 32),
        (("cam", "generationDeltaTime"), 65_536),
        (("cam", "generationDeltaTime"), -1),
        (("cam", "generationDeltaTime"), 1.5),
        (("cam", "camParameters"), {}),
        (("cam",), None),
    ],
)
def test_values_that_are_no_cam_are_refused(cam_vector: bytes, path: tuple[str, ...], value: object) -> None:
    tree = decode_cam_tree(cam_vector)
    part = tree
    for name in path[:-1]:
        part = part[name]
    part[path[-1]] = value
    with pytest.raises(CamError, match="cannot encode these values as a CAM"):
        encode_cam_tree(tree)
