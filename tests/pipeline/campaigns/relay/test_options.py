"""Between whom a relay stands."""

from typing import Any

import pytest

from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import use_flags


@pytest.mark.parametrize("prefix", ["attacked", "/attacked", "attacked/"[:-1]])
def test_names(prefix: str) -> None:
    options = RelayOptions(ros2=True, domain=3, prefix=prefix)
    assert options.published_name("/ego/gnss/fix") == "/attacked/ego/gnss/fix"


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"ros2": False, "domain": 1}, "name the graph to relay in; give --ros2"),
        ({}, "name the DDS domain with --domain: what a relay publishes may deceive running vehicles"),
        ({"domain": 233}, "--domain is 233, but must be from 0 to 232"),
        ({"domain": 1, "prefix": ""}, "--prefix '' is no ROS 2 name"),
        ({"domain": 1, "prefix": "a b"}, "--prefix 'a b' is no ROS 2 name"),
        ({"domain": 1, "duration_s": 0.0}, "--duration is 0, but must be above 0"),
    ],
)
def test_refusals(given: dict[str, Any], line: str) -> None:
    with use_flags(), pytest.raises(UsageError) as found:
        RelayOptions(**{"ros2": True, **given})
    assert str(found.value).startswith(line)
