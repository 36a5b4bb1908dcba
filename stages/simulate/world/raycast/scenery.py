"""Roadside scenery drawn from the seed: streets of houses and gardens, furniture, trees, and fast roads'."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import cKDTree

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.scenario.environment import UserObject
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import KERB_M, Roads
from advpipe.stages.simulate.world.raycast import furniture
from advpipe.stages.simulate.world.raycast.estates import Estates
from advpipe.stages.simulate.world.raycast.markings import has_signal
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.occupied import Occupied, pavements
from advpipe.stages.simulate.world.raycast.parcels import parcels_along
from advpipe.stages.simulate.world.raycast.plots import Plot
from advpipe.stages.simulate.world.raycast.roadsides import build_roadsides
from advpipe.stages.simulate.world.raycast.site import Site
from advpipe.stages.simulate.world.raycast.templates import Plants
from advpipe.stages.simulate.world.raycast.terrain import Terrain
from advpipe.stages.simulate.world.raycast.user_mesh import load_mesh
from advpipe.stages.simulate.world.raycast.verge_items import build_verges
from advpipe.stages.simulate.world.raycast.wires import hang_wires

TOWN_MPS = 15.0
"""Beside faster streets, houses are few."""

Generators = Callable[[str], np.random.Generator]
"""The generator of a use."""


def build_scenery(
    scenario: Scenario,
    network: RoadNetwork,
    roads: Roads,
    terrain: Terrain,
    occupied: Occupied,
    generator: Generators,
) -> tuple[Mesh, list[shapely.Polygon]]:
    """All that stands beside the roads, as one mesh; outlines of the houses.

    Raises AdvpipeError for an unusable mesh of the user.
    """
    environment = scenario.environment
    site = Site(terrain, occupied, Occupied(roads, 0.2, pavements(roads)))
    site.meshes.extend(_object(index, given, terrain) for index, given in enumerate(environment.objects))
    _signals(network, site, generator("signals"))
    plants = Plants(generator("plants"))
    hang_wires(site, roads.kerbs_m, environment.wires, generator("wires"))
    estates = Estates(site, environment, plants, generator("estates"))
    speed_mps = _speeds(network)
    for parcels in parcels_along(roads.kerbs_m, generator("parcels")):
        if parcels:
            estates.fill(parcels, rural=speed_mps(parcels[len(parcels) // 2].front_m) > TOWN_MPS)
    build_verges(site, roads.kerbs_m, environment, plants, generator("verges"))
    build_roadsides(site, roads.verges_m, environment, plants, generator("roadsides"))
    return merge(site.meshes), site.footprints


def _object(index: int, given: UserObject, terrain: Terrain) -> Mesh:
    mesh = load_mesh(given.mesh, f"environment.objects.{index}", given.material, given.scale)
    ground_m = float(terrain.at(np.array([[given.x_m, given.y_m]]))[0])
    return mesh.transformed(se3_from_yaw((given.x_m, given.y_m, ground_m + given.z_m), given.yaw_rad))


def _speeds(network: RoadNetwork) -> Callable[[Float64], float]:
    """The speed limit in m/s of the lane nearest to a place."""
    lanes = [(lane.centre_m, edge.speed_mps) for edge in network.drivable for lane in edge.lanes]
    tree = cKDTree(np.concatenate([centre_m[:, :2] for centre_m, _ in lanes]))
    limits = np.repeat([limit for _, limit in lanes], [len(centre_m) for centre_m, _ in lanes])
    return lambda place_m: float(limits[tree.query(place_m[:2])[1]])


def _signals(network: RoadNetwork, site: Site, rng: np.random.Generator) -> None:
    """A signal to the right of every stop line."""
    for edge in filter(has_signal, network.drivable):
        lane = edge.lanes[0]
        step = lane.centre_m[-1] - lane.centre_m[-2]
        plot = Plot(lane.centre_m[-1], float(np.arctan2(step[1], step[0])))
        for aside_m in (0.7, 1.4, 2.4):
            pose = plot.at(lane.width_m / 2 + aside_m, KERB_M)
            if site.place(furniture.traffic_light(rng), pose, 0.4, 0.4):
                break
