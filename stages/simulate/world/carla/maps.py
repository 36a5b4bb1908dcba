"""CARLA's map of a drive: one of its own, or a world that it generates from the scenario's road network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_network.file import last_error, run_sumo
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import resample
from advpipe.stages.simulate.world.carla.poses import vector_of

GENERATED = "OpenDriveMap"
"""CARLA's name of a generated world."""

LOADING_TIMEOUT_S = 300.0
SAMPLE_M = 2.0
MEDIAN_M, NEAR_M, NEAR_SHARE = 0.5, 2.0, 0.9
"""A map fits if half of the samples lie this near to a lane of the other one, and that share within 2 m."""

_HEADER = re.compile(r"(<header\b[^>]*?)/>")
_DATE = re.compile(r'\bdate="[^"]*"')
_COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def load_map(client: Any, scenario: Scenario, network: RoadNetwork) -> Any:
    """The `carla.World` of a drive. A map that is loaded already is kept, with the actors on it.

    Raises UsageError for a map that the server lacks, or that does not fit SUMO's network.
    """
    import carla

    world = client.get_world()
    available = sorted({name.rpartition("/")[2] for name in client.get_available_maps()} - {GENERATED})
    wanted = _named_map(scenario, available)
    client.set_timeout(max(LOADING_TIMEOUT_S, scenario.carla.timeout_s))
    if wanted is not None:
        if _name(world) != wanted:
            world = client.load_world(wanted)
    else:
        text = opendrive_text(scenario, network)
        if _name(world) != GENERATED or world.get_map().to_opendrive() != text:
            parameters = carla.OpendriveGenerationParameters(wall_height=0.0)
            world = client.generate_opendrive_world(text, parameters)
    client.set_timeout(scenario.carla.timeout_s)
    check_fit(world.get_map(), network)
    return world


def opendrive_text(scenario: Scenario, network: RoadNetwork) -> str:
    """The OpenDRIVE map of a scenario, converted from SUMO's network if it has none; always the same text.

    Raises AdvpipeError if netconvert cannot convert it.
    """
    if scenario.map.opendrive is not None:
        return Path(scenario.map.opendrive).read_text(encoding="utf-8")
    with scratch_folder() as scratch:
        out = scratch / "map.xodr"
        move = (f"--offset.{axis}={-by_m}" for axis, by_m in zip("xy", network.offset_m[:2], strict=True))
        options = ["--sumo-net-file", str(network.sumo_file), "--opendrive-output", str(out), *move]
        done = run_sumo("netconvert", [*options, "--offset.disable-normalization", "true"], "world carla")
        if done.returncode != 0 or not out.is_file():
            raise AdvpipeError(f"netconvert cannot make an OpenDRIVE map for CARLA: {last_error(done)}")
        text = out.read_text(encoding="utf-8")
    reference = _reference(scenario.map.origin)
    return _HEADER.sub(rf"\1>{reference}</header>", _DATE.sub('date=""', _COMMENT.sub("", text)), count=1)


def check_fit(carla_map: Any, network: RoadNetwork) -> None:
    """Sample the lanes for cars of both maps; raise UsageError where they are not in the same places."""
    waypoints = carla_map.generate_waypoints(SAMPLE_M)
    theirs = np.array([vector_of(point.transform.location) for point in waypoints]).reshape(-1, 3)
    lanes = [lane.centre_m for edge in network.drivable for lane in edge.lanes if lane.for_cars]
    inner = [way.centre_m for edge in network.drivable for way in edge.connections if len(way.centre_m) > 1]
    ours = np.concatenate([resample(lane, SAMPLE_M) for lane in lanes])
    all_ours = np.concatenate([resample(lane, SAMPLE_M / 4) for lane in (*lanes, *inner)])
    if len(theirs) < 2 or not (_is_near(theirs, all_ours) and _is_near(ours, theirs, SAMPLE_M / 2)):
        raise UsageError(
            f"CARLA's map {carla_map.name.rpartition('/')[2]} does not fit the scenario's road network: "
            "their lanes are in different places; set carla.map to the map of that network, or leave it out"
        )


def _is_near(places_m: Float64, lanes_m: Float64, gap_m: float = 0.0) -> bool:
    """Whether places (N, 3) lie on lanes given by points (K, 3) that are up to `gap_m` away along them."""
    away_m, _ = cKDTree(lanes_m[:, :2]).query(places_m[:, :2])
    return bool(np.median(away_m) <= MEDIAN_M + gap_m and (away_m <= NEAR_M + gap_m).mean() >= NEAR_SHARE)


def _named_map(scenario: Scenario, available: list[str]) -> str | None:
    """The server's map that the scenario names, by `carla.map` or by the name of its OpenDRIVE file."""
    name = scenario.carla.map
    if name is not None and name not in available:
        raise UsageError(
            f"carla.map {name!r} is not a map of the server at {scenario.carla.server}; "
            f"{known_names(name, available)}"
        )
    if name is None and scenario.map.opendrive is not None:
        stem = Path(scenario.map.opendrive).stem
        name = stem if stem in available else None
    return name


def _name(world: Any) -> str:
    return str(world.get_map().name).rpartition("/")[2]


def _reference(origin: GeoOrigin) -> str:
    projection = (
        f"+proj=tmerc +lat_0={origin.latitude_deg!r} +lon_0={origin.longitude_deg!r} +k=1 +x_0=0 +y_0=0"
    )
    return f"<geoReference><![CDATA[{projection} +datum=WGS84]]></geoReference>"
