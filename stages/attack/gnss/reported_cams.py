"""The CAMs of a spoofed station of which the bag holds nothing else: no fixes, no filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.stages.attack.gnss.spoofing_schedule import FalseFix, SpoofingSchedule


class ReportedCams:
    """Moves the reported position of one station by the attack's false_fix; a `MessageEditor`.

    Each CAM counts as a fix, the reference point as the receiver's place. Heading, speed, accelerations,
    confidences and times of sending stay as they were said: nothing in the bag tells how the station fuses
    them. The path history, which is relative, moves along. Without a fix, position, altitude and ellipse are
    unavailable. Attacks that need a filter (`GnssTraits`) are refused for such a station.

    Calls of `edit` go through the drive's steps in order, once.
    """

    def __init__(self, schedule: SpoofingSchedule, geodesy: Geodesy) -> None:
        self.name = schedule.name
        self._schedule = schedule
        self._geodesy = geodesy

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """The same messages; those of the victim tell the false place."""
        victim = self._schedule.victim
        ids = {radio.station_id for radio in step.radios if radio.vehicle == victim}
        return [self._with_false_position(one) if one.station_id in ids else one for one in sent]

    def _with_false_position(self, one: Sent) -> Sent:
        try:
            cam = decode_cam(one.payload)
        except CamError:  # bytes that are no CAM tell no place
            return one
        if cam.latitude_deg is None or cam.longitude_deg is None:
            return one
        _, _, ground_m = self._geodesy.to_geographic(np.zeros(3))
        altitude_m = ground_m if cam.altitude_m is None else cam.altitude_m
        position_m = self._geodesy.to_map([cam.latitude_deg, cam.longitude_deg, altitude_m])
        heading_rad = math.pi / 2 - (cam.heading_rad or 0.0)  # from clockwise of north; the map's y is north
        false_fix = self._schedule.of(one.request_ns, position_m, heading_rad, _no_filter)
        if false_fix is None or (
            false_fix.position_m is not None and np.array_equal(false_fix.position_m, position_m)
        ):
            return one
        return replace(one, payload=encode_cam(self._with_place(cam, false_fix)))

    def _with_place(self, cam: Cam, false_fix: FalseFix) -> Cam:
        if false_fix.position_m is None:
            return replace(
                cam,
                latitude_deg=None,
                longitude_deg=None,
                altitude_m=None,
                altitude_confidence_m=None,
                semi_major_m=None,
                semi_minor_m=None,
                semi_major_rad=None,
            )
        latitude_deg, longitude_deg, altitude_m = self._geodesy.to_geographic(false_fix.position_m).tolist()
        return replace(
            cam,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=None if cam.altitude_m is None else altitude_m,
        )


def _no_filter() -> Innovation:
    raise AssertionError("a station without a filter has no innovation")
