"""The scenario file: frozen models of its sections, checked at construction."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Probability = Annotated[float, Field(ge=0, le=1)]

BodyName = Literal["sedan", "hatchback", "suv", "pickup", "van", "box_truck", "bus", "motorcycle", "bicycle"]
"""Bodies that drive on the road; people on foot are counted by `traffic.pedestrians`."""


class Section(BaseModel):
    """Frozen; a key that is not known is an error, and so is a number that is not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Simulation(Section):
    """Clock and chance."""

    seed: int = Field(1, ge=0, lt=2**63, description="every random draw of the drive derives from it")
    duration_s: Positive = Field(20.0, le=1e6, description="recorded time")
    step_s: Positive = Field(0.1, le=1.0, description="step of traffic and sensors")
    warmup_s: NotNegative = Field(15.0, description="simulated before the recording starts")
    start: datetime = Field(
        datetime(2026, 1, 1, 12, tzinfo=timezone.utc), description="date that the recording starts at"
    )

    @model_validator(mode="after")
    def _clock(self) -> Simulation:
        step_ms = self.step_s * 1000
        if round(step_ms) < 1 or abs(step_ms - round(step_ms)) > 1e-6:
            raise ValueError(
                f"step_s {self.step_s:g} is no whole number of milliseconds, to which SUMO would round it"
            )
        if self.duration_s < self.step_s:
            raise ValueError(f"duration_s {self.duration_s:g} is shorter than one step_s {self.step_s:g}")
        if self.start.tzinfo is None:
            raise ValueError("start has no time zone; write it like 2026-01-01T12:00:00Z")
        if not 2000 <= self.start.year <= 2037:  # a ROS time stamp ends in January 2038
            raise ValueError(f"start is in {self.start.year}; it has to be in the years 2000 to 2037")
        return self

    @property
    def frames(self) -> int:
        """Recorded steps."""
        return round(self.duration_s / self.step_s)

    @property
    def start_ns(self) -> int:
        """The start in nanoseconds since 1970."""
        return int(self.start.timestamp()) * 1_000_000_000 + self.start.microsecond * 1000

    def stamp_ns(self, frame: int) -> int:
        """The time stamp of a recorded frame, exact to the nanosecond."""
        return self.start_ns + frame * round(self.step_s * 1e9)


class Origin(Section):
    """Where the map's origin lies on the Earth."""

    latitude_deg: float = Field(48.1351, ge=-85, le=85)
    longitude_deg: float = Field(11.5820, ge=-180, le=180)
    altitude_m: float = Field(520.0, ge=-500, le=9000)


class Map(Section):
    """The road network: exactly one of `opendrive` and `sumo_net`."""

    opendrive: str | None = Field(None, description="path of an OpenDRIVE .xodr file")
    sumo_net: str | None = Field(None, description="path of a SUMO .net.xml file")
    origin: Origin = Origin()

    @model_validator(mode="after")
    def _one_source(self) -> Map:
        if (self.opendrive is None) == (self.sumo_net is None):
            raise ValueError("give exactly one of opendrive and sumo_net")
        return self


class Traffic(Section):
    """Who is on the road besides the instrumented vehicles; SUMO drives them."""

    vehicles: int = Field(80, ge=0, le=5000, description="kept on the network all the time")
    mix: dict[BodyName, Annotated[float, Field(ge=0, le=1e6)]] = Field(
        {
            "sedan": 0.28,
            "hatchback": 0.2,
            "suv": 0.2,
            "pickup": 0.05,
            "van": 0.08,
            "box_truck": 0.05,
            "bus": 0.03,
            "motorcycle": 0.04,
            "bicycle": 0.07,
        },
        description="share of each body; normalised to one",
    )
    pedestrians: int = Field(40, ge=0, le=5000, description="people on foot beside the roads")
    parked_per_km: NotNegative = Field(15.0, le=150, description="parked cars per kilometre of kerb")

    @model_validator(mode="after")
    def _some_share(self) -> Traffic:
        if self.vehicles and not sum(self.mix.values()) > 0:
            raise ValueError("mix needs at least one share above zero")
        return self


class Vehicle(Section):
    """A vehicle that carries sensors; SUMO drives it along a route drawn from the seed."""

    body: BodyName = "sedan"


class LidarSensor(Section):
    """A rotating LiDAR; names and meanings as in CARLA's sensor.lidar.ray_cast."""

    vehicle: str = "ego"
    x_m: float = Field(0.0, description="mounting place before the vehicle's centre")
    z_m: Positive = Field(1.8, description="mounting height above the road")
    channels: int = Field(64, ge=1, le=256)
    range: Positive = Field(100.0, le=500, description="metres")
    points_per_second: int = Field(
        1_152_000, ge=1, le=20_000_000, description="rays of all channels together"
    )
    rotation_frequency: float = Field(
        10.0, ge=1, le=1000, description="turns a second; one turn is one cloud"
    )
    upper_fov: float = Field(2.0, ge=-90, le=90, description="degrees")
    lower_fov: float = Field(-24.8, ge=-90, le=90, description="degrees")
    atmosphere_attenuation_rate: NotNegative = Field(
        0.004, description="intensity lost, exp(-a d), per metre"
    )
    dropoff_general_rate: Probability = Field(0.02, description="share of points lost at random")
    dropoff_intensity_limit: Probability = Field(0.3, description="no intensity-based loss above it")
    dropoff_zero_intensity: Probability = Field(0.4, description="share of points lost at intensity zero")
    noise_stddev: NotNegative = Field(0.02, le=1.0, description="of the range, in metres")

    @model_validator(mode="after")
    def _fov(self) -> LidarSensor:
        if self.lower_fov >= self.upper_fov and self.channels > 1:
            raise ValueError(f"lower_fov {self.lower_fov:g} is not below upper_fov {self.upper_fov:g}")
        if self.columns < 1:
            raise ValueError("points_per_second gives less than one ray per channel and turn")
        return self

    @property
    def columns(self) -> int:
        """Firings of each channel in one turn."""
        return int(self.points_per_second / self.rotation_frequency / self.channels)


class GnssSensor(Section):
    """A satellite receiver: white noise over a slowly wandering (Gauss-Markov) offset."""

    vehicle: str = "ego"
    white_stddev_m: NotNegative = Field(0.3, description="of each horizontal axis; twice that in height")
    drift_stddev_m: NotNegative = Field(1.0, description="of each horizontal axis; twice that in height")
    drift_time_s: Positive = Field(60.0, description="correlation time of the wandering offset")


class Sensors(Section):
    """What the instrumented vehicles carry."""

    lidar: LidarSensor = LidarSensor()
    gnss: GnssSensor = GnssSensor()


class Environment(Section):
    """What stands beside the roads, drawn from the seed."""

    buildings: Probability = Field(0.6, description="share of the building plots that are built on")
    trees_per_km: NotNegative = Field(25.0, le=500, description="per kilometre of kerb")
    poles_per_km: NotNegative = Field(30.0, le=500, description="lamp posts and signs per kilometre of kerb")
    clutter_per_km: NotNegative = Field(12.0, le=500, description="hedges, containers, cabinets")


class Recording(Section):
    """What is written."""

    compression: Literal["none", "lz4", "zstd"] = "zstd"
    markers: bool = Field(True, description="boxes as markers for RViz and Foxglove")


class Scenario(Section):
    """One drive: the whole scenario file."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)
    description: str = ""
    simulation: Simulation = Simulation()
    map: Map
    traffic: Traffic = Traffic()
    vehicles: dict[Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")], Vehicle] = {"ego": Vehicle()}
    sensors: Sensors = Sensors()
    environment: Environment = Environment()
    recording: Recording = Recording()

    @model_validator(mode="after")
    def _combinations(self) -> Scenario:
        if not self.vehicles:
            raise ValueError("vehicles is empty; name at least one, like ego: {}")
        for kind in ("lidar", "gnss"):
            carrier = getattr(self.sensors, kind).vehicle
            if carrier not in self.vehicles:
                known = ", ".join(sorted(self.vehicles))
                raise ValueError(f"sensors.{kind}.vehicle {carrier!r} is none of the vehicles ({known})")
        turn_s = 1 / self.sensors.lidar.rotation_frequency
        if abs(turn_s - self.simulation.step_s) > 1e-9:
            raise ValueError(
                f"one turn of the lidar takes {turn_s:g} s but simulation.step_s is "
                f"{self.simulation.step_s:g} s; make them equal"
            )
        return self
