"""The evaluation of one bag's V2X: detection, Local Dynamic Maps, collision warnings, the radio channel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_statistics import read_statistics
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.messages import MessageLabel, read_labels
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS
from advpipe.pipeline.misbehaviour.roads import RoadMap
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector
from advpipe.pipeline.replay.roads import roads_of_bag
from advpipe.pipeline.results.v2x import RadioMetrics, Warnings
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.stages.evaluate.v2x.collision import known_of_radio, warnings
from advpipe.stages.evaluate.v2x.detection import Detection, detect, published_f1
from advpipe.stages.evaluate.v2x.ldm_error import Known, LdmError, Moment, ldm_error, moments
from advpipe.stages.evaluate.v2x.missing_data import missing_data
from advpipe.stages.evaluate.v2x.radio import MessageNumbers, radio_metrics
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.recording import read_recording


@dataclass(frozen=True)
class EvaluatedDrive:
    """One evaluated bag; the clean one has no labels.

    moments, errors, warned, received: by listener. radio: None for a part of a drive, and without
    statistics in the bag. roads: None without roads in the bag: the checks that need them are off.
    missing_data: a sentence on each other thing that the bag lacks. labels: of all messages, while
    detection is of CAMs alone, without attacks on other types. attack: the names of all in one text; empty
    for a clean bag.
    """

    name: str
    detection: Detection
    moments: dict[str, list[Moment]]
    errors: dict[str, LdmError]
    warned: dict[str, Warnings]
    received: dict[str, MessageNumbers]
    radio: RadioMetrics | None
    labels: list[MessageLabel]
    roads: RoadMap | None
    missing_data: tuple[str, ...] = ()
    attack: str = ""

    def honest(self, listener: str) -> frozenset[int]:
        """Numbers of the messages that others sent near a listener and that no attack touched."""
        return self.received[listener].near - {label.number for label in self.labels}

    def delivered(self, listener: str, numbers: frozenset[int]) -> float:
        """The share of these messages that a listener received; NaN where that is unknown."""
        return self.received[listener].delivered(numbers) if listener in self.received else math.nan

    def wrong(self, listener: str) -> Float64:
        """Number of false, missing and displaced entries of a listener's map, at each of its moments."""
        error = self.errors[listener]
        return error.false_entries + error.missing + error.displaced

    @property
    def attacked_ns(self) -> tuple[int, int] | None:
        """When the first attacked message was sent, and when the last; None where none was."""
        times_ns = [label.time_ns for label in self.labels]
        return (min(times_ns), max(times_ns)) if times_ns else None

    @property
    def most_affected_listener(self) -> str | None:
        """The listener whose map is the most wrong; None in a drive without any."""
        return max(self.errors, key=lambda one: float(np.nansum(self.wrong(one))), default=None)

    def maps_around_attack(self, listener: str) -> tuple[Moment, Moment]:
        """The last map before the first false message, or the first of all; and the one with most false
        entries nearby, or as many and more wrong ones, from then to the last false message, or after it if
        none was recorded in between."""
        found = self.moments[listener]
        false_ns = [label.time_ns for label in self.labels] or [0]
        times_ns = np.array([moment.time_ns for moment in found])
        before = np.flatnonzero(times_ns <= min(false_ns))
        after = times_ns > min(false_ns)
        during = after & (times_ns <= max(false_ns))
        wrong = self.wrong(listener)
        chosen = np.flatnonzero(during if during.any() else after).tolist() or [int(np.argmax(wrong))]
        worst = max(chosen, key=lambda place: (found[place].false_nearby, wrong[place]))
        return found[before[-1] if len(before) else 0], found[worst]


def read_drive(
    bag: Path,
    name: str,
    detectors: Mapping[str, MisbehaviourDetector] = MISBEHAVIOUR_DETECTORS,
    window: Window = WHOLE_DRIVE,
) -> EvaluatedDrive:
    """Evaluate the V2X of a bag.

    window: the part of the drive that is evaluated; detectors run from the drive's beginning to its end.

    Raises AdvpipeError for a bag whose V2X or labels cannot be read.
    """
    reader = BagReader(bag)
    labels = read_labels(bag)
    recording = read_recording(reader, window.end_ns)
    receptions = read_receptions(reader, window, recording)
    listeners = [each.listener for each in receptions]
    spared = attacks_beside_cams(reader.provenance)
    on_cams = [label for label in labels if label.attack not in spared]
    found = {one: list(moments(reader, one, recording.expiry_s, window)) for one in listeners}
    return EvaluatedDrive(
        name,
        detect(receptions, on_cams, detectors, published_f1(reader.provenance), window),
        found,
        {one: ldm_error(found[one]) for one in listeners},
        {
            one: warnings(found[one], _own_estimates(reader, one, found[one], window.last_ns))
            for one in listeners
        },
        {each.listener: MessageNumbers.of(each) for each in receptions},
        radio_metrics(read_statistics(reader)) if window == WHOLE_DRIVE else None,
        [label for label in labels if window.is_before_end(label.time_ns)],
        roads_of_bag(reader),
        tuple(missing_data(reader, receptions, bool(labels))),
        " + ".join(sorted({label.attack for label in labels})),
    )


def attacks_beside_cams(provenance: Provenance) -> frozenset[str]:
    """The attacks of a bag that change other messages than CAMs alone, by what they declare."""
    return frozenset(
        one.type
        for one in provenance.fields.attacks
        if one.family == "v2x" and one.declared is not None and CAM.name not in one.declared.message_types
    )


def _own_estimates(
    reader: BagReader, listener: str, found: Sequence[Moment], last_ns: int | None
) -> list[Known] | None:
    """The vehicle's on-board estimate of its own state at each moment; None without estimates."""
    topic = VehicleTopics(listener).odometry.name
    if topic not in reader.topics:
        return None
    times_ns, estimates = [], []
    for time_ns, message in reader.messages(topic, last_ns):
        pose = build.se3_from_pose(message.pose.pose)
        yaw_rad = float(np.arctan2(pose[1, 0], pose[0, 0]))
        estimates.append((float(pose[0, 3]), float(pose[1, 3]), yaw_rad, float(message.twist.twist.linear.x)))
        times_ns.append(time_ns)
    if not estimates:
        return None
    own = []
    for moment in found:
        truth = known_of_radio(moment.own)
        last = int(np.searchsorted(times_ns, moment.time_ns, "right")) - 1
        x_m, y_m, yaw_rad, speed_mps = estimates[max(last, 0)]
        own.append(truth._replace(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, speed_mps=speed_mps))
    return own
