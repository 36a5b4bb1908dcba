"""The attacks on one camera, each applied to the images of its schedule, with what they did to each image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.image_quantities import IMAGE_QUANTITIES, ImageChange
from advpipe.pipeline.labels.images import DELAYED, DROPPED, EDGES, PAINTED, REPLACED
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.messages.compressed_image import pixels_of
from advpipe.stages.attack.camera.base import (
    AttackedImage,
    CameraImage,
    ImageAttacker,
    ImageContext,
)
from advpipe.stages.attack.camera.planned import PlannedAttack
from advpipe.stages.attack.camera.scene import CameraScene

Row = dict[str, object]


@dataclass
class _ScheduledImageAttack:
    """One attack, the start of its current span of attacked images, and the last image that left it."""

    planned: PlannedAttack
    begin_ns: int | None = None
    previous: CameraImage | None = None
    attacker: ImageAttacker | None = None


@dataclass
class TouchedImage:
    """An image after the attacks: None if it never arrives. rows: of the labels. delayed_by: the attack that
    holds it up last. delay_ns: of all of them."""

    image: CameraImage | None
    delay_ns: int = 0
    delayed_by: str = ""
    rows: list[Row] = field(default_factory=list)


class ImageAttackSchedule:
    """All attacks on one camera, in the order of the request; call `of` for each of its images in order.

    topic: of the images.
    """

    def __init__(self, attacks: Sequence[PlannedAttack], topic: str) -> None:
        self._attacks, self._topic = list(map(_ScheduledImageAttack, attacks)), topic
        self.needs_scene = any(each.attack.traits.needs_scene for each in attacks)

    def of(self, time_ns: int, image: CameraImage, scene: Callable[[], CameraScene]) -> TouchedImage:
        """What the attacks make of a clean image.

        Raises AdvpipeError for an image beyond the bounds that an attack declares.
        """
        touched = TouchedImage(image)
        for one in self._attacks:
            given = touched.image
            if given is None:
                break
            if not one.planned.is_active(time_ns):
                one.begin_ns, one.previous = None, given
                continue
            one.begin_ns = time_ns if one.begin_ns is None else one.begin_ns
            if one.attacker is None:
                one.attacker = one.planned.begin(self._topic)
            context = ImageContext((time_ns - one.begin_ns) / 1e9, one.previous, scene)
            result = one.attacker(given, context)
            _take(touched, one.planned, given, result)
            one.previous = result.image or one.previous
        return touched


def _take(touched: TouchedImage, one: PlannedAttack, given: CameraImage, result: AttackedImage) -> None:
    """What one attack made of an image. Raises AdvpipeError beyond its bounds."""
    name = one.spec.type
    change = _change(given, result)
    for excess in excesses(change, one.bounds, IMAGE_QUANTITIES):
        raise AdvpipeError(f"{name} went beyond its bounds: {excess}")
    if result.image is None:
        touched.image, touched.rows = None, [{"attack": name, "action": DROPPED}]
        return
    if change.other:
        touched.rows = [{"attack": name, "action": REPLACED, "source": result.image.number}]
    if result.painted is not None:
        edges = dict(zip(EDGES, result.painted.edges_px, strict=True))
        own: Row = {"pixels": result.painted.pixels, "target": result.painted.target}
        touched.rows.append({"attack": name, "action": PAINTED, **edges, **own})
    elif result.image.stamped != given.stamped and not change.other:
        raise AdvpipeError(f"{name} changed an image without saying where (AttackedImage.painted)")
    touched.image = result.image
    if result.delay_ns:
        touched.delay_ns += result.delay_ns
        touched.delayed_by = name


def _change(given: CameraImage, result: AttackedImage) -> ImageChange:
    if result.image is None:
        return ImageChange(is_dropped=True)
    share = 0.0
    if result.painted is not None:
        left, top, right, bottom = result.painted.edges_px
        height, width = pixels_of(given.stamped.file).shape[:2]
        share = (right - left + 1) * (bottom - top + 1) / (width * height)
    return ImageChange(
        delay_s=result.delay_ns / 1e9, other=result.image.number != given.number, pixel_share=share
    )


def delayed_row(attack: str, delay_ns: int) -> Row:
    """The label of an image that arrives late."""
    return {"attack": attack, "action": DELAYED, "delay_ns": delay_ns}
