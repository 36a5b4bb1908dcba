"""The generator against a real run of Artery: ADVPIPE_ARTERY names the folder of its trace.

base_states.csv has the vehicles' states, base_stations.csv their check phases, base_cams.csv what they sent.
Times are seconds since 2013-06-01 12:35 UTC; at time T, Artery uses the row of floor(10 T) / 10 - 0.1,
which holds the state at the end of that step. Congestion control was relaxed throughout.
"""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path

import pyproj
import pytest

from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import cam_tree, decode_cam
from advpipe.pipeline.v2x.facilities.dcc import STATES
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS, CamGenerator, Cause
from advpipe.pipeline.v2x.facilities.station_state import StationState

EPOCH_NS = 1_370_090_100 * 10**9
END_NS = 60 * 10**9
UTM_OFFSET_M = 675_530.77, 5_403_160.33
LETTERS = {Cause.HEADING: "H", Cause.POSITION: "P", Cause.SPEED: "S"}

Row = dict[str, str]

pytestmark = pytest.mark.oracle


@pytest.fixture(scope="module")
def folder() -> Path:
    if not (name := os.environ.get("ADVPIPE_ARTERY")):
        pytest.skip("ADVPIPE_ARTERY is not set")
    return Path(name)


def rows(path: Path) -> list[Row]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def artery(folder: Path) -> dict[tuple[int, int], Row]:
    """Artery's CAMs by vehicle and time in nanoseconds."""
    return {(int(row["k"]), nanoseconds(row["t"])): row for row in rows(folder / "base_cams.csv")}


@pytest.fixture(scope="module")
def ours(folder: Path) -> dict[tuple[int, int], tuple[Cam, Cause]]:
    """Our CAMs, as received, from Artery's vehicle states and check phases."""
    states = {(int(row["k"]), round(float(row["t"]) * 10)): row for row in rows(folder / "base_states.csv")}
    utm = pyproj.Proj(proj="utm", zone=32, ellps="WGS84")
    sent = {}
    for station in rows(folder / "base_stations.csv"):
        generator = CamGenerator(nanoseconds(station["t_inserted"]))
        for time_ns in range(nanoseconds(station["t_first_check"]), END_NS, CHECK_INTERVAL_NS):
            key = int(station["k"]), time_ns // CHECK_INTERVAL_NS - 1
            if key not in states:
                break
            state = station_state(int(station["station"]), states[key], utm)
            if (cam := generator.check(time_ns, state, STATES["relaxed"])) is not None:
                sent[key[0], time_ns] = decode_cam(cam.payload), cam.cause
    return sent


def nanoseconds(seconds: str) -> int:
    return round(float(seconds) * 1e9)


def station_state(station_id: int, row: Row, utm: pyproj.Proj) -> StationState:
    x, y = (float(row[axis]) + offset for axis, offset in zip("xy", UTM_OFFSET_M, strict=True))
    longitude_deg, latitude_deg = utm(x, y, inverse=True)
    return StationState(
        station_id=station_id,
        station_type=StationType.PASSENGER_CAR,
        time_ns=EPOCH_NS + nanoseconds(row["t"]) + CHECK_INTERVAL_NS,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        heading_rad=math.radians(float(row["angle"])),
        speed_mps=float(row["speed"]),
        length_m=4.5,
        width_m=1.8,
    )


def test_cams_are_sent_at_the_same_instants_as_in_artery(
    ours: dict[tuple[int, int], tuple[Cam, Cause]], artery: dict[tuple[int, int], Row]
) -> None:
    assert len(artery) == 5343
    assert sorted(ours) == sorted(artery)


def test_cams_are_sent_for_the_same_reasons_as_in_artery(
    ours: dict[tuple[int, int], tuple[Cam, Cause]], artery: dict[tuple[int, int], Row]
) -> None:
    """Artery measures distance in the grid of UTM, 0.04 % shorter there than on the ground."""
    for key, (_, cause) in ours.items():
        differing = {letter for flag, letter in LETTERS.items() if flag in cause} ^ set(artery[key]["cause"])
        if abs(float(artery[key]["dpos_m"]) - 4) < 0.002:
            differing -= {"P"}
        assert cause == Cause.FIRST or differing <= {"T"}, key


def test_fields_equal_arterys_where_artery_is_right(
    ours: dict[tuple[int, int], tuple[Cam, Cause]], artery: dict[tuple[int, int], Row]
) -> None:
    """Artery rounds positions to a microdegree, speed to the nearest (the dictionary asks for up).

    Its clock knows no leap seconds, of which there were three between 2004 and 2013.
    """
    for key, (cam, _) in ours.items():
        row, tree = artery[key], cam_tree(cam)
        high = tree["cam"]["camParameters"]["highFrequencyContainer"][1]
        assert cam.latitude_deg == pytest.approx(int(row["cam_lat"]) / 1e7, abs=1e-6)
        assert cam.longitude_deg == pytest.approx(int(row["cam_lon"]) / 1e7, abs=1e-6)
        assert abs(high["heading"]["headingValue"] - int(row["cam_heading"])) % 3600 in (0, 1, 3599)
        assert high["speed"]["speedValue"] - int(row["cam_speed"]) in (0, 1)
        assert (cam.generation_delta_time_ms - int(row["gen_delta_time"])) % 65_536 == 3000
        assert (cam.low_frequency is not None) == (row["lf"] == "1")
