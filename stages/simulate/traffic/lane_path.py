"""The line that a vehicle follows along its route: lane centres, turns, and lane changes between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.network import Connection, Edge, RoadNetwork

SPACING_M = 1.0
LANE_CHANGE_M = 50.0
"""Length of a change by one lane, where the edge is long enough."""


@dataclass(frozen=True)
class LanePath:
    """A path of K points about a metre apart, in the map's frame.

    places_m: (K, 3). along_m: (K,), distance from the start. limits_mps: (K,), speed limits. lights: for each
    stop line, its distance along the path, the id of its traffic light, and its link's index in the state.
    """

    places_m: Float64
    along_m: Float64
    limits_mps: Float64
    lights: tuple[tuple[float, str, int], ...]

    def at(self, along_m: Float64 | float) -> Float64:
        """Places (..., 3) at distances (...,) along the path."""
        columns = [np.interp(along_m, self.along_m, self.places_m[:, axis]) for axis in range(3)]
        return np.stack(columns, axis=-1)


def lane_path(network: RoadNetwork, route: Sequence[str], first_lane: int) -> LanePath:
    """The path with the fewest lane changes along a route that begins on a given lane."""
    edges = [network.edges[edge] for edge in route]
    turns = _turns(edges, first_lane)
    lane, pieces, limits = first_lane, [], []
    stop_lines: list[tuple[int, tuple[str, int]]] = []
    for edge, turn in zip(edges, [*turns, None], strict=True):
        pieces.append(_along_edge(edge, lane, lane if turn is None else turn.from_lane))
        limits.append(np.full(len(pieces[-1]), edge.speed_mps))
        if turn is not None:
            if turn.light is not None:
                stop_lines.append((sum(map(len, pieces)) - 1, turn.light))
            pieces.append(turn.centre_m)
            limits.append(np.full(len(turn.centre_m), edge.speed_mps))
            lane = turn.to_lane
    places_m, limits_mps = np.concatenate(pieces), np.concatenate(limits)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places_m, axis=0), axis=1))])
    even = np.linspace(0.0, along[-1], max(round(along[-1] / SPACING_M), 1) + 1)
    columns = [np.interp(even, along, places_m[:, axis]) for axis in range(3)]
    lights = tuple((float(along[index]), *light) for index, light in stop_lines)
    return LanePath(np.stack(columns, axis=-1), even, np.interp(even, along, limits_mps), lights)


def _turns(edges: Sequence[Edge], first_lane: int) -> list[Connection]:
    """One connection between each two edges, with the fewest lane changes (shortest path over lanes)."""
    best: dict[int, tuple[int, list[Connection]]] = {first_lane: (0, [])}  # by the lane of arrival
    for here, there in pairwise(edges):
        arrivals: dict[int, tuple[int, list[Connection]]] = {}
        for link in here.connections:
            if link.to_edge != there.id:
                continue
            changes, turns = min(
                ((cost + abs(link.from_lane - lane), path) for lane, (cost, path) in best.items()),
                key=lambda option: option[0],
            )
            if link.to_lane not in arrivals or changes < arrivals[link.to_lane][0]:
                arrivals[link.to_lane] = (changes, [*turns, link])
        best = arrivals
    return min(best.values(), key=lambda option: option[0])[1]


def _along_edge(edge: Edge, enter: int, leave: int) -> Float64:
    """Points (K, 3) from the start of one lane to the end of another of the same edge."""
    if enter == leave:
        return edge.lanes[enter].centre_m
    shares = np.linspace(0.0, 1.0, max(int(edge.length_m / SPACING_M), 8) + 1)
    first, second = (_at_shares(edge.lanes[lane].centre_m, shares) for lane in (enter, leave))
    change = min(abs(leave - enter) * LANE_CHANGE_M / edge.length_m, 0.8)
    begin = min(0.1, 1.0 - change)
    x = np.clip((shares - begin) / change, 0.0, 1.0)
    weight = (x * x * (3 - 2 * x))[:, None]
    mixed: Float64 = first * (1 - weight) + second * weight
    return mixed


def _at_shares(line_m: Float64, shares: Float64) -> Float64:
    """Points (S, 3) at shares (S,) of a polyline's length."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    return np.stack([np.interp(shares * along[-1], along, line_m[:, axis]) for axis in range(3)], axis=-1)
