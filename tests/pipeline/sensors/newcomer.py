"""A sonar as a newcomer would add one: this file, and its line in the registry.

python newcomer.py simulate drive.yaml    # advpipe with that line in the registry
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from advpipe.pipeline.core.bounds import RangeM
from advpipe.pipeline.core.section import Whole
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.sensor import (
    Cadence,
    DriveSettings,
    Instant,
    MountedSection,
    MountedSensor,
    Panel,
    Reading,
)


class SonarSensor(MountedSection):
    """A fan of beams to the front, at the height of the bumper."""

    beams: Whole = Field(15, ge=1, le=1000)
    range: RangeM = 80.0


class Sonars(MountedSensor[SonarSensor]):
    """All sonars of one vehicle: the radial velocity of what each beam meets, as the intensity of a point."""

    title = "sonar"
    section = SonarSensor
    needs = frozenset({"road users", "rays"})

    def __init__(self, vehicle: str, sections: Mapping[str, SonarSensor], drive: DriveSettings) -> None:
        self._vehicle, self._sections, self._seed = vehicle, sections, drive.seed
        self.mounts = {name: se3_from_yaw([2.0, 0.0, 0.5], 0.0) for name in sections}

    def sense(self, instant: Instant) -> Reading:
        messages, points, seen = [], 0, set[str]()
        for name, section in self._sections.items():
            cloud, users = self._look(name, section, instant)
            frame_id, (topic,) = (
                VehicleTopics(self._vehicle).sensor_frame(name),
                self.topics(self._vehicle, name),
            )
            messages.append((topic, cloud_to_cdr(cloud, instant.stamp_ns, frame_id), instant.stamp_ns))
            points, seen = points + len(cloud), seen | users
        return Reading(messages, len(messages), points, sorted(seen))

    def _look(self, name: str, section: SonarSensor, instant: Instant):
        bearing = np.linspace(-0.4, 0.4, section.beams)
        beams = np.stack([np.cos(bearing), np.sin(bearing), np.zeros_like(bearing)], axis=1)
        map_SE3_sonar = instant.motion.map_SE3_base @ self.mounts[name]
        directions = beams @ map_SE3_sonar[:3, :3].T
        origin = np.broadcast_to(map_SE3_sonar[:3, 3], directions.shape)
        users = instant.world.road_users(section.range)
        rays = np.concatenate([origin, directions], axis=1).astype(np.float32)
        hits = instant.world.cast(rays, section.range)
        met = np.flatnonzero(hits.range_m < section.range)
        velocities = np.concatenate([users.velocity_mps, np.zeros((1, 3))])[hits.objects[met]]
        rng = named_generator(self._seed, "sonar", self._vehicle, name, instant.frame)
        cloud = np.zeros(len(met), POINT_DTYPE)
        range_m = hits.range_m[met] + rng.normal(0, 0.1, len(met))
        cloud["x"], cloud["y"], cloud["z"] = (beams[met] * range_m[:, None]).T
        cloud["intensity"] = ((velocities - instant.motion.velocity_mps) * directions[met]).sum(axis=1)
        return cloud, {users.ids[index] for index in hits.objects[met] if index >= 0}

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        return (Topic(f"/{vehicle}/{name}/returns", "sensor_msgs/msg/PointCloud2", keep_last(5)),)

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        panel = Panel({"colorField": "intensity", "pointSize": 9}, "PointCloud2", {"Style": "Boxes"})
        return {topic.name: panel for topic in cls.topics(vehicle, name)}

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, SonarSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        return {
            topic.name: Cadence(1 / step_s, 1) for name in sections for topic in cls.topics(vehicle, name)
        }


if __name__ == "__main__":
    from advpipe.pipeline.sensors import registry

    registry.SENSORS["sonars"] = Sonars  # what the newcomer writes into the registry

    from advpipe.pipeline.cli import app

    app()
