"""Road users as actors of a stand-in server, by the genuine client."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.carla import Carla
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.carla.blueprints import Blueprints
from advpipe.stages.simulate.world.carla.client import connect
from advpipe.stages.simulate.world.carla.mirror import Mirror
from advpipe.stages.simulate.world.carla.session import Session

pytestmark = pytest.mark.oracle

VARIANTS = draw_variants(np.random.default_rng(5))


def user(name: str, body: str, x_m: float, y_m: float, speed_mps: float = 8.0, **more: Any) -> RoadUser:
    pose = se3_from_yaw([x_m, y_m, 0.0], 0.5)
    return RoadUser(name, VARIANTS[f"{body}.0"], pose, pose[:3, 0] * speed_mps, **more)


@pytest.fixture
def session(server: Any) -> Iterator[tuple[Any, Session]]:
    client = connect(Carla(server=server.address, timeout_s=5))
    opened = Session(client, client.get_world(), 0.1)
    opened.begin()
    yield client, opened
    opened.end()


def measured(client: Any, session: Session, variants: list[Variant], **given: str) -> Blueprints:
    blueprints = Blueprints(session.world.get_blueprint_library(), given)
    blueprints.measure(client, session, variants)
    return blueprints


def test_a_road_user_comes_moves_shines_and_goes(server: Any, session: tuple[Any, Session]) -> None:
    client, opened = session
    mirror = Mirror(client, measured(client, opened, list(VARIANTS.values())), 0.1)
    turning = ExteriorLights.LEFT_TURN_SIGNAL
    mirror.update([user("a", "sedan", 10, 5), user("b", "bus", 40, 5), user("c", "child", 5, 20, 1.0)])
    opened.tick()
    mirror.update([user("a", "sedan", 11, 5, 7.0, lights=turning), user("c", "child", 5, 21, 1.0)])
    snapshot = opened.tick()
    assert mirror.actors.keys() == {"a", "c"}
    assert len(server.bodies()) == 2
    assert "vehicle.standin.bus" not in " ".join(server.bodies())
    for name, place in (("a", (11, -5)), ("c", (5, -21))):
        state = snapshot.find(mirror.actors[name])
        where = state.get_transform().location
        assert (where.x, where.y) == pytest.approx(place, abs=1e-4)
        assert state.get_velocity().length() == 0  # SUMO's counts: CARLA knows none
        assert state.get_transform().rotation.yaw == pytest.approx(-np.rad2deg(0.5), abs=1e-3)
    assert server.state["lamps"]["advpipe a"] == 32 | 8  # it turns to the left, and brakes
    mirror.remove_all()
    assert server.bodies() == []


def test_blueprints_by_class_and_size(
    session: tuple[Any, Session], capsys: pytest.CaptureFixture[str]
) -> None:
    client, opened = session
    wanted = [VARIANTS["sedan.0"], VARIANTS["bicycle.0"]]
    given = {"suv": "vehicle.standin.pickup_1"}
    blueprints = measured(client, opened, wanted, **given)
    for name in ("sedan.0", "bicycle.0"):
        chosen = blueprints.choose(VARIANTS[name])
        assert chosen is not None
        one = VARIANTS[name]
        apart_m = blueprints.box(chosen).sizes_m - (one.length_m, one.width_m, one.height_m)
        assert np.abs(apart_m).max() < 0.2
    assert blueprints.choose(VARIANTS["suv.0"]) == "vehicle.standin.pickup_1"
    assert blueprints.choose(VARIANTS["child.0"]) is None  # not measured, as if the server had no people
    assert blueprints.choose(VARIANTS["child.1"]) is None
    assert capsys.readouterr().err == (
        "CARLA has no blueprint for the body child, so such road users are not seen; name one with "
        "carla.blueprints.child\n"
    )


@pytest.mark.nightly
def test_traffic_managers_port_in_use(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("0.0.0.0", 0))
        taken.listen()
        port = taken.getsockname()[1]
        keys = {"world": "carla", "carla.server": server.address, "vehicles.ego.driver": "carla"}
        keys["carla.traffic_manager_port"] = port
        with pytest.raises(AdvpipeError, match=f"Traffic Manager cannot use port {port} .* to a free one"):
            simulate(load_scenario(scenario_file, keys), tmp_path / "out")
    assert server.state["synchronous"] is False
    assert server.bodies() == []
