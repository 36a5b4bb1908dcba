"""The network for Artery's stations, which ask SUMO where on the Earth they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sumolib

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.network.artery.georeference import georeferenced
from advpipe.stages.simulate.road_network.network import load_network


def test_sumo_converts_places_as_we_do(tmp_path: Path) -> None:
    scenario = load_scenario("smoke", ["map.origin={latitude_deg: 59.3, longitude_deg: 18.1}"])
    roads = load_network(scenario.map, tmp_path, scenario.simulation.seed)
    copy = georeferenced(roads, scenario.map.origin, tmp_path)
    net = sumolib.net.readNet(str(copy.sumo_file))
    origin = scenario.map.origin
    geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
    for place_m in ((0.0, 0.0), (350.5, -120.25)):
        east, north = np.array(place_m) + roads.offset_m[:2]
        longitude_deg, latitude_deg = net.convertXY2LonLat(east, north)
        expected = geodesy.to_geographic((*place_m, 0.0))
        assert (latitude_deg, longitude_deg) == pytest.approx(tuple(expected[:2]), abs=1e-9)
    before = roads.sumo_file.read_text(encoding="utf-8").splitlines()
    after = copy.sumo_file.read_text(encoding="utf-8").splitlines()
    assert [line for line in before if "<location" not in line] == [
        line for line in after if "<location" not in line
    ]
