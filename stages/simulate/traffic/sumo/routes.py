"""Routes over the network: random walks along lanes, and checks of the user's routes."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.road_network.network import Connection, Edge, RoadNetwork, endless_edges

LANE_CHANGE_S = 9.0
"""Driving time on an edge that a random walk needs for each lane change."""


class Routes:
    """Draws starts and routes of vehicles on one network."""

    def __init__(self, network: RoadNetwork, rng: np.random.Generator) -> None:
        self._network = network
        self._rng = rng
        self._edges = [edge for edge in network.drivable if edge.is_true_to_length] or network.drivable
        lengths_m = np.array([edge.length_m * len(edge.lanes) for edge in self._edges])
        self._shares = lengths_m / lengths_m.sum()
        self._endless = endless_edges(self._edges)

    def random_start(self) -> Edge:
        """A random edge, weighted by its length and number of lanes."""
        return self._edges[int(self._rng.choice(len(self._edges), p=self._shares))]

    def random_wide_start(self) -> Edge:
        """A random edge among those with the most lanes, which have the most traffic, without dead ends."""
        lasting = np.array([edge.id in self._endless or not self._endless for edge in self._edges])
        lanes = np.array([len(edge.lanes) for edge in self._edges])
        shares = self._shares * lasting * (lanes == lanes[lasting].max())
        return self._edges[int(self._rng.choice(len(shares), p=shares / shares.sum()))]

    def random_lane(self, edge: Edge) -> int:
        """Index of a random lane of the edge that cars may use."""
        lanes = [index for index, lane in enumerate(edge.lanes) if lane.for_cars]
        return lanes[int(self._rng.integers(len(lanes)))]

    def random_walk(self, start: Edge, lane: int, length_m: float, *, keep_lane: bool = False) -> list[str]:
        """Ids of edges from `start` on, until they are `length_m` long together or the road ends.

        The walk follows lanes: it turns only where its lane, or a lane that it can reach in time, leads,
        because vehicles that need many lane changes block wide roads. It avoids dead ends, and makes U-turns
        only where it must. keep_lane: do not change lanes on `start`.
        """
        route, walked_m = [start.id], start.length_m
        reach = self._reach(start)
        while walked_m < length_m:
            here = self._network.edges[route[-1]]
            if keep_lane and len(route) == 1:
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
        """The user's list of edges, if each exists, is drivable and leads to the next.

        Raises AdvpipeError, beginning with `where`, for any other list.
        """
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
        """A hint for an error message: the edge with the most similar name; empty if there is none."""
        known = sorted(self._network.edges)
        close = difflib.get_close_matches(edge, known, n=1, cutoff=0.0)
        return f"; the nearest name is {close[0]!r}" if close else ""

    def _choices(self, here: Edge, lane: int, reach: int) -> list[Connection]:
        """Connections onward: without dead end and U-turn if possible, else without dead end, else any."""
        near = [link for link in here.connections if abs(link.from_lane - lane) <= reach]
        for links in (near, here.connections):
            lasting = [link for link in links if link.to_edge in self._endless]
            onward = [link for link in lasting if not self._is_u_turn(here, link)]
            if onward:
                return onward
        return (
            [link for link in here.connections if link.to_edge in self._endless]
            or near
            or list(here.connections)
        )

    @staticmethod
    def _reach(edge: Edge) -> int:
        """How many lane changes a vehicle has time for on an edge."""
        return int(edge.length_m / (LANE_CHANGE_S * edge.speed_mps))

    def _is_u_turn(self, here: Edge, link: Connection) -> bool:
        there = self._network.edges[link.to_edge]
        start, end = here.lanes[0].centre_m[0, :2], there.lanes[0].centre_m[-1, :2]
        return bool(np.linalg.norm(start - end) < 2 * here.width_m + 6.0)
