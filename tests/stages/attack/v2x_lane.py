"""A straight road to the east on which all vehicles drive at the same speed and send once per step.

Numbers to work with by hand: station i has its middle at x0_i + 10 t, its front 2.25 m further, and sends
i * 10 ms (in a fleet of more than nine, i * 2 ms) after the begin of each step of 0.1 s what was true at the
begin.
"""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.cam import LowFrequency, cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.pipeline.v2x.facilities.ldm import report_of_cam
from advpipe.pipeline.v2x.facilities.reference_point import reference_point
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.v2x.base import AllocatedIds, AttackContext
from advpipe.stages.attack.v2x.cams import CamEditor

BEGIN_NS, STEP_NS, MS = 1_700_000_000_000_000_000, 100_000_000, 1_000_000
SPEED_MPS, LENGTH_M = 10.0, 4.5
GEODESY = Geodesy(48.0, 11.0, 500.0)


def time_s(time_ns):
    """Since the begin."""
    return (time_ns - BEGIN_NS) / 1e9


def radio(station_id, x_m, y_m=0.0, speed_mps=SPEED_MPS, yaw_rad=0.0):
    velocity_mps = np.array([speed_mps * np.cos(yaw_rad), speed_mps * np.sin(yaw_rad), 0.0])
    pose = se3_from_yaw([x_m, y_m, 0.0], yaw_rad)
    return RadioPlace(station_id, f"car{station_id}", pose, (LENGTH_M, 1.8, 1.5), velocity_mps)


def cam(place, time_ns, acceleration_mps2=0.0):
    """The CAM of a station with exact self-knowledge."""
    point = reference_point(GEODESY, place.map_SE3_base, LENGTH_M)
    state = StationState(
        station_id=place.station_id,
        station_type=StationType.PASSENGER_CAR,
        time_ns=time_ns,
        latitude_deg=point.latitude_deg,
        longitude_deg=point.longitude_deg,
        altitude_m=point.altitude_m,
        heading_rad=point.heading_rad,
        speed_mps=float(np.linalg.norm(place.velocity_mps)),
        length_m=LENGTH_M,
        width_m=1.8,
        longitudinal_acceleration_mps2=acceleration_mps2,
    )
    return encode_cam(cam_of_state(state, LowFrequency()))


def lane(starts_m, steps, leaves=None, accelerations_mps2=None):
    """Steps of a drive. starts_m: x of each station at the begin. leaves: the first step without one."""
    leaves, accelerations_mps2 = leaves or {}, accelerations_mps2 or {}
    apart_ns = (10 if max(starts_m) < 10 else 2) * MS
    drive = []
    for index in range(steps):
        begin_ns = BEGIN_NS + index * STEP_NS
        radios = tuple(
            radio(station, x_m + SPEED_MPS * index * STEP_NS / 1e9)
            for station, x_m in starts_m.items()
            if index < leaves.get(station, steps)
        )
        sent = tuple(
            Sent(
                1000 * index + place.station_id,
                int(message_keys(place.station_id, begin_ns)),
                place.station_id,
                begin_ns + place.station_id * apart_ns,
                cam(place, begin_ns, accelerations_mps2.get(place.station_id, 0.0)),
                23.0,
            )
            for place in radios
        )
        drive.append(V2xStep(begin_ns, begin_ns + STEP_NS, radios, sent))
    return drive


def context(name, attackers=(1,), victim=None, active=lambda time_ns: True, seed=5, **settings):
    return AttackContext(
        name=name,
        seed=seed,
        seed_name="",
        attackers=tuple(attackers),
        victim=victim,
        active=active,
        start_ns=BEGIN_NS,
        v2x=V2x(**settings),
        geodesy=GEODESY,
        cams=CamEditor(),
        numbers=AllocatedIds(10**6, {1, 2, 3, 4, 5}),
    )


def edited(attack, drive):
    """All messages that are sent, in order, after a check of the rules for editors."""
    sent = []
    for step in drive:
        after = attack.edit(step, step.sent)
        present = {place.station_id for place in step.radios}
        assert all(step.begin_ns <= one.request_ns < step.end_ns for one in after)
        assert all(one.station_id in present for one in after)
        sent += sorted(after, key=lambda one: (one.request_ns, one.number))
        attack.context.cams.forget()
    assert len({one.number for one in sent}) == len(sent)
    assert len({one.key for one in sent}) == len(sent)
    return sent


def decoded(one):
    """A message's CAM, and the LDM report of a receiver without delay."""
    cam = decode_cam(one.payload)
    return cam, report_of_cam(cam, one.request_ns, GEODESY)
