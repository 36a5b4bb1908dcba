"""The receiver's map of the roads, as navigation systems have it: is a claimed place on one, which way?"""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.geometry.transforms import Float64, wrap_angle

NEAR_M = 2.0
"""Lanes whose middles are as near beyond half a lane's width count for the direction of travel."""

_ON_FOOT = {"pedestrian", "bicycle"}
_LANE_WIDTH_M = 3.2  # SUMO's own where a lane tells none


class RoadMap:
    """Lanes that motor vehicles use.

    segments_m: (L, 2, 2) pieces of their middles in the direction of travel. widths_m: (L,).
    """

    def __init__(self, segments_m: Float64, widths_m: Float64) -> None:
        self.segments_m = segments_m
        self._lines = shapely.linestrings(segments_m) if len(segments_m) else np.array([], object)
        self._tree = shapely.STRtree(self._lines)
        along = segments_m[:, 1] - segments_m[:, 0]
        self._yaw_rad = np.arctan2(along[:, 1], along[:, 0])
        self._half_m = widths_m / 2

    @classmethod
    def of_sumo_net(cls, path: Path) -> RoadMap:
        """The lanes of a SUMO network, junctions included, in the map's frame."""
        root = ElementTree.parse(path).getroot()
        location = root.find("location")
        is_geographic = location is not None and location.get("projParameter", "!") != "!"
        offset = "0,0" if location is None or is_geographic else location.get("netOffset", "0,0")
        offset_m = np.array([float(value) for value in offset.split(",")[:2]])
        pieces, widths = [], []
        for edge in root.iter("edge"):
            if edge.get("function") in ("crossing", "walkingarea"):
                continue
            for lane in edge.iter("lane"):
                allowed = set(lane.get("allow", "all").split())
                if allowed <= _ON_FOOT:
                    continue
                points = [[float(v) for v in p.split(",")[:2]] for p in lane.get("shape", "").split()]
                middle_m = np.array(points).reshape(-1, 2) - offset_m
                steps = np.stack([middle_m[:-1], middle_m[1:]], axis=1)
                pieces.append(steps[np.any(steps[:, 0] != steps[:, 1], axis=1)])
                widths += [float(lane.get("width", _LANE_WIDTH_M))] * len(pieces[-1])
        return cls(np.concatenate(pieces) if pieces else np.zeros((0, 2, 2)), np.array(widths))

    def measure(self, places: Sequence[tuple[float, float, float]]) -> tuple[Float64, Float64]:
        """How far (P,) places x, y, yaw are off every lane [m], and turned from every lane near [rad].

        Zero on a lane. NaN where a place is not finite, without any lane, and for the direction where no
        lane is near.
        """
        at = np.array(places, np.float64).reshape(-1, 3)
        off_m, wrong_rad = np.full(len(at), np.nan), np.full(len(at), np.nan)
        (finite,) = np.nonzero(np.isfinite(at[:, :2]).all(axis=1))
        if len(self._lines) == 0 or len(finite) == 0:
            return off_m, wrong_rad
        points = shapely.points(at[finite, :2])
        # A wider lane a little farther off may be nearer with its edge.
        reach = float(self._half_m.max()) + NEAR_M
        nearest = self._tree.query_nearest(points, all_matches=False, return_distance=True)
        (asked, found), distance_m = nearest
        off_m[finite[asked]] = distance_m - self._half_m[found]
        asked, found = self._tree.query(points, predicate="dwithin", distance=reach)
        beyond_m = shapely.distance(points[asked], self._lines[found]) - self._half_m[found]
        np.fmin.at(off_m, finite[asked], beyond_m)
        near = beyond_m <= NEAR_M
        turned = np.abs(wrap_angle(at[finite[asked], 2] - self._yaw_rad[found]))
        np.fmin.at(wrong_rad, finite[asked[near]], turned[near])
        return np.maximum(off_m, 0.0), wrong_rad


NO_ROADS = RoadMap(np.zeros((0, 2, 2)), np.zeros(0))
"""Nothing is known of roads: both checks that need them say nothing."""


def find_roads(
    scenario: Mapping[str, object], map_sha256: str, beside: Sequence[Path] = ()
) -> RoadMap | None:
    """The lanes of the SUMO network that a drive was simulated on; None where that file is not at hand.

    scenario: as `/scenario/info` has it. The file is sought by the name that the scenario gives it, in these
    folders, in the working directory and among the shipped ones, and is taken only if it is the very same.
    """
    section = scenario.get("map")
    name = section.get("sumo_net") if isinstance(section, Mapping) else None
    if not isinstance(name, str):
        return None
    shipped = Path(str(files("advpipe.scenarios"))) / "networks"
    for path in (Path(name), *(folder / Path(name).name for folder in (*beside, shipped))):
        if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == map_sha256:
            return RoadMap.of_sumo_net(path)
    return None


def lanes(middles_m: Sequence[npt.ArrayLike], width_m: float) -> RoadMap:
    """A map of lanes by their middles (K, 2) each, all of one width."""
    pieces = [np.stack([m[:-1], m[1:]], axis=1) for m in (np.asarray(m, np.float64) for m in middles_m)]
    segments = np.concatenate(pieces)
    return RoadMap(segments, np.full(len(segments), width_m))
