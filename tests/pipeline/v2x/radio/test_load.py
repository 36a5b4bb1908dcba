"""The channel busy ratio equals the union of what each station hears, counted nanosecond by nanosecond."""

from itertools import pairwise

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.load import WINDOW_NS, busy_ratio

STATIONS = 7
END_NS = 5 * WINDOW_NS


def frames(rng: np.random.Generator, count: int, longest_ns: int) -> list[RadioFrame]:
    found = []
    for start_ns in np.sort(rng.integers(END_NS - WINDOW_NS - longest_ns, END_NS, count)).tolist():
        lasts_ns, nothing = int(rng.integers(1, longest_ns)), np.zeros(STATIONS)
        frame = RadioFrame(0, 0, 0, 0, 0, lasts_ns, 0, 0, nothing, nothing, rng.random(STATIONS) < 0.6)
        frame.send(start_ns)
        found.append(frame)
    return [frame for frame in found if frame.end_ns > END_NS - WINDOW_NS]


def counted(sent: list[RadioFrame]) -> np.ndarray:
    """The same, slowly: from edge to edge, whether any message is heard."""
    window_ns = END_NS - WINDOW_NS
    edges_ns = {window_ns, END_NS, *(edge for frame in sent for edge in (frame.start_ns, frame.end_ns))}
    inside_ns = sorted(edge for edge in edges_ns if window_ns <= edge <= END_NS)
    busy_ns = np.zeros(STATIONS)
    for begin_ns, end_ns in pairwise(inside_ns):
        on_air = [frame.hearing for frame in sent if frame.start_ns <= begin_ns < frame.end_ns]
        busy_ns += (end_ns - begin_ns) * np.any(on_air or [np.zeros(STATIONS, bool)], axis=0)
    return busy_ns / WINDOW_NS


@pytest.mark.parametrize(
    ("count", "longest_ns"),
    [(1, 2_000_000), (20, 100_000), (20, 2_000_000), (60, 5_000_000), (40, 40_000_000)],
    ids=["one", "apart", "some overlap", "most overlap", "across the window"],
)
def test_the_busy_ratio_is_the_union_of_what_is_heard(count: int, longest_ns: int) -> None:
    for seed in range(20):
        sent = frames(np.random.default_rng(seed), count, longest_ns)
        np.testing.assert_array_equal(busy_ratio(sent, STATIONS, END_NS), counted(sent))


def test_nothing_on_the_air_is_a_free_channel() -> None:
    assert busy_ratio([], STATIONS, END_NS).tolist() == [0.0] * STATIONS
