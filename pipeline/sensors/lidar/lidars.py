"""The interface of LiDARs to the rest of advpipe: scenario section, topics, ground truth and panels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.sensor import Cadence, DriveSettings, Instant, MountedSensor, Panel, Reading
from advpipe.pipeline.sensors.world import Offer

MOST_RAYS = 10_000_000
"""Limit on one turn of all LiDARs together; a ray needs a few hundred bytes of memory."""

POINT_BYTES = 22


class Lidars(MountedSensor[LidarSensor]):
    """All LiDARs of one vehicle."""

    title = "LiDAR"
    section = LidarSensor
    default: ClassVar = {"lidar": LidarSensor()}
    needs = frozenset({"road users", "rays"})

    def __init__(self, vehicle: str, sections: Mapping[str, LidarSensor], drive: DriveSettings) -> None:
        from advpipe.pipeline.sensors.lidar.rig import LidarRig

        self._vehicle, self._drive = vehicle, drive
        self._rig = LidarRig(vehicle, sections, drive)
        self.mounts = {name: lidar.base_SE3_lidar for name, lidar in self._rig.lidars.items()}

    def sense(self, instant: Instant) -> Reading:
        from advpipe.pipeline.sensors.lidar.view_messages import view_messages

        view = self._rig.look(instant)
        if view is None:
            return Reading()
        return Reading(
            view_messages(self._vehicle, instant.stamp_ns, view, self._drive.markers),
            len(view.clouds),
            sum(map(len, view.clouds.values())),
            view.boxes.ids,
        )

    @classmethod
    def missing_from(cls, offers: frozenset[Offer]) -> list[Offer]:
        """A world's own scans replace rays."""
        return super().missing_from(offers | {"rays"} if "scans" in offers else offers)

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        return (VehicleTopics(vehicle, name).lidar_points,)

    @classmethod
    def truth(cls, vehicle: str) -> tuple[Topic, ...]:
        topics = VehicleTopics(vehicle)
        return topics.objects, topics.road_users

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        return {topic.name: CLOUD_PANEL for topic in cls.topics(vehicle, name)}

    @classmethod
    def check(cls, sections: Mapping[str, LidarSensor], step_s: float) -> None:
        for name, lidar in sections.items():
            turn_s = 1 / lidar.rotation_frequency
            steps = turn_s / step_s
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"one turn of sensors.lidars.{name} takes {turn_s:g} s, which is not a multiple of "
                    f"simulation.step_s {step_s:g} s; change rotation_frequency or step_s"
                )
        rays = sum(lidar.columns * lidar.channels for lidar in sections.values())
        if rays > MOST_RAYS:
            raise ValueError(
                f"one turn of all LiDARs has {rays:,} rays, over {MOST_RAYS:,}; "
                "lower their number or their points_per_second"
            )

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, LidarSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        found: dict[str, Cadence] = {}
        for name, lidar in sections.items():
            steps = round(1 / step_s / lidar.rotation_frequency)
            cadence = Cadence(1 / step_s / steps, steps)
            found |= {topic.name: cadence for topic in cls.topics(vehicle, name)}
        if len(set(found.values())) == 1:
            found |= {topic.name: next(iter(found.values())) for topic in cls.truth(vehicle)}
        return found

    @classmethod
    def bytes_per_s(cls, section: LidarSensor) -> float:
        return section.points_per_second * POINT_BYTES


CLOUD_PANEL = Panel(
    foxglove={"colorMode": "colormap", "colorMap": "turbo", "colorField": "intensity", "pointSize": 2},
    rviz="PointCloud2",
    rviz_keys={
        "Style": "Points",
        "Size (Pixels)": 2,
        "Color Transformer": "Intensity",
        "Channel Name": "intensity",
        "Autocompute Intensity Bounds": True,
        "Use rainbow": True,
    },
)
"""The panel of any cloud with intensities, also from other tools."""
