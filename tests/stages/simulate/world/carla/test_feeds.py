"""What a server lacks of a sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario.carla import Carla
from advpipe.stages.simulate.world.carla.client import connect
from advpipe.stages.simulate.world.carla.feeds import Feed

pytestmark = pytest.mark.oracle


@pytest.mark.parametrize(
    ("blueprint", "message"),
    [
        ("sensor.camera.rt_lens", r"the server has no sensor\.camera\.rt_lens, which front needs"),
        ("sensor.camera.depth", r"CARLA's sensor\.camera\.depth has no attribute iso, which front needs"),
    ],
)
def test_what_the_server_lacks_is_named(server: Any, blueprint: str, message: str) -> None:
    world = connect(Carla(server=server.address, timeout_s=20)).get_world()
    with pytest.raises(UsageError, match=message):
        Feed(world, None, "front", blueprint, {"iso": 100.0}, np.eye(4))
