"""Whether labels of camera images state exactly what differs between both bags."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.labels.image_quantities import IMAGE_QUANTITIES, ImageChange
from advpipe.pipeline.labels.images import DELAYED, DROPPED, EDGES, FILE, PAINTED, REPLACED
from advpipe.pipeline.labels.quantity import Range, beyond_all
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.compressed_image import StampedImage, image_from_cdr, pixels_of
from advpipe.pipeline.scenario.acting import Acting
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.checks.painted import paint_fault
from advpipe.stages.verify.checks.painted_objects import PaintedObjects
from advpipe.stages.verify.declared_bounds import undeclared
from advpipe.stages.verify.result import Fault, Result

LabelRow = Mapping[str, Any]
Acts = Mapping[str, tuple[Acting, Mapping[str, Range]]]


@dataclass(frozen=True)
class _ImagePair:
    """An image in the clean bag, and in the attacked one, where it arrives."""

    number: int
    clean: RawMessage
    attacked: RawMessage | None
    base: StampedImage
    shown: StampedImage | None

    @property
    def delay_ns(self) -> int:
        """By which it arrives late."""
        return self.attacked.log_time_ns - self.clean.log_time_ns if self.attacked else 0


class Images(BagCheck):
    """Compares the main images of each attacked camera: those without a label are copies; the rest are
    dropped, delayed, replaced or painted on as their labels say, and nowhere else."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        path = attacked.table(FILE)
        if not path.is_file():
            return
        where = self.bag.subject.place(path)
        attacks = attacked.of_family("camera")
        yield from undeclared(self.bag.place, attacks, IMAGE_QUANTITIES)
        acts = attacked.acts(attacks, IMAGE_QUANTITIES)
        labels: dict[tuple[str, int], list[LabelRow]] = defaultdict(list)
        for row in rows(path):
            labels[row["topic"], row["image"]].append(row)
        for camera in cameras_of(attacked.clean):
            if camera.image_topic not in attacked.replaced:
                continue
            truth = PaintedObjects(attacked.clean, camera)
            for pair in _pairs(attacked, camera.image_topic):
                own = labels.pop((camera.image_topic, pair.number), [])
                what = next(_faults(attacked.clean, pair, own, acts, truth), None)
                if what is not None:
                    yield Fault(where, f"image {pair.number} of {camera.image_topic} {what}")
        for topic, number in list(labels)[:1]:
            yield Fault(where, f"labels image {number} of {topic}, which the bags do not hold")


def _pairs(attacked: AttackedBag, topic: str) -> Iterator[_ImagePair]:
    """The images of the clean bag in order, each with that of its stamp in the attacked bag."""
    present = topic in attacked.adversarial.topics
    others = attacked.adversarial.raw_messages([topic]) if present else iter(())
    waiting = next(others, None)
    shown = image_from_cdr(waiting.cdr) if waiting else None
    for number, raw in enumerate(attacked.clean.raw_messages([topic])):
        base = image_from_cdr(raw.cdr)
        if shown is None or waiting is None or shown.stamp_ns != base.stamp_ns:
            yield _ImagePair(number, raw, None, base, None)
            continue
        yield _ImagePair(number, raw, waiting, base, shown)
        waiting = next(others, None)
        shown = image_from_cdr(waiting.cdr) if waiting else None
    if waiting is not None:
        raise ValueError(f"{topic} holds an image at {waiting.log_time_ns} ns that is not of the clean bag")


def _faults(
    clean: BagReader, pair: _ImagePair, labels: Sequence[LabelRow], acts: Acts, truth: PaintedObjects
) -> Iterator[str]:
    by_action: dict[str, LabelRow] = {}
    for label in labels:
        if label["action"] not in (DROPPED, DELAYED, REPLACED, PAINTED):
            yield f"has a label with the unknown action {label['action']}"
            return
        if label["attack"] not in acts or not acts[label["attack"]][0](pair.clean.log_time_ns):
            yield f"has a label of {label['attack']}, which was not active"
        if label["stamp_ns"] != pair.base.stamp_ns:
            yield "has a label with another stamp"
        by_action[label["action"]] = label
    if (pair.attacked is None) != (DROPPED in by_action):
        yield "is missing without a label" if pair.attacked is None else "is there, but labelled as dropped"
    if pair.attacked is None or pair.shown is None:
        yield from _beyond(pair, labels, acts, ImageChange(is_dropped=True))
        return
    if not labels and pair.attacked.cdr != pair.clean.cdr:
        yield "was changed without a label"
    stated_ns = by_action[DELAYED]["delay_ns"] if DELAYED in by_action else 0
    if pair.delay_ns != stated_ns:
        yield f"is {pair.delay_ns} ns late, but labelled with {stated_ns}"
    yield from _content_faults(clean, pair, labels, by_action)
    yield from _beyond(pair, labels, acts, _measured(pair, by_action, truth))


def _content_faults(
    clean: BagReader, pair: _ImagePair, labels: Sequence[LabelRow], by_action: Mapping[str, LabelRow]
) -> Iterator[str]:
    """What is wrong with the header and the pixels."""
    base, shown = pair.base, pair.shown
    assert shown is not None
    if (base.frame_id, base.encoding) != (shown.frame_id, shown.encoding):
        yield "has another header than in the clean bag"
    file = base.file
    if REPLACED in by_action:
        number = by_action[REPLACED]["source"]
        times_ns = clean.log_times_ns(pair.clean.topic.name)
        if number is None or not 0 <= number < len(times_ns) or number == pair.number:
            yield "has a label that names no other image"
            return
        time_ns = int(times_ns[number])
        earlier = next(clean.raw_messages([pair.clean.topic.name], time_ns, time_ns))
        file = image_from_cdr(earlier.cdr).file
    painted = [label for label in labels if label["action"] == PAINTED]
    if not painted and shown.file != file:
        yield "shows something else than its labels say"
    elif painted:
        areas = [(tuple(label[edge] for edge in EDGES), label["pixels"]) for label in painted]
        yield from paint_fault(file, shown.file, areas)


def _measured(pair: _ImagePair, by_action: Mapping[str, LabelRow], truth: PaintedObjects) -> ImageChange:
    share, extent_m = 0.0, None
    if PAINTED in by_action:
        left, top, right, bottom = (by_action[PAINTED][edge] for edge in EDGES)
        height, width = pixels_of(pair.base.file).shape[:2]
        share = (right - left + 1) * (bottom - top + 1) / (width * height)
        if target := by_action[PAINTED]["target"]:
            extent_m = truth.extent_m(pair.base, target, (left, top, right, bottom))
    is_other = REPLACED in by_action
    return ImageChange(delay_s=pair.delay_ns / 1e9, other=is_other, pixel_share=share, extent_m=extent_m)


def _beyond(pair: _ImagePair, labels: Sequence[LabelRow], acts: Acts, change: ImageChange) -> Iterator[str]:
    """How an image exceeds the bounds of the only attack on it."""
    names = {label["attack"] for label in labels if label["attack"] in acts}
    if len(names) == 1 and (what := beyond_all(change, [acts[name][1] for name in names], IMAGE_QUANTITIES)):
        yield f"exceeds the bounds of {names.pop()}: {what}"
