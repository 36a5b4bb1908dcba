"""Where on Earth the map's frame of a relay lies."""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.map import GeoOrigin


class MapPlace:
    """The origin that the file names, or the first position that the relay receives."""

    def __init__(self, origin: GeoOrigin | None) -> None:
        self._geodesy: Geodesy | None = None
        if origin is not None:
            self.set_origin(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)

    @property
    def is_known(self) -> bool:
        """Whether there is an origin."""
        return self._geodesy is not None

    @property
    def geodesy(self) -> Geodesy:
        """Raises AdvpipeError without an origin."""
        if self._geodesy is None:
            raise AdvpipeError("no position was received yet")
        return self._geodesy

    def set_origin(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        """Without effect where there is an origin."""
        if self._geodesy is None:
            self._geodesy = Geodesy(latitude_deg, longitude_deg, altitude_m)
