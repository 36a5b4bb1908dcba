"""One attacked camera over its drive, as attacks may know it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import RecordedCamera, camera_lens
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.compressed_image import UInt8, image_from_cdr
from advpipe.pipeline.scenario.acting import Acting
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.stages.attack.camera.base import CameraImage
from advpipe.stages.attack.camera.scene import CameraScene, CameraSceneReader
from advpipe.stages.attack.camera.scene_light import SceneLight


@dataclass(frozen=True)
class RecordedDrive:
    """A `CameraDrive` of a bag. kept: pictures to leave beside the bag, by file name. acts: when the attack
    acts. plan: see `CameraAttack.plan`."""

    reader: BagReader
    camera: RecordedCamera
    light: SceneLight
    kept: dict[str, UInt8]
    acts: Acting
    plan: Any = None

    def keep(self, name: str, rgb: UInt8) -> None:
        self.kept[f"camera_{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}.png"] = rgb

    def lens(self) -> Lens:
        return camera_lens(self.reader, self.camera)

    def scheduled(self) -> Iterator[tuple[CameraImage, Callable[[], CameraScene]]]:
        scenes, number = CameraSceneReader(self.reader, self.camera), 0
        wanted = sorted({self.camera.image_topic, *scenes.topic_names})
        for time_ns, group in groupby(self.reader.raw_messages(wanted), key=lambda raw: raw.log_time_ns):
            instant = list(group)
            for raw in instant:
                scenes.take(raw)
            for raw in instant:
                if raw.topic.name == self.camera.image_topic:
                    if self.acts(time_ns):
                        image = image_from_cdr(raw.cdr)
                        scene = partial(scenes.scene, image.stamp_ns, image.frame_id)
                        yield CameraImage(image, number), scene
                    number += 1


class SceneTaker:
    """The scenes of a camera while its images pass; without `needed`, it takes and knows nothing.

    Raises AdvpipeError for a bag that lacks what is needed.
    """

    def __init__(self, reader: BagReader, camera: RecordedCamera, needed: bool) -> None:
        self._path = reader.path
        self._scenes = CameraSceneReader(reader, camera) if needed else None
        self.topic_names = self._scenes.topic_names if self._scenes else frozenset[str]()

    def take(self, raw: RawMessage) -> None:
        """Keep what a message of `topic_names` says."""
        if self._scenes is not None:
            self._scenes.take(raw)

    def scene(self, stamp_ns: int, frame_id: str) -> CameraScene:
        """See `CameraSceneReader.scene`. Raises AdvpipeError for an attack that did not ask for it."""
        if self._scenes is None:
            raise UsageError(f"{self._path}: an attack asks for a scene; its traits lack needs_scene=True")
        return self._scenes.scene(stamp_ns, frame_id)
