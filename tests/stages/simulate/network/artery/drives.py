"""Drives of messages alone, through Artery or ours, and what the tests compare of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS, CamGenerator
from advpipe.pipeline.v2x.facilities.station_state import StationState

STEP_NS = 100_000_000


def scenario(*settings: str) -> Scenario:
    """Vehicles of several bodies on a grid, without sensors and pedestrians."""
    base = ["vehicles={}", "sensors={}", "traffic.pedestrians=0", "simulation.warmup_s=5"]
    return load_scenario("smoke", [*base, *settings])


class Station(NamedTuple):
    """One station's messages, in order, and what it was at each step of 0.1 s."""

    station_id: int
    sent_ns: list[int]
    states: dict[int, StationState]


def stations_of(bag: Path) -> Iterator[Station]:
    """The stations of a drive by Artery, with the states that Artery has: SUMO's, at the front bumper."""
    reader = BagReader(bag)
    drive = V2xDrive(reader)
    stations: dict[int, Station] = {}
    for step in drive.steps():
        if step.end_ns is None:
            break
        for radio in step.radios:
            station = stations.setdefault(radio.station_id, Station(radio.station_id, [], {}))
            station.states[step.begin_ns] = _state(radio, step.begin_ns, drive.geodesy)
        for one in step.sent:
            stations[one.station_id].sent_ns.append(one.request_ns)
    yield from stations.values()


def our_instants(station: Station) -> list[int]:
    """When our generator sends for the states of a station.

    Artery checks every 0.1 s from a random phase, 0.1 to 0.2 s after the step in which the station is
    switched on, and sends at the first check: so its first CAM tells both.
    """
    time_ns = station.sent_ns[0]
    generator = CamGenerator(time_ns // STEP_NS * STEP_NS - STEP_NS)
    found = list[int]()
    while (begin_ns := time_ns // STEP_NS * STEP_NS) in station.states:
        if generator.check(time_ns, station.states[begin_ns], 0.0) is not None:
            found.append(time_ns)
        time_ns += CHECK_INTERVAL_NS
    return found


def sent_of(bag: Path) -> list[Sent]:
    """All messages of a drive."""
    return [one for step in V2xDrive(BagReader(bag)).steps() for one in step.sent]


def _state(radio: RadioPlace, now_ns: int, geodesy: Geodesy) -> StationState:
    pose = radio.map_SE3_base
    front_m = pose[:3, 3] + pose[:3, 0] * radio.size_m[0] / 2
    latitude_deg, longitude_deg, altitude_m = geodesy.to_geographic(front_m).tolist()
    return StationState(
        station_id=radio.station_id,
        station_type=StationType.PASSENGER_CAR,
        time_ns=now_ns,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=altitude_m,
        heading_rad=float(np.pi / 2 - np.arctan2(pose[1, 0], pose[0, 0])) % (2 * np.pi),
        speed_mps=float(np.linalg.norm(radio.velocity_mps)),
        length_m=radio.size_m[0],
        width_m=radio.size_m[1],
    )
