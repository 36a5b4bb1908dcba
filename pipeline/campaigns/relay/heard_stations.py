"""The stations that were heard lately, where their CAMs say that they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.cams import field_of

HEARD_NS = 2_000_000_000
"""A station that was not heard for so long is gone: CAMs come once a second at least."""

MOST_STATIONS = 1000
"""More than a radio hears; it bounds memory where somebody floods the channel with new identities."""

_LENGTH_M, _WIDTH_M, _HEIGHT_M = 4.5, 1.8, 1.5


class HeardStations:
    """Takes the place of the positions of radios that a recorded drive has; see `V2xStep.radios`."""

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, RadioPlace]] = {}

    def hear(self, tree: CamTree, geodesy: Geodesy, now_ns: int) -> int | None:
        """The id of the station that sends a vehicle's CAM; None for one without a position."""
        latitude_deg, longitude_deg = (field_of(tree, name) for name in ("latitude_deg", "longitude_deg"))
        if latitude_deg is None or longitude_deg is None:
            return None
        station_id = int(field_of(tree, "station_id"))
        if station_id not in self._last and len(self._last) >= MOST_STATIONS:
            return None
        length_m = field_of(tree, "length_m") or _LENGTH_M
        heading_rad, speed_mps = (field_of(tree, name) or 0.0 for name in ("heading_rad", "speed_mps"))
        yaw_rad = math.pi / 2 - heading_rad
        forward = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
        front_m = geodesy.to_map([latitude_deg, longitude_deg, 0.0]) * (1.0, 1.0, 0.0)
        place = RadioPlace(
            station_id,
            str(station_id),
            se3_from_yaw(front_m - forward * length_m / 2, yaw_rad),
            (length_m, field_of(tree, "width_m") or _WIDTH_M, _HEIGHT_M),
            forward * speed_mps,
        )
        self._last[station_id] = now_ns, place
        return station_id

    def places(self, now_ns: int) -> Sequence[RadioPlace]:
        """Those that were heard in the last two seconds, in the order of their ids."""
        for station_id in [one for one, (at_ns, _) in self._last.items() if at_ns < now_ns - HEARD_NS]:
            del self._last[station_id]
        return [place for _, (_, place) in sorted(self._last.items())]
