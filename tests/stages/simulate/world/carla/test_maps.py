"""Maps for CARLA, read by the client's own parser of OpenDRIVE."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.road_network.network import RoadNetwork, load_network
from advpipe.stages.simulate.world.carla.maps import check_fit, opendrive_text
from advpipe.stages.simulate.world.carla.positioning import GnssProjection

carla = pytest.importorskip("carla")
pytestmark = pytest.mark.oracle


@pytest.fixture(scope="module")
def network(scenario_file: Path, tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    return load_network(load_scenario(scenario_file).map, tmp_path_factory.mktemp("network"), 3)


@pytest.fixture(scope="module")
def text(scenario_file: Path, network: RoadNetwork) -> str:
    return opendrive_text(load_scenario(scenario_file), network)


@pytest.fixture(scope="module")
def carla_map(text: str) -> Any:
    return carla.Map("Carla/Maps/OpenDriveMap", text)


def moved(network: RoadNetwork, by_m: tuple[float, float, float]) -> RoadNetwork:
    edges = {
        name: replace(
            edge,
            lanes=tuple(replace(lane, centre_m=lane.centre_m + by_m) for lane in edge.lanes),
            connections=tuple(
                replace(way, centre_m=way.centre_m + by_m if len(way.centre_m) else way.centre_m)
                for way in edge.connections
            ),
        )
        for name, edge in network.edges.items()
    }
    return replace(network, edges=edges)


def test_the_converted_map_fits_its_network(carla_map: Any, network: RoadNetwork) -> None:
    check_fit(carla_map, network)


@pytest.mark.parametrize("by_m", [(60.0, 20.0, 0.0), (0.0, 8.0, 0.0), (1.6, 1.6, 0.0)])
def test_a_map_elsewhere_does_not_fit(
    carla_map: Any, network: RoadNetwork, by_m: tuple[float, float, float]
) -> None:
    with pytest.raises(UsageError, match="CARLA's map OpenDriveMap does not fit the scenario's road network"):
        check_fit(carla_map, moved(network, by_m))


def test_the_text_is_always_the_same(scenario_file: Path, network: RoadNetwork, text: str) -> None:
    """netconvert writes the date into it, and a map that is loaded already is recognised by its text."""
    assert opendrive_text(load_scenario(scenario_file), network) == text
    assert "2026" not in text
    assert "lat_0=48.1351" in text


class Reading:
    """What a GNSS of CARLA's at a place reports; y to the right."""

    def __init__(self, carla_map: Any, x: float, y: float, z: float, sign: int) -> None:
        found = carla_map.transform_to_geolocation(carla.Location(x, sign * y, z))
        self.latitude, self.longitude, self.altitude = found.latitude, found.longitude, found.altitude
        self.transform = carla.Transform(carla.Location(x, y, z))


@pytest.mark.parametrize("sign", [1, -1])
def test_geographic_positions_become_places_whichever_way_latitude_grows(carla_map: Any, sign: int) -> None:
    projection = GnssProjection(carla_map)
    for x, y, z in ((3.0, 0.5, 0.0), (80.0, -60.0, 1.5), (-40.0, 30.0, 0.0)):
        position_m = projection.position_m(Reading(carla_map, x, y, z, sign))
        assert position_m == pytest.approx(np.array([x, -y, z]), abs=1e-3)


def test_a_gnss_that_does_not_fit_its_map_is_not_used(
    carla_map: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    projection = GnssProjection(carla_map)
    reading = Reading(carla_map, 80.0, -60.0, 1.5, 1)
    reading.latitude += 0.01
    assert projection.position_m(reading) is None
    assert projection.position_m(reading) is None
    assert capsys.readouterr().err.count("true positions are measured instead") == 1
