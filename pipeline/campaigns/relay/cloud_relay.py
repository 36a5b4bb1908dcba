"""Relays clouds in their order; each waits for its attack for a limited time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.campaigns.relay.cloud_attacks import (
    AttackedCloud,
    ScheduledCloudAttack,
    scheduled_cloud_attacks,
)
from advpipe.pipeline.campaigns.relay.counts import RelayCounts
from advpipe.pipeline.campaigns.relay.outgoing import ATTACKED, LATE, UNCHANGED, OutgoingMessage
from advpipe.pipeline.campaigns.relay.recorder import Recorder
from advpipe.pipeline.campaigns.relay.settings import PASS, RelaySettings
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.labels.clouds import LabelledFrame
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_from_cdr, cloud_to_cdr
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.debug import touched_cloud
from advpipe.stages.attack.lidar.base import LidarResult, unchanged
from advpipe.stages.attack.summary import NOT_SCHEDULED

MOST_WAITING_BYTES = 256_000_000
"""Of clouds that wait, 14 s of 80,000 points at 10 Hz: memory is bounded whatever latency is allowed."""

_MOST_AHEAD = 2
"""Before it is known how long an attack takes."""

_KEEPS_UP = 2.0
"""An attack that takes so many times the time between two clouds does so for other work on the machine; one
that takes longer never catches up, and nothing is gained where a second cloud waits for it."""

TOO_LATE = "the attack takes longer than max_latency_s"
BUSY = "others were being attacked"
"""Why a cloud was not attacked."""


@dataclass
class _Waiting:
    number: int
    cdr: bytes
    time_ns: int
    arrival_s: float
    attack: str = ""
    work: Future[AttackedCloud] | None = None
    was_begun: bool = False
    is_late: bool = False


class CloudRelay:
    """The attacks work in a thread of their own, one cloud after the other, so that others need not wait.

    An attack that takes longer than the time between two clouds has a rate of its own: the clouds that come
    meanwhile pass behind it, each as late as the one that was attacked before them, so that consumers receive
    them at the sensor's pace, not all at once.
    """

    def __init__(self, settings: RelaySettings, specs: Sequence[AttackSpec], recorder: Recorder) -> None:
        self.counts = RelayCounts()
        self.topics: tuple[Topic, ...] = (
            Topic(settings.cloud_topic, "sensor_msgs/msg/PointCloud2", keep_last(5)),
        )
        self._settings, self._recorder = settings, recorder
        self._passes_late = settings.when_late == PASS
        self._attacks = scheduled_cloud_attacks(specs, 0, settings.seed)
        self._worker = ThreadPoolExecutor(1, "attack on clouds")
        self._attack_s = self._pace_s = 0.0
        self._waiting_bytes = 0
        self._period_s, self._arrival_s = float("inf"), 0.0
        self._late_work: Future[AttackedCloud] | None = None
        self._waiting = deque[_Waiting]()
        self._said: set[str] = set()

    def rehearse(self) -> None:
        """Attack a small cloud of its own, so that no cloud waits for what an attack loads when it begins;
        and once more, to learn how long an attack takes at least."""
        small = cloud_to_cdr(_small_cloud(), 0, "")
        for attack in (*self._attacks, *self._attacks[:1]):
            with suppress(AdvpipeError):
                attacked = self._attack(attack, 0, small)
                touched_cloud(self.topics[0].name, attacked.clean, attacked.result)

    def begin(self, start_ns: int) -> None:
        """Schedules count from here."""
        self._attacks = tuple(one.from_time(start_ns, self._settings.seed) for one in self._attacks)

    def take(self, cdr: bytes, now_ns: int, arrival_s: float) -> None:
        """A cloud that has come."""
        one = _Waiting(self.counts.received, cdr, now_ns, arrival_s)
        self._note_arrival(arrival_s)
        self.counts.received += 1
        if (attack := self._active(now_ns)) is not None:
            one.attack = attack.name
            if self._is_in_time():
                one.work = self._worker.submit(self._attack, attack, one.number, cdr)
                one.was_begun = True
            else:
                one.is_late = True
        self._waiting.append(one)
        self._waiting_bytes += len(cdr)

    def due(self, now_ns: int, now_s: float) -> Iterator[OutgoingMessage]:
        """The clouds that are to be sent by now."""
        self._say_how_long()
        while self._waiting:
            one = self._waiting[0]
            is_crowded = self._waiting_bytes > MOST_WAITING_BYTES
            waited_s = now_s - one.arrival_s
            if one.work is not None and not one.work.done():
                if waited_s < self._settings.max_latency_s and not is_crowded:
                    return
                if not one.work.cancel():
                    self._late_work = one.work
                one.work, one.is_late = None, True
                self._complain(TOO_LATE)
            elif one.work is not None:
                self._pace_s = waited_s
            elif one.is_late and self._passes_late and waited_s < self._pace_s and not is_crowded:
                return
            self._waiting.popleft()
            self._waiting_bytes -= len(one.cdr)
            yield from self._sent(one)

    def end(self) -> None:
        """Wait for the attack that is going on; clouds that still wait for theirs are not sent any more."""
        self._worker.shutdown(cancel_futures=True)
        self._waiting.clear()

    def _is_in_time(self) -> bool:
        """Whether the attack on one more cloud is expected to end in time; it tries where nothing
        else is attacked."""
        ahead = sum(one.work is not None and not one.work.done() for one in self._waiting)
        ahead += self._is_working_late()
        if not self._attack_s:  # none has ended yet
            return ahead < _MOST_AHEAD
        keeps_up = self._attack_s < _KEEPS_UP * self._period_s
        return not ahead or (keeps_up and (ahead + 1) * self._attack_s < self._settings.max_latency_s)

    def _note_arrival(self, arrival_s: float) -> None:
        """The mean time between clouds, of the last ones above all."""
        if self._arrival_s:
            gap_s = arrival_s - self._arrival_s
            is_first = self._period_s == float("inf")
            self._period_s = gap_s if is_first else 0.8 * self._period_s + 0.2 * gap_s
        self._arrival_s = arrival_s

    def _is_working_late(self) -> bool:
        """Whether the worker is at a cloud that was sent on already."""
        return self._late_work is not None and not self._late_work.done()

    def _attack(self, attack: ScheduledCloudAttack, number: int, cdr: bytes) -> AttackedCloud:
        """In the worker's thread."""
        begin_s = time.monotonic()
        attacked = attack(number, cdr, self._settings.seed)
        self._attack_s = time.monotonic() - begin_s
        return attacked

    def _active(self, now_ns: int) -> ScheduledCloudAttack | None:
        return next((attack for attack in self._attacks if attack.is_active(now_ns)), None)

    def _sent(self, one: _Waiting) -> Iterator[OutgoingMessage]:
        (topic,) = self.topics
        if one.work is not None:
            try:
                attacked = one.work.result()
            except AdvpipeError as error:
                text = f"{topic.name}: {error}; it passes unchanged"
                self._say_once(text, text)
            else:
                is_touched = len(attacked.result.labels) > 0
                fate = ATTACKED if is_touched else UNCHANGED
                yield OutgoingMessage(topic, attacked.cdr, fate, one.arrival_s)
                self._recorder.call(lambda: self._label(one, attacked), len(attacked.cdr) + len(one.cdr))
                return
        if one.is_late and not one.was_begun:
            self._complain(BUSY)
        if one.is_late and not self._passes_late:
            self.counts.withheld += 1
        else:
            fate = LATE if one.is_late else UNCHANGED
            yield OutgoingMessage(topic, one.cdr, fate, one.arrival_s)
        note = (TOO_LATE if one.was_begun else BUSY) if one.is_late else "" if one.attack else NOT_SCHEDULED
        self._recorder.call(lambda: self._label_unchanged(one, note), len(one.cdr))

    def _label(self, one: _Waiting, attacked: AttackedCloud) -> None:
        """In the recorder's thread."""
        clean, result = attacked.clean, attacked.result
        row = LabelledFrame(
            *(self.topics[0].name, one.number, one.attack, clean, len(result.cloud)),
            *(result.loss_before, result.loss_after, result.note),
        )
        self._recorder.point_tables.add(row, result.labels)
        if len(result.labels) and self._recorder.debug:
            topic, cdr = touched_cloud(self.topics[0].name, clean, result)
            self._recorder.write(topic, cdr, one.time_ns)

    def _label_unchanged(self, one: _Waiting, note: str) -> None:
        try:
            clean = cloud_from_cdr(one.cdr)
        except AdvpipeError:
            return
        result: LidarResult = unchanged(clean.cloud, note)
        row = LabelledFrame(self.topics[0].name, one.number, "", clean, len(clean.cloud), note=result.note)
        self._recorder.point_tables.add(row, result.labels)

    def _complain(self, reason: str) -> None:
        """Why clouds are not attacked."""
        becomes = "passed on unchanged" if self._passes_late else "dropped"
        each = f", {self._attack_s:.1f} s for each" if reason == BUSY and self._attack_s else ""
        text = f"this machine does not keep up; some clouds are {becomes} ({reason}{each})"
        self._say_once(reason, f"{self.topics[0].name}: {text}")

    def _say_how_long(self) -> None:
        """Once an attack has ended whose cloud could not wait for it."""
        if self._late_work is None or not self._late_work.done():
            return
        self._late_work, limit_s = None, self._settings.max_latency_s
        if self._attack_s > limit_s:
            text = f"the attack on a cloud took {self._attack_s:.1f} s, more than max_latency_s ({limit_s:g})"
            self._say_once(
                "took", f"{self.topics[0].name}: {text}; a longer one lets it attack at its own rate"
            )

    def _say_once(self, key: str, text: str) -> None:
        if key not in self._said:
            self._said.add(key)
            notice(text)


def _small_cloud() -> Cloud:
    """A wall around the sensor, in 4 rings of 90 points."""
    cloud = np.zeros(360, POINT_DTYPE)
    azimuth_rad = np.repeat(np.arange(90), 4) * (2 * np.pi / 90)
    cloud["x"], cloud["y"] = 20 * np.cos(azimuth_rad), 20 * np.sin(azimuth_rad)
    cloud["ring"] = np.tile(np.arange(4), 90)
    cloud["z"] = cloud["ring"] - 2.0
    return cloud
