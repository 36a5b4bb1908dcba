import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice


@pytest.mark.parametrize("text", ["0:10:3", ":", "::", "2:", ":7", "::4", "3:100:2"])
def test_indices_equal_those_of_python_slices(text: str) -> None:
    parts = [int(part) if part else None for part in text.split(":")]
    assert list(FrameSlice.parse(text).indices(10)) == list(range(10))[slice(*parts)]


def test_a_number_selects_one_frame() -> None:
    assert list(FrameSlice.parse("7").indices(10)) == [7]


@pytest.mark.parametrize("text", ["", "a", "-1:", "1:2:3:4", "::0", "1.5:", "²", "1 : 2"])
def test_invalid_texts_are_refused(text: str) -> None:
    with pytest.raises(AdvpipeError, match="frames"):
        FrameSlice.parse(text)


def test_a_selection_without_frames_is_refused() -> None:
    with pytest.raises(
        AdvpipeError, match=r"frames 5:5:1 select none of the bag's 10 frames; choose from 0 to 9$"
    ):
        FrameSlice.parse("5:5").indices(10)


@pytest.mark.parametrize("text", ["0:10:3", "2::1", "0::1"])
def test_text_round_trip(text: str) -> None:
    assert str(FrameSlice.parse(text)) == text
    assert str(ALL_FRAMES) == "0::1"
