import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice


@pytest.mark.parametrize("text", ["0:10:3", ":", "::", "2:", ":7", "::4", "3:100:2"])
def test_indices_are_those_of_python(text: str) -> None:
    parts = [int(part) if part else None for part in text.split(":")]
    assert list(FrameSlice.parse(text).indices(10)) == list(range(10))[slice(*parts)]


def test_one_frame() -> None:
    assert list(FrameSlice.parse("7").indices(10)) == [7]


@pytest.mark.parametrize("text", ["", "a", "-1:", "1:2:3:4", "::0", "1.5:", "²", "1 : 2"])
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(AdvpipeError, match="frames"):
        FrameSlice.parse(text)


def test_no_frames() -> None:
    with pytest.raises(
        AdvpipeError, match=r"frames 5:5:1 select none of the bag's 10 frames; choose from 0 to 9$"
    ):
        FrameSlice.parse("5:5").indices(10)


@pytest.mark.parametrize("text", ["0:10:3", "2::1", "0::1"])
def test_text_and_back(text: str) -> None:
    assert str(FrameSlice.parse(text)) == text
    assert str(ALL_FRAMES) == "0::1"
