"""The map's place on the Earth, as the vehicle can know it: where its estimate and first fixes agree."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.stages.investigate.evidence_topics import EvidenceTopics
from advpipe.stages.investigate.observations import Observations, read_observations

FIRST_S = 2.0
"""Fixes of so long a time give the origin: each errs by some decimetres."""

_ROUNDS = 3


def anchored_geodesy(reader: BagReader, topics: EvidenceTopics) -> Geodesy | None:
    """The projection about the origin at which the first fixes lie where the vehicle's estimate has them.

    With fixes alone, the first one is the origin. None without fixes. A bag's scenario states the origin,
    but tells what no vehicle knows, too, so that it is not read. An offset that the fixes have from the
    beginning is taken for the map's, and seen by no cue.
    """
    fixes: list[Float64] = []
    places: list[Float64 | None] = []
    first_ns: int | None = None
    for observed in read_observations(reader, topics):
        first_ns = observed.time_ns if first_ns is None else first_ns
        if (observed.time_ns - first_ns) / 1e9 > FIRST_S and (fixes or observed.time_ns > first_ns + 10**10):
            break
        if observed.fixes:
            fixes.append(observed.fixes[-1].geographic)
            places.append(_place_m(observed))
    if not fixes:
        return None
    known = [(fix, place_m) for fix, place_m in zip(fixes, places, strict=True) if place_m is not None]
    if not known:
        return Geodesy(*fixes[0].tolist())
    return _fitted(np.array([fix for fix, _ in known]), np.array([place_m for _, place_m in known]))


def _place_m(observed: Observations) -> Float64 | None:
    return observed.poses[-1].map_SE3_base[:3, 3] if observed.poses else None


def _fitted(geographic: Float64, places_m: Float64) -> Geodesy:
    """The projection that maps the fixes (K, 3) to the places (K, 3) on average."""
    geodesy = Geodesy(*geographic[0].tolist())
    for _ in range(_ROUNDS):
        found_m = np.array([geodesy.to_map(fix) for fix in geographic])
        origin = geodesy.to_geographic(np.median(found_m - places_m, axis=0))
        geodesy = Geodesy(*origin.tolist())
    return geodesy
