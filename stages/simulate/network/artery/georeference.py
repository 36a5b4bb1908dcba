"""The road network for Artery, whose stations ask SUMO for their latitude and longitude."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.stages.simulate.road_network.network import RoadNetwork

_LOCATION = re.compile(r"<location\b[^>]*/>")
_BOUNDARIES = ("convBoundary", "origBoundary")


def georeferenced(roads: RoadNetwork, origin: GeoOrigin, folder: Path) -> RoadNetwork:
    """A copy whose coordinates SUMO converts as `Geodesy` does; nothing else in it differs.

    The projection is a property of a network by itself, which vehicles do not notice.
    """
    text = roads.sumo_file.read_text(encoding="utf-8")
    if (found := _LOCATION.search(text)) is None:
        raise AdvpipeError(f"{roads.sumo_file.name} has no element location; write it anew with netconvert")
    centre = f"+lat_0={origin.latitude_deg!r} +lon_0={origin.longitude_deg!r}"
    projection = f"+proj=tmerc {centre} +k=1 +datum=WGS84 +units=m"
    kept = "".join(f" {one}" for name in _BOUNDARIES for one in re.findall(rf'{name}="[^"]*"', found.group()))
    offset = f"{roads.offset_m[0]!s},{roads.offset_m[1]!s}"
    location = f'<location netOffset="{offset}"{kept} projParameter={quoteattr(projection)}/>'
    path = folder / "georeferenced.net.xml"
    path.write_text(text[: found.start()] + location + text[found.end() :], encoding="utf-8")
    return replace(roads, sumo_file=path)
