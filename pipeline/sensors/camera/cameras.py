"""The interface of cameras to the rest of advpipe: scenario section, topics, ground truth and panels."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, ClassVar

from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.sensor import Cadence, DriveSettings, Instant, MountedSensor, Panel, Reading
from advpipe.pipeline.sensors.world import Offer

if TYPE_CHECKING:
    from advpipe.pipeline.sensors.camera.rig import CameraRig

MOST_PIXELS = 40_000_000
"""Limit on the samples of all cameras together."""

BYTES_PER_PIXEL = {"rgb": 0.35, "depth": 0.9, "semantic_segmentation": 0.05, "instance_segmentation": 0.06}
"""Usual sizes of compressed images, which the bag's compression does not make smaller."""


class Cameras(MountedSensor[CameraSensor]):
    """All cameras of one vehicle."""

    title = "camera"
    section = CameraSensor
    default: ClassVar[Mapping[str, CameraSensor]] = {}
    needs = frozenset({"road users", "surfaces"})
    takes_long = True

    def __init__(self, vehicle: str, sections: Mapping[str, CameraSensor], drive: DriveSettings) -> None:
        from advpipe.pipeline.sensors.camera.picture import WORKERS
        from advpipe.pipeline.sensors.camera.rig import CameraRig
        from advpipe.pipeline.sensors.camera.view_messages import OPTICAL, InstanceIds

        self._vehicle, self._sections = vehicle, sections
        self._rig: CameraRig = CameraRig(vehicle, sections, drive)
        self._ids, self._workers = InstanceIds(), ThreadPoolExecutor(WORKERS)
        self.mounts = dict(self._rig.mounts)
        self.mounts |= {name + OPTICAL: self._rig.base_SE3_optical(name) for name in sections}

    def sense(self, instant: Instant) -> Reading:
        from advpipe.pipeline.sensors.camera.view_messages import camera_messages

        views, boxes = self._rig.look(instant)
        messages = [
            message
            for name, view in views.items()
            for message in camera_messages(
                self._vehicle, name, self._sections[name], instant.stamp_ns, view, self._ids, self._workers
            )
        ]
        return Reading(messages, road_users=boxes.ids)

    @classmethod
    def missing_from(cls, offers: frozenset[Offer]) -> list[Offer]:
        """A world's own pictures replace surfaces."""
        return super().missing_from(offers | {"surfaces"} if "pictures" in offers else offers)

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        topics = VehicleTopics(vehicle)
        kinds = ("rgb", "depth", "semantic_segmentation", "instance_segmentation")
        return (
            *(topics.camera_image(name, kind) for kind in kinds),
            topics.camera_info(name),
            topics.visible_boxes(name),
            topics.amodal_boxes(name),
            topics.image_labels(name),
            topics.instance_names(name),
        )

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        return {VehicleTopics(vehicle).camera_image(name, "rgb").name: IMAGE_PANEL}

    @classmethod
    def check(cls, sections: Mapping[str, CameraSensor], step_s: float) -> None:
        for name, camera in sections.items():
            steps = camera.sensor_tick / step_s
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"sensor_tick of sensors.cameras.{name} is {camera.sensor_tick:g} s, which is not a "
                    f"multiple of simulation.step_s {step_s:g} s; change sensor_tick or step_s"
                )
        pixels = sum(each.image_size_x * each.image_size_y * each.samples for each in sections.values())
        if pixels > MOST_PIXELS:
            raise ValueError(
                f"one image of all cameras has {pixels:,} rays, over {MOST_PIXELS:,}; "
                "lower their number, image sizes or samples"
            )

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, CameraSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        topics, found = VehicleTopics(vehicle), dict[str, Cadence]()
        for name, camera in sections.items():
            steps = round(camera.sensor_tick / step_s)
            recorded = [topics.camera_image(name, kind) for kind in camera.images]
            recorded += [topics.camera_info(name), topics.visible_boxes(name), topics.amodal_boxes(name)]
            recorded.append(topics.image_labels(name))
            if "instance_segmentation" in camera.images:
                recorded.append(topics.instance_names(name))
            found |= {topic.name: Cadence(1 / step_s / steps, steps) for topic in recorded}
        return found

    @classmethod
    def bytes_per_s(cls, section: CameraSensor) -> float:
        per_pixel = sum(BYTES_PER_PIXEL[kind] for kind in section.images)
        return section.image_size_x * section.image_size_y * per_pixel / section.sensor_tick


IMAGE_PANEL = Panel(foxglove={}, rviz="Image", rviz_keys={"Normalize Range": False})
"""The panel of a camera's images."""
