"""Path histories of attackers that falsify their position, from their claimed positions."""

from __future__ import annotations

from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.codec.timestamps import generation_time_ns
from advpipe.pipeline.v2x.facilities.cam import PathPoint
from advpipe.pipeline.v2x.facilities.path_history import PathHistory
from advpipe.stages.attack.v2x.cams import LOW, VEHICLE_LOW, field_of, position_deg, with_code

_LOW = ("cam", "camParameters", LOW)


class ClaimedPath:
    """The positions that each station has claimed, one per message; a genuine path has one every 0.1 s.

    points: the maximum number in a CAM.
    """

    def __init__(self, points: int) -> None:
        self._points = points
        self._paths: dict[int, tuple[PathHistory, int]] = {}

    def follow(self, sent: Sent, tree: CamTree, is_attacked: bool) -> CamTree:
        """The CAM, with its path history, if any, replaced if the message is attacked."""
        latitude_deg, longitude_deg = position_deg(tree)
        altitude_m = field_of(tree, "altitude_m")
        if latitude_deg is None or longitude_deg is None:
            return tree
        time_ns = generation_time_ns(tree["cam"]["generationDeltaTime"], sent.request_ns)
        known = self._paths.get(sent.station_id)
        path, newest_ns = (PathHistory(), -1) if known is None else known
        if time_ns > newest_ns:
            path.add(time_ns, latitude_deg, longitude_deg, altitude_m)
            self._paths[sent.station_id] = path, time_ns
        parameters = tree["cam"]["camParameters"]
        if not is_attacked or LOW not in parameters or parameters[LOW][0] != VEHICLE_LOW:
            return tree
        points = path.points(latitude_deg, longitude_deg, altitude_m, time_ns)[: self._points]
        return with_code(tree, (*_LOW, "pathHistory"), [_code(point) for point in points])


def _code(point: PathPoint) -> CamTree:
    position = {
        "deltaLatitude": q.DELTA_DEGREES.code(point.delta_latitude_deg),
        "deltaLongitude": q.DELTA_DEGREES.code(point.delta_longitude_deg),
        "deltaAltitude": q.DELTA_ALTITUDE.code(point.delta_altitude_m),
    }
    if point.delta_time_s is None:
        return {"pathPosition": position}
    return {"pathPosition": position, "pathDeltaTime": q.DELTA_TIME.code(point.delta_time_s)}
