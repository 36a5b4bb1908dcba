"""Which frames defences are scored on."""

import pytest

from advpipe.stages.evaluate.detection.defence_run import evenly_spread


@pytest.mark.parametrize(
    ("frames", "most", "chosen"),
    [
        (range(0, 100, 10), 3, {10, 50, 80}),
        (range(5), 1, {2}),
        (range(4), 9, {0, 1, 2, 3}),
        ([3, 4, 9], 2, {3, 9}),
        (range(0), 2, set()),
    ],
)
def test_evenly_spread(frames, most, chosen):
    assert evenly_spread(frames, most) == chosen
