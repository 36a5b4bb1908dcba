"""Routes over the network: random walks that follow lanes, and routes that a user wrote, checked."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.road_network.network import Connection, Edge, RoadNetwork, endless_edges

LANE_CHANGE_S = 9.0
"""A random walk moves over by one lane at most for each such time on an edge."""


class Routes:
    """Draws where vehicles start and go on one network."""

    def __init__(self, network: RoadNetwork, rng: np.random.Generator) -> None:
        self._network = network
        self._rng = rng
        self._edges = [edge for edge in network.drivable if edge.is_true_to_length] or network.drivable
        lengths_m = np.array([edge.length_m * len(edge.lanes) for edge in self._edges])
        self._shares = lengths_m / lengths_m.sum()
        self._endless = endless_edges(self._edges)

    def random_start(self) -> Edge:
        """An edge, by its length and number of lanes."""
        return self._edges[int(self._rng.choice(len(self._edges), p=self._shares))]

    def random_wide_start(self) -> Edge:
        """One of the roads with the most lanes, where there is most to see, and no dead end."""
        lasting = np.array([edge.id in self._endless or not self._endless for edge in self._edges])
        lanes = np.array([len(edge.lanes) for edge in self._edges])
        shares = self._shares * lasting * (lanes == lanes[lasting].max())
        return self._edges[int(self._rng.choice(len(shares), p=shares / shares.sum()))]

    def random_lane(self, edge: Edge) -> int:
        """Index of a lane of the edge that cars may use."""
        lanes = [index for index, lane in enumerate(edge.lanes) if lane.for_cars]
        return lanes[int(self._rng.integers(len(lanes)))]

    def random_walk(self, start: Edge, lane: int, length_m: float, *, at_its_end: bool = False) -> list[str]:
        """Edges from `start` on until they are long enough or end.

        The walk goes along lanes: it turns where its lane, or one that can be reached in time, leads to.
        Routes that need one lane change after the other block wide roads. It avoids dead ends, and turns
        back only where it must. `at_its_end`: no room is left to change lanes on `start`.
        """
        route, walked_m = [start.id], start.length_m
        reach = self._reach(start)
        while walked_m < length_m:
            here = self._network.edges[route[-1]]
            if at_its_end and len(route) == 1:
                choices = [link for link in here.connections if link.from_lane == lane]
            else:
                choices = self._choices(here, lane, reach)
            if not choices:
                break
            chosen = choices[int(self._rng.integers(len(choices)))]
            route.append(chosen.to_edge)
            here = self._network.edges[chosen.to_edge]
            lane, reach = chosen.to_lane, self._reach(here)
            walked_m += here.length_m
        return route

    def checked(self, edges: Sequence[str], where: str) -> list[str]:
        """A user's list of edges, if each exists, may be driven on and leads to the next."""
        for index, edge in enumerate(edges):
            if edge not in self._network.edges:
                raise AdvpipeError(f"{where}: no edge {edge!r} on this network{self.nearest(edge)}")
            if not self._network.edges[edge].for_cars:
                raise AdvpipeError(f"{where}: edge {edge!r} has no lane that cars may use")
            if index and edge not in self._network.edges[edges[index - 1]].successors:
                onward = ", ".join(self._network.edges[edges[index - 1]].successors) or "nowhere"
                raise AdvpipeError(
                    f"{where}: edge {edges[index - 1]!r} does not lead to {edge!r}; it leads to {onward}"
                )
        if not edges:
            raise AdvpipeError(f"{where}: the route is empty; name at least one edge")
        return list(edges)

    def nearest(self, edge: str) -> str:
        """A hint at the edge that a user may have meant."""
        known = sorted(self._network.edges)
        close = difflib.get_close_matches(edge, known, n=1, cutoff=0.0)
        return f"; the nearest name is {close[0]!r}" if close else ""

    def _choices(self, here: Edge, lane: int, reach: int) -> list[Connection]:
        """Ways on, the best kind that there is: lasting and not back, lasting, any."""
        near = [link for link in here.connections if abs(link.from_lane - lane) <= reach]
        for links in (near, here.connections):
            lasting = [link for link in links if link.to_edge in self._endless]
            onward = [link for link in lasting if not self._returns(here, link)]
            if onward:
                return onward
        return (
            [link for link in here.connections if link.to_edge in self._endless]
            or near
            or list(here.connections)
        )

    @staticmethod
    def _reach(edge: Edge) -> int:
        return int(edge.length_m / (LANE_CHANGE_S * edge.speed_mps))

    def _returns(self, here: Edge, link: Connection) -> bool:
        there = self._network.edges[link.to_edge]
        start, end = here.lanes[0].centre_m[0, :2], there.lanes[0].centre_m[-1, :2]
        return bool(np.linalg.norm(start - end) < 2 * here.width_m + 6.0)
