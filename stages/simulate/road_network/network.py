"""The road network: its edges, lanes and connections, with their geometry in the map's frame."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.map import Map
from advpipe.stages.simulate.road_network.file import prepare_network_file

CAR = "passenger"
WALKER = "pedestrian"
FAR_M = 1e5
"""Largest distance from the origin, where float32 has steps of 8 mm."""

MOST_INNER_LANES = 100
"""Largest number of inner lanes of one turn over a junction; SUMO creates at most two."""


@dataclass(frozen=True)
class Lane:
    """One lane; `centre_m` (K, 3) runs along the driving direction in the map's frame."""

    centre_m: Float64
    width_m: float
    for_cars: bool
    is_pavement: bool = False


@dataclass(frozen=True)
class Connection:
    """A connection for cars from a lane of one edge over a junction to a lane of the next edge.

    centre_m: (K, 3), its line within the junction; empty where the two edges meet without one.
    light: id of the traffic light and index in its state, if it has one.
    """

    from_lane: int
    to_edge: str
    to_lane: int
    centre_m: Float64
    light: tuple[str, int] | None


@dataclass(frozen=True)
class Edge:
    """A one-way road between two junctions; lanes from the right-hand side to the left."""

    id: str
    lanes: tuple[Lane, ...]
    length_m: float
    speed_mps: float
    for_cars: bool
    successors: tuple[str, ...]
    connections: tuple[Connection, ...] = ()

    @property
    def car_lane(self) -> int:
        """Index of the outermost lane that cars may use: pavements and cycle lanes lie outside of it."""
        return [lane.for_cars for lane in self.lanes].index(True)

    @property
    def width_m(self) -> float:
        """The total width of its lanes."""
        return sum(lane.width_m for lane in self.lanes)

    @property
    def is_true_to_length(self) -> bool:
        """Whether its lanes for cars are about as long as SUMO counts them.

        On a lane that netconvert truncated in a hairpin bend, SUMO would drive whole queues on a few metres.
        """
        lengths_m = [np.linalg.norm(np.diff(lane.centre_m, axis=0), axis=1).sum() for lane in self.lanes]
        cars = [length_m for length_m, lane in zip(lengths_m, self.lanes, strict=True) if lane.for_cars]
        return self.length_m < 5 or all(0.7 < length_m / self.length_m < 1.4 for length_m in cars)


@dataclass(frozen=True)
class RoadNetwork:
    """The file that SUMO drives on, and its geometry in the map's frame.

    The map's frame is the frame of the road map from which the network was created: map = network -
    `offset_m`. A network that is geo-referenced, or moved by more than `FAR_M`, keeps its own frame (a zero
    offset): without its offset it would be thousands of kilometres from its origin, where float32 has
    steps of half a metre.
    `map_sha256` is the digest of the user's map file, or of the generated network.
    """

    sumo_file: Path
    offset_m: Float64
    edges: dict[str, Edge]
    junctions_m: tuple[Float64, ...]
    map_sha256: str

    @property
    def drivable(self) -> list[Edge]:
        """Edges that cars may use, in a fixed order."""
        return [edge for _, edge in sorted(self.edges.items()) if edge.for_cars]

    @property
    def lanes_m(self) -> list[tuple[Float64, float]]:
        """Centre line (K, 3) and width of each lane except pavements, also over junctions, in a fixed
        order."""
        found = []
        for _, edge in sorted(self.edges.items()):
            found += [(lane.centre_m, lane.width_m) for lane in edge.lanes if not lane.is_pavement]
            found += [
                (way.centre_m, edge.lanes[way.from_lane].width_m)
                for way in edge.connections
                if len(way.centre_m) > 1
            ]
        return found

    @property
    def pavements_m(self) -> list[Float64]:
        """Centre lines (K, 3) of the lanes for pedestrians only, in a fixed order."""
        edges = [edge for _, edge in sorted(self.edges.items())]
        return [lane.centre_m for edge in edges for lane in edge.lanes if lane.is_pavement]


def endless_edges(edges: list[Edge]) -> set[str]:
    """Ids of the edges from which a vehicle can drive on for ever: each leads to another such edge."""
    endless = {edge.id for edge in edges}
    while True:
        lasting = {edge.id for edge in edges if edge.id in endless and endless & set(edge.successors)}
        if lasting == endless:
            return endless
        endless = lasting


def load_network(source: Map, scratch: Path, seed: int = 0) -> RoadNetwork:
    """Read and check the network of a scenario; converted or generated files go to the `scratch` folder.

    seed: of the scenario, for a generated network. Raises AdvpipeError for a missing or invalid map.
    """
    prepared = prepare_network_file(source, scratch, seed)
    network = _read(prepared.sumo_file, prepared.origin, prepared.map_file)
    if not network.drivable:
        raise AdvpipeError(f"{prepared.origin}: the network has no lane that cars may use")
    return network


def _read(sumo_file: Path, origin: str, map_file: Path) -> RoadNetwork:
    import sumolib

    try:
        net = sumolib.net.readNet(str(sumo_file), withInternal=True)
        offset = np.array([*net.getLocationOffset(), 0.0], dtype=np.float64)
        offset *= not net.hasGeoProj() and np.abs(offset).max() <= FAR_M
        edges = {}
        for edge in net.getEdges(withInternal=False):
            lanes = tuple(
                Lane(
                    np.array(lane.getShape3D(), dtype=np.float64) - offset,
                    float(lane.getWidth()),
                    bool(lane.allows(CAR)),
                    bool(lane.allows(WALKER) and not lane.allows(CAR)),
                )
                for lane in edge.getLanes()
            )
            successors = [next_edge for next_edge in edge.getAllowedOutgoing(CAR) if next_edge.allows(CAR)]
            edges[edge.getID()] = Edge(
                edge.getID(),
                lanes,
                float(edge.getLength()),
                float(edge.getSpeed()),
                bool(edge.allows(CAR)),
                tuple(sorted(next_edge.getID() for next_edge in successors)),
                tuple(_connections(net, edge, offset)),
            )
        junctions = tuple(
            np.array([(*point[:2], point[2] if len(point) > 2 else 0.0) for point in node.getShape3D()])
            - offset
            for node in net.getNodes()
            if len(node.getShape3D()) >= 3
        )
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as error:
        raise AdvpipeError(f"{origin}: the network cannot be read: {one_line(repr(error))}") from None
    for edge in edges.values():
        if any(np.abs(lane.centre_m).max() > FAR_M for lane in edge.lanes):
            raise AdvpipeError(
                f"{origin}: edge {edge.id!r} lies more than {FAR_M / 1000:g} km from the map's origin, where "
                "points would be rounded; move the network with netconvert --offset.x and --offset.y"
            )
    stopped = next((edge for edge in edges.values() if edge.for_cars and not edge.speed_mps > 0), None)
    if stopped is not None:
        raise AdvpipeError(
            f"{origin}: edge {stopped.id!r} is for cars, but its speed is {stopped.speed_mps:g}"
        )
    digest = hashlib.sha256(map_file.read_bytes()).hexdigest()
    return RoadNetwork(sumo_file, offset, edges, junctions, digest)


def _connections(net: Any, edge: Any, offset: Float64) -> Iterator[Connection]:
    for lane in edge.getLanes():
        for link in lane.getOutgoing():
            to_lane = link.getToLane()
            if not (lane.allows(CAR) and to_lane.allows(CAR)):
                continue
            pieces: list[Float64] = []
            via = link.getViaLaneID()
            while via:  # a turn that waits inside the junction has two lanes in it
                if len(pieces) == MOST_INNER_LANES:
                    raise ValueError(f"the way over the junction from lane {lane.getID()!r} never ends")
                inner = net.getLane(via)
                pieces.append(np.array(inner.getShape3D(), dtype=np.float64) - offset)
                via = next((onward.getViaLaneID() for onward in inner.getOutgoing()), "")
            light = (link.getTLSID(), int(link.getTLLinkIndex())) if link.getTLSID() else None
            yield Connection(
                int(lane.getIndex()),
                str(to_lane.getEdge().getID()),
                int(to_lane.getIndex()),
                np.concatenate(pieces) if pieces else np.empty((0, 3)),
                light,
            )
