"""A stand-in for a CARLA 0.9.16 server, as a process of its own: `python standin SCENARIO [FAULTS]`.

It has the world of a scenario of advpipe's, so that the same rays hit the same surfaces. FAULTS is JSON, see
`Episode`. CARLA's client holds the interpreter's lock while it connects, so a thread would not do.
"""

from __future__ import annotations

import asyncio
import json
import math
import sys
import tempfile
from pathlib import Path

from episode import Episode
from library import Library
from protocol import RemoteCalls

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.road_network.network import RoadNetwork, load_network
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

EMPTY = '<OpenDRIVE><header revMajor="1" revMinor="4"><geoReference>+proj=tmerc +lat_0=0 +lon_0=0' + (
    "</geoReference></header></OpenDRIVE>"
)


async def serve(episode: Episode, port: int) -> None:
    await episode.streams.open()
    handlers = {
        name: getattr(episode, name)
        for name in dir(type(episode))
        if not name.startswith("_") and callable(getattr(type(episode), name)) and name != "advance"
    }
    print(f"port {await RemoteCalls('127.0.0.1', handlers).open(port)}", flush=True)
    while True:
        await asyncio.sleep(0.02)
        if not episode.is_synchronous:
            episode.advance()


def spawn_points(network: RoadNetwork) -> list[list[list[float]]]:
    """Places with directions in the middle of each lane for cars, left-handed, as CARLA's maps have them."""
    places = []
    for edge in network.drivable:
        for lane in (lane for lane in edge.lanes if lane.for_cars):
            middle = len(lane.centre_m) // 2
            here, before = lane.centre_m[middle], lane.centre_m[middle - 1]
            ahead = here - before
            yaw_deg = -math.degrees(math.atan2(ahead[1], ahead[0]))
            place = (here + before) / 2
            places.append([[float(place[0]), -float(place[1]), float(place[2])], [0.0, yaw_deg, 0.0]])
    return places


def main(scenario_file: str, faults_json: str = "{}") -> None:
    faults = json.loads(faults_json)
    scenario = load_scenario(scenario_file, faults.get("settings", []))
    variants = draw_variants(named_generator(scenario.simulation.seed, "bodies"), scenario.bodies)
    with tempfile.TemporaryDirectory() as scratch:
        network = load_network(scenario.map, Path(scratch), scenario.simulation.seed)
        world = RaycastWorld(scenario, network, variants)
    maps = {name: Path(path).read_text() for name, path in faults.get("maps", {}).items()}
    maps = {"Town10HD": EMPTY, **maps}
    episode = Episode(Library(variants), maps, world, scenario, spawn_points(network), faults)
    asyncio.run(serve(episode, int(faults.get("port", 0))))


if __name__ == "__main__":
    main(*sys.argv[1:])
