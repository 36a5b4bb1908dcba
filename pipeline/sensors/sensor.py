"""The interface of sensor types: everything that the rest of advpipe uses of a sensor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import Field

from advpipe.pipeline.core.section import Reference, Section
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Offer, Surroundings

SectionT = TypeVar("SectionT", bound=Section)
MountedT = TypeVar("MountedT", bound="MountedSection")


class MountedSection(Section):
    """The keys of every mounted sensor in the scenario file."""

    vehicle: Reference = Field("ego", description="name of the instrumented vehicle that carries it")


@dataclass(frozen=True)
class Cadence:
    """The rate of a topic. steps: simulation steps between messages, if steps determine the rate."""

    rate_hz: float
    steps: int | None = None


@dataclass(frozen=True)
class Panel:
    """The settings with which viewers show one topic.

    foxglove: settings of the topic in a 3D panel, besides its visibility. rviz: the class of its display,
    without the plug-in's name; rviz_keys: its properties besides the topic; depth: the length of its queue.
    """

    foxglove: Mapping[str, Any]
    rviz: str
    rviz_keys: Mapping[str, Any]
    depth: int = 5


@dataclass(frozen=True)
class DriveSettings:
    """The settings that a drive's sensors share. markers: whether to record ground-truth markers for
    viewers. latitude_deg, longitude_deg: of the map's origin."""

    seed: int
    step_s: float
    weather: Weather
    markers: bool
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0


@dataclass(frozen=True)
class Instant:
    """One step of the drive: the time, the vehicle's true motion, and its surroundings."""

    frame: int
    stamp_ns: int
    motion: MotionStep
    world: Surroundings


@dataclass(frozen=True)
class Reading:
    """The measurements of sensors at one instant.

    messages: measurements and their ground truth, in recording order. clouds: number of
    point clouds; points: in all of them together. road_users: ids of those in range.
    """

    messages: Sequence[StampedCdr] = ()
    clouds: int = 0
    points: int = 0
    road_users: Sequence[str] = field(default=())


class Sensor(ABC, Generic[SectionT]):
    """One sensor type. Its key in the scenario's section `sensors` is that of the registry.

    title: its name in a data set's card. section: its part of the scenario file.
    """

    title: ClassVar[str]
    section: ClassVar[type[Section]]

    @classmethod
    @abstractmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        """Type and default of its key in `sensors`, in the form that pydantic's `create_model` takes."""

    @classmethod
    @abstractmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, SectionT]:
        """The sensors of one vehicle by name, from the value of its key in `sensors`."""

    @classmethod
    @abstractmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        """The topics of one sensor's measurements, with types and quality of service."""

    @classmethod
    def truth(cls, vehicle: str) -> tuple[Topic, ...]:
        """The topics of ground truth for the measurements of all sensors of this type together."""
        return ()

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        """How viewers show its topics, by topic name; missing ones are not shown."""
        return {}

    @classmethod
    def check(cls, sections: Mapping[str, SectionT], step_s: float) -> None:
        """Raise ValueError where a drive's sensors, by name, do not fit its step or exceed a limit."""

    @classmethod
    def cadences(cls, vehicle: str, sections: Mapping[str, SectionT], step_s: float) -> Mapping[str, Cadence]:
        """The rates of one vehicle's topics by topic name, as far as the scenario decides them."""
        return {}

    @classmethod
    def bytes_per_s(cls, section: SectionT) -> float:
        """Bytes per second of one sensor in a bag, before compression."""
        return 0.0


class OnBoardSensor(Sensor[SectionT]):
    """A sensor that every instrumented vehicle carries once; `pipeline/localisation` simulates it."""

    @classmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        return cls.section, cls.section()

    @classmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, SectionT]:
        return {"": configured}


class MountedSensor(Sensor[MountedT]):
    """A named sensor that observes the world; one instance stands for all of this type on one vehicle.

    default: the sensors of a scenario that lists none. needs: the methods that the world must offer.
    takes_long: whether they take about as long as all other sensors together, and are worth a process of
    their own. mounts: base_SE3_sensor by name; each has the frame `<vehicle>/<name>`.
    """

    default: ClassVar[Mapping[str, MountedSection]] = {}
    needs: ClassVar[frozenset[Offer]] = frozenset()
    takes_long: ClassVar[bool] = False
    mounts: Mapping[str, Float64]

    @abstractmethod
    def __init__(self, vehicle: str, sections: Mapping[str, MountedT], drive: DriveSettings) -> None: ...

    @abstractmethod
    def sense(self, instant: Instant) -> Reading:
        """The measurements at this instant; an empty reading between two measurements.

        Random numbers must come from `named_generator(drive.seed, ...)` with unique names.
        """

    @classmethod
    def missing_from(cls, offers: frozenset[Offer]) -> list[Offer]:
        """What these sensors need, and a world with these offers lacks."""
        return sorted(cls.needs - offers)

    @classmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        from advpipe.pipeline.core.section import Name

        return dict[Name, cls.section], Field(  # type: ignore[name-defined]  # made for pydantic
            dict(cls.default), max_length=100, description=f"{cls.title} sensors by name"
        )

    @classmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, MountedT]:
        return {name: section for name, section in configured.items() if section.vehicle == vehicle}
