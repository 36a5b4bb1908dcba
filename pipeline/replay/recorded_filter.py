"""The localisation filter of a recorded vehicle, run again with the settings in the bag's scenario."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.bag.latched import FilterInfo, read_scenario_info
from advpipe.pipeline.bag.localisation import read_initial_pose
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.pipeline.scenario.simulation import Simulation

GNSS_FIX = "/gnss/fix"


@dataclass(frozen=True)
class RecordedFilter:
    """The settings of a bag's filters.

    sensors: the sensor models that the filters assume. origin: the map's. clock: of the drive.
    """

    sensors: Sensors
    origin: GeoOrigin
    clock: Simulation

    @property
    def geodesy(self) -> Geodesy:
        """The projection between the map frame and WGS 84."""
        return Geodesy(self.origin.latitude_deg, self.origin.longitude_deg, self.origin.altitude_m)

    def estimator(self, reader: BagReader, topics: VehicleTopics) -> Estimator:
        """A vehicle's filter in its state at the start of the recording. Raises AdvpipeError if that is
        invalid."""
        return Estimator(self.sensors, self.geodesy, read_initial_pose(reader, topics))


@contextmanager
def filter_errors(reader: BagReader, vehicle: str) -> Iterator[None]:
    """Raise AdvpipeError that names bag and vehicle if a filter fails on their measurements in the block."""
    try:
        yield
    except (AdvpipeError, np.linalg.LinAlgError, ArithmeticError, ValueError) as error:
        if isinstance(error, AdvpipeError) and str(error).startswith(str(reader.path)):
            raise
        raise AdvpipeError(
            f"{reader.path}: the filter of {vehicle} cannot process the data of /{vehicle}/...: {error}"
        ) from None


def read_filter(reader: BagReader) -> RecordedFilter:
    """Read the filter settings from a bag. Raises UsageError for a bag without its scenario."""
    if SCENARIO_INFO.name not in reader.topics:
        raise UsageError(
            f"{reader.path} has no {SCENARIO_INFO.name}, so the assumptions of its filters are unknown"
        )
    info = read_scenario_info(reader, FilterInfo)
    return RecordedFilter(info.sensors, info.map.origin, info.simulation)


def vehicles_with_gnss(reader: BagReader) -> list[str]:
    """Sorted names of the vehicles with GNSS fixes."""
    names = {name.strip("/").partition("/")[0] for name in reader.topics if name.endswith(GNSS_FIX)}
    return sorted(name for name in names if VehicleTopics(name).gnss_fix.name in reader.topics)


def vehicles_with_filter(reader: BagReader) -> list[str]:
    """Sorted names of the vehicles with GNSS fixes, an estimate and an initial pose."""
    return [
        name
        for name in vehicles_with_gnss(reader)
        if {VehicleTopics(name).odometry.name, VehicleTopics(name).initial_pose.name} <= set(reader.topics)
    ]


def default_victim(known: Sequence[str]) -> str | None:
    """The default victim among the vehicles with GNSS: `ego`, or the only one; else None."""
    if "ego" in known:
        return "ego"
    return known[0] if len(known) == 1 else None
