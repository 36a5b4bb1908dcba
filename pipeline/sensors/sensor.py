"""The seam of sensors: all that the rest of advpipe has to know of a kind of sensor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from advpipe.pipeline.core.section import Section, Word
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Offer, Surroundings

SectionT = TypeVar("SectionT", bound=Section)
MountedT = TypeVar("MountedT", bound="MountedSection")


class MountedSection(Section):
    """What every sensor that is carried by name has in the scenario file."""

    vehicle: Word = "ego"


@dataclass(frozen=True)
class Cadence:
    """How often a topic comes. steps: of the simulation from one message to the next, where these make it."""

    rate_hz: float
    steps: int | None = None


@dataclass(frozen=True)
class Panel:
    """How viewers show one topic.

    foxglove: of the topic in a 3D panel, beside its visibility. rviz: the class of its display, without the
    plug-in's name; rviz_keys: its properties beside the topic, and depth that of its queue.
    """

    foxglove: Mapping[str, Any]
    rviz: str
    rviz_keys: Mapping[str, Any]
    depth: int = 5


@dataclass(frozen=True)
class DriveSettings:
    """What the sensors of a drive are made with. markers: whether truth is drawn for viewers as well."""

    seed: int
    step_s: float
    weather: Weather
    markers: bool


@dataclass(frozen=True)
class Instant:
    """One step of the drive: when, how the vehicle truly moves, and what is around it."""

    frame: int
    stamp_ns: int
    motion: MotionStep
    world: Surroundings


@dataclass(frozen=True)
class Reading:
    """What sensors say at one instant.

    messages: measurements and their ground truth, in the order in which they are recorded. clouds: how many
    point clouds, of so many points together. road_users: ids of those that were in range.
    """

    messages: Sequence[StampedCdr] = ()
    clouds: int = 0
    points: int = 0
    road_users: Sequence[str] = field(default=())


class Sensor(ABC, Generic[SectionT]):
    """One kind of sensor. Its key in the scenario's section `sensors` is that of the registry.

    title: what readers of a data set's card know it by. section: its part of the scenario file.
    """

    title: ClassVar[str]
    section: ClassVar[type[Section]]

    @classmethod
    @abstractmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        """Type and default of its key in `sensors`, as pydantic's `create_model` takes them."""

    @classmethod
    @abstractmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, SectionT]:
        """Those of one vehicle by name, of what its key in `sensors` holds."""

    @classmethod
    @abstractmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        """What one sensor measures, with types and quality of service."""

    @classmethod
    def truth(cls, vehicle: str) -> tuple[Topic, ...]:
        """The ground truth that comes with each measurement, of all sensors of this kind together."""
        return ()

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        """How viewers show its topics, by their names; those left out are not shown."""
        return {}

    @classmethod
    def check(cls, sections: Mapping[str, SectionT], step_s: float) -> None:
        """ValueError where those of a drive, by name, do not fit its step or ask for too much."""

    @classmethod
    def cadences(cls, vehicle: str, sections: Mapping[str, SectionT], step_s: float) -> Mapping[str, Cadence]:
        """How often the topics of one vehicle come, by their names, as far as the scenario decides it."""
        return {}

    @classmethod
    def bytes_per_s(cls, section: SectionT) -> float:
        """What one sensor takes in a bag, before compression."""
        return 0.0


class OnBoardSensor(Sensor[SectionT]):
    """One of which every instrumented vehicle carries one; `pipeline/localisation` simulates it."""

    @classmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        return cls.section, cls.section()

    @classmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, SectionT]:
        return {"": configured}


class MountedSensor(Sensor[MountedT]):
    """One that looks at the world, carried by name; an instance is all those of this kind on one vehicle.

    default: what a scenario that does not name any has. needs: what the world has to offer.
    mounts: base_SE3_sensor by name; each has the frame `<vehicle>/<name>`.
    """

    default: ClassVar[Mapping[str, MountedSection]] = {}
    needs: ClassVar[frozenset[Offer]] = frozenset()
    mounts: Mapping[str, Float64]

    @abstractmethod
    def __init__(self, vehicle: str, sections: Mapping[str, MountedT], drive: DriveSettings) -> None: ...

    @abstractmethod
    def sense(self, instant: Instant) -> Reading:
        """What they say at this instant; an empty reading between two measurements.

        Chance comes from `named_generator(drive.seed, ...)` with names of its own.
        """

    @classmethod
    def scenario_field(cls) -> tuple[Any, Any]:
        from pydantic import Field

        from advpipe.pipeline.core.section import Name

        return dict[Name, cls.section], Field(  # type: ignore[name-defined]  # made for pydantic
            dict(cls.default), max_length=100, description="by name"
        )

    @classmethod
    def carried_by(cls, vehicle: str, configured: Any) -> Mapping[str, MountedT]:
        return {name: section for name, section in configured.items() if section.vehicle == vehicle}
