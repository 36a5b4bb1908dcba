"""The section `carla`."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario


@pytest.mark.parametrize("port", [0, 65_536, 99_999])
def test_a_port_that_is_none(port: int) -> None:
    with pytest.raises(AdvpipeError, match=rf"carla\.server: port {port} is not between 1 and 65535"):
        load_scenario("smoke", {"world": "carla", "carla.server": f"localhost:{port}"})


def test_the_highest_port() -> None:
    assert load_scenario("smoke", {"carla.server": "localhost:65535"}).carla.server == "localhost:65535"
