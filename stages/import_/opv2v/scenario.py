"""A scenario of OPV2V as a drive of several vehicles."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.geometry.carla import se3_from_carla
from advpipe.pipeline.geometry.transforms import Float64, invert, se3, transform_points, wrap_angle, yaw_of
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.labelled import NO_VELOCITY, LabelledObject, sort_objects
from advpipe.stages.import_.opv2v.annotation import Annotation, SurroundingVehicle, read_annotation
from advpipe.stages.import_.opv2v.pcd import read_opv2v_cloud

TICK_S = 0.05
"""Of CARLA in OPV2V; files are numbered by ticks, and every second one is written."""

UNIT_HEIGHT_M = 0.0
"""Of the base of a roadside unit, whose files state no pose of a vehicle: the LiDAR's own place."""


@dataclass(frozen=True)
class Agent:
    """A vehicle or roadside unit. number: the folder's name. name: its namespace. ticks: of its files."""

    number: str
    name: str
    folder: Path
    ticks: frozenset[str]

    @cached_property
    def base_SE3_lidar(self) -> Float64:
        """The LiDAR's mount, as the first file tells it; identity where that has no pose of the vehicle."""
        first = read_annotation(self.folder / f"{min(self.ticks)}.yaml")
        if first.true_ego_pos is None:
            return se3(np.eye(3), [0, 0, UNIT_HEIGHT_M])
        return invert(se3_from_carla(first.true_ego_pos)) @ se3_from_carla(first.lidar_pose)


@dataclass(frozen=True)
class Opv2vScenario:
    """Clouds and boxes of each agent, mirrored to right-handed coordinates; boxes in the map's frame.

    interval_s: between frames; None to take the ticks in the names of the files.
    """

    name: str
    agents: Sequence[Agent]
    class_map: Mapping[str, str] = field(repr=False)
    default_class: str
    interval_s: float | None = None
    are_related: bool = True

    @cached_property
    def ticks(self) -> Sequence[str]:
        """The names of the instants: those of the first agent, in time order."""
        return sorted(self.agents[0].ticks, key=lambda tick: (int(tick), tick))

    @property
    def frame_count(self) -> int:
        return len(self.ticks)

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        """The mount of each agent's LiDAR."""
        topics = ((VehicleTopics(agent.name), agent) for agent in self.agents)
        return [(own.base_frame, own.lidar_frame, agent.base_SE3_lidar) for own, agent in topics]

    @property
    def notes(self) -> Sequence[str]:
        """How the scenario was understood."""
        agents = ", ".join(f"{agent.number} is {agent.name}" for agent in self.agents)
        notes = [
            f"Agents: {agents}.",
            "CARLA's left-handed coordinates are mirrored: y points to the left. Boxes keep their heading, "
            "and lose roll and pitch.",
        ]
        missing = {agent.number: len(set(self.ticks) - agent.ticks) for agent in self.agents}
        missing = {number: count for number, count in missing.items() if count}
        notes += [f"Agent {number} lacks {counted(count, 'frame')}." for number, count in missing.items()]
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The instants from the index `first` on, with the agents that have files for them."""
        for index, tick in enumerate(self.ticks[first:], first):
            vehicles = {
                agent.name: self._vehicle(agent, tick) for agent in self.agents if tick in agent.ticks
            }
            elapsed_s = int(tick) * TICK_S if self.interval_s is None else index * self.interval_s
            yield DriveFrame(f"{self._folder / tick}.pcd", round(elapsed_s * 1e9), vehicles, tick)

    def class_names(self) -> Collection[str]:
        """The classes of the vehicles in all files."""
        files = (agent.folder / f"{tick}.yaml" for agent in self.agents for tick in sorted(agent.ticks))
        return {_class_of(each) for file in files for each in read_annotation(file).vehicles.values()}

    @property
    def _folder(self) -> Path:
        return self.agents[0].folder

    def _vehicle(self, agent: Agent, tick: str) -> VehicleFrame:
        file = agent.folder / f"{tick}.pcd"
        if not file.is_file():
            raise UsageError(f"{file} is missing, though {tick}.yaml labels it; complete the download")
        cloud, annotation = read_opv2v_cloud(file), read_annotation(agent.folder / f"{tick}.yaml")
        map_SE3_lidar = se3_from_carla(annotation.lidar_pose)
        found = sort_objects(self._objects(annotation), self.class_map, self.default_class)
        return VehicleFrame(
            {"lidar": cloud},
            found.boxes,
            MAP_FRAME,
            found.ignored,
            map_SE3_base=map_SE3_lidar @ invert(agent.base_SE3_lidar),
            lidar_points=_count(cloud, found.boxes.geometry, map_SE3_lidar),
        )

    def _objects(self, annotation: Annotation) -> Iterator[LabelledObject]:
        names = {agent.number: agent.name for agent in self.agents}
        for number, vehicle in annotation.vehicles.items():
            yield _labelled(vehicle, names.get(number, number))


def _labelled(vehicle: SurroundingVehicle, name: str) -> LabelledObject:
    """The box as OpenCOOD's `project_world_objects` builds it, without roll and pitch."""
    centre = [a + b for a, b in zip(vehicle.location, vehicle.center, strict=True)]
    pose = se3_from_carla([*centre, *vehicle.angle])
    sizes_m = (2 * half for half in vehicle.extent)
    velocity = NO_VELOCITY
    if vehicle.speed is not None:
        velocity = tuple((pose[:3, 0] * vehicle.speed / 3.6).tolist())
    box = (*pose[:3, 3].tolist(), *sizes_m, yaw_of(pose))
    return LabelledObject(_class_of(vehicle), name, box, velocity)


def _class_of(vehicle: SurroundingVehicle) -> str:
    return vehicle.obj_type or vehicle.bp_id or "vehicle"


def _count(cloud: Cloud, boxes: Float64, map_SE3_lidar: Float64) -> npt.NDArray[np.int64]:
    """How many points lie in each of the boxes (M, 7) of the map's frame."""
    lidar_SE3_map = invert(map_SE3_lidar)
    in_lidar = boxes.copy()
    in_lidar[:, :3] = transform_points(lidar_SE3_map, boxes[:, :3])
    in_lidar[:, 6] = wrap_angle(boxes[:, 6] + yaw_of(lidar_SE3_map))
    return count_points(xyz(cloud), in_lidar)
