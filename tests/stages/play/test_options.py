"""What can be asked for."""

import math

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.play.options import PlayOptions


def test_topics_by_name_and_pattern() -> None:
    options = PlayOptions(ros2=True, topics=("/ego/*", "/tf"))
    assert options.chooses("/ego/lidar/points")
    assert options.chooses("/tf")
    assert not options.chooses("/tf_static")
    assert PlayOptions(ros2=True).chooses("/anything")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"ros2": False}, "nobody would see the bag"),
        ({"rate": 0.0}, "rate is 0, but must be from 0.001 to 100"),
        ({"rate": math.nan}, "rate is nan"),
        ({"start_s": -1.0}, "start_s is -1, but must be from 0 on"),
        ({"start_s": math.inf}, "start_s is inf"),
        ({"delay_s": 1e9}, "delay_s is 1e\\+09"),
        ({"clock_hz": -1.0}, "clock_hz is -1"),
        ({"port": 65536}, "port is 65536"),
        ({"domain": 233}, "domain is 233"),
    ],
)
def test_refusals(values: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        PlayOptions(**{"ros2": True, **values})  # type: ignore[arg-type]
