"""Sources of traffic by name, and one of a newcomer's, written from the protocol's docstring alone."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.topics import V2X_SENT
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.simulate.run import simulate

TWO_CARS = """
import numpy as np
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.road_users import RoadUser


class TwoCars(TrafficSource):
    def __init__(self, scenario, network, variants, scratch):
        self.step_s = scenario.simulation.step_s
        self.line = max(network.drivable, key=lambda edge: edge.length_m).lanes[0].centre_m
        self.variant, self.guests, self.next_guests, self.steps = variants["sedan.0"], {}, {}, -1

    def step(self):
        self.steps += 1
        self.guests, self.next_guests = self.next_guests, {}

    def road_users(self):
        velocity = 10 * (self.line[1] - self.line[0]) / np.linalg.norm(self.line[1] - self.line[0])
        users = {}
        for name, ahead_m in (("ego", 0.0), ("leader", 15.0)):
            place = self.line[0] + velocity * (self.steps * self.step_s + ahead_m / 10)
            pose = se3_from_yaw(place, np.arctan2(velocity[1], velocity[0]))
            users[name] = RoadUser(name, self.variant, pose, velocity, ExteriorLights.LOW_BEAM)
        return {**users, **self.guests}

    def route_m(self, name):
        return self.line

    def push(self, users, upcoming=()):
        self.next_guests |= {user.id: user for user in users}


class Half(TrafficSource):
    def step(self):
        pass


class Wrong:
    def step(self):
        pass


class Breaks(TwoCars):
    def step(self):
        raise ValueError("no\\nfuel")


SOME = 3
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The newcomer's file in the working folder."""
    (tmp_path / "own_cars.py").write_text(TWO_CARS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    sys.modules.pop("own_cars", None)


def test_a_users_traffic_source_records_a_whole_drive(tmp_path: Path, own: None) -> None:
    simulate(load_scenario("smoke", ["traffic.source=own_cars:TwoCars"]), tmp_path / "out")
    frames = list(read_frames(tmp_path / "out" / "clean"))
    assert len(frames) == 10
    for frame in frames:
        leader = list(frame.boxes.ids).index("leader")
        assert np.linalg.norm(frame.boxes.geometry[leader, :2]) == pytest.approx(15, abs=0.1)
    sent = [cam_of(message) for _, message in BagReader(tmp_path / "out" / "clean").messages(V2X_SENT.name)]
    lights = {cam.low_frequency.exterior_lights for cam in sent if cam.low_frequency is not None}
    assert lights == {ExteriorLights.LOW_BEAM}


def cam_of(message: Any) -> Cam:
    return decode_cam(bytes(message.payload))


BAD = {
    "cars": r"^traffic\.source \W?cars\W? is unknown; known: sumo, trajectories \(or your own module:Class\)",
    "own_cars:Absent": r"^traffic\.source own_cars:Absent cannot be loaded: AttributeError: .*Absent",
    "nowhere:Source": r"^traffic\.source nowhere:Source cannot be loaded: ModuleNotFoundError: .*nowhere",
    "own_cars:Wrong": r"^traffic\.source own_cars:Wrong is not a traffic source: .*protocol\.py$",
    "own_cars:SOME": r"^traffic\.source own_cars:SOME is not a class$",
    "own_cars:Half": r"own_cars:Half failed: TypeError: .*abstract.* push, .*; fix it$",
}


BARE = ("environment.buildings=0", "traffic.parked_per_km=0", "simulation.warmup_s=1")
"""Little to make before the source is asked."""


@pytest.mark.parametrize(("name", "message"), BAD.items(), ids=BAD)
def test_an_invalid_traffic_source_is_a_one_line_error(
    tmp_path: Path, own: None, name: str, message: str
) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        simulate(load_scenario("smoke", [f"traffic.source={name}", *BARE]), tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_an_error_in_a_users_source_names_its_place(tmp_path: Path, own: None) -> None:
    with pytest.raises(AdvpipeError, match=r"own_cars:Breaks failed: ValueError: no.*own_cars\.py, line \d+"):
        simulate(load_scenario("smoke", ["traffic.source=own_cars:Breaks", *BARE]), tmp_path / "out")
