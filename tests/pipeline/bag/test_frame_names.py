"""Names of frames: the source's where all of them can name files, else the place in the bag."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import CLOCK, SOURCE_FRAME
from advpipe.pipeline.messages.types import message_class, serialise

STEP_NS = 100_000_000


def bag_with(folder: Path, names: list[str], unnamed: int = 0) -> Path:
    """A bag of frames with these names, and of some without."""
    with BagWriter(folder, provenance={"kind": "clean"}) as writer:
        for k, name in enumerate([*names, *[None] * unnamed], 1):
            writer.write_cdr(CLOCK, serialise(build.clock(k * STEP_NS), CLOCK.type), k * STEP_NS)
            if name is not None:
                message = message_class(SOURCE_FRAME.type)(data=name)
                writer.write_cdr(SOURCE_FRAME, serialise(message, SOURCE_FRAME.type), k * STEP_NS)
    return folder


def in_order(bag: Path, count: int = 2, **options: bool) -> list[str]:
    names = read_frame_names(bag, **options)
    return [names.of((k + 1) * STEP_NS, k) for k in range(count)]


@pytest.mark.parametrize(
    ("names", "options", "expected"),
    [
        (["000008", "000134"], {}, ["000008", "000134"]),
        (["b", "a"], {}, ["b", "a"]),
        (["b", "a"], {"is_ordered": True}, ["000000", "000001"]),
        (["a", "A"], {}, ["000000", "000001"]),
        (["a", "a"], {}, ["000000", "000001"]),
        (["a", "../a"], {}, ["000000", "000001"]),
        (["a", ".a"], {}, ["000000", "000001"]),
        (["a", "x" * 101], {}, ["000000", "000001"]),
        (["a", "b"], {"as_numbers": True}, ["000000", "000001"]),
        (["0000000005", "7"], {"as_numbers": True}, ["000005", "000007"]),
        (["5", "05"], {"as_numbers": True}, ["000000", "000001"]),
        (["5", "1000000"], {"as_numbers": True}, ["000000", "000001"]),
    ],
)
def test_names_that_can_name_files(names, options, expected, tmp_path):
    assert in_order(bag_with(tmp_path / "bag", names), **options) == expected


def test_a_frame_without_a_name(tmp_path):
    assert in_order(bag_with(tmp_path / "bag", ["a"], unnamed=1)) == ["000000", "000001"]
    assert in_order(bag_with(tmp_path / "other", [], unnamed=2)) == ["000000", "000001"]
