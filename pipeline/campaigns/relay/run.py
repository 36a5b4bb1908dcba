"""`advpipe relay`: attacks between the publishers and the consumers of a running graph."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import yaml

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.campaigns.relay.cam_relay import CamRelay
from advpipe.pipeline.campaigns.relay.cloud_attacks import relay_spec
from advpipe.pipeline.campaigns.relay.cloud_relay import CloudRelay
from advpipe.pipeline.campaigns.relay.fix_relay import FixRelay
from advpipe.pipeline.campaigns.relay.graph import RelayGraph
from advpipe.pipeline.campaigns.relay.graph_clock import ClockJumpedBackError, GraphClock
from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.campaigns.relay.part import RelayPart
from advpipe.pipeline.campaigns.relay.place import MapPlace
from advpipe.pipeline.campaigns.relay.played_bag import CLOUDS, FIXES, RESOLVED, PlayedBag, topics_of_v2x
from advpipe.pipeline.campaigns.relay.recorder import Recorder
from advpipe.pipeline.campaigns.relay.settings import RelaySettings, load_relay_settings, vehicle_of
from advpipe.pipeline.campaigns.relay.summary import RelayedTopic, RelaySummary
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.progress import working_on
from advpipe.pipeline.core.signals import Deferred, deferred
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.viewer_layouts.files import write_layouts
from advpipe.stages.attack.declared import declaration_of
from advpipe.stages.attack.registry import find_attack, refuse_foreign_keys, resolved_name

_WAIT_S, _STATUS_S, _CLOCK_PATIENCE_S = 0.005, 10.0, 1.0
_MOST_EARLY = 100
"""Messages that wait until the time is known."""


def relay(
    out: Path,
    options: RelayOptions,
    *,
    overwrite: bool = False,
    ready: Callable[[str], None] = lambda where: None,
) -> RelaySummary:
    """Relay until a signal, the duration or a /clock that jumps back ends it; then the bag is finished.

    Raises UsageError for a bad file, for topics of other types and an interface that is not there, and
    AdvpipeError for a bag that cannot be written.
    """
    settings = _resolved(load_relay_settings(options.attack))
    played = None if options.clean is None else PlayedBag(options.clean)
    provenance = _provenance(settings, options)
    writer = BagWriter(out, provenance=provenance, overwrite=overwrite, finish=write_layouts)
    families = {spec.type: find_attack(relay_spec(spec).type).family for spec in settings.attacks}
    has_clouds = "lidar" in families.values()
    with writer as bag, deferred() as stopped:
        (bag.folder / RESOLVED).write_text(_resolved_text(settings), encoding="utf-8")
        with Recorder(bag, debug=options.debug, has_clouds=has_clouds) as recorder:
            parts = _parts(settings, families, recorder)
            for part in parts:
                if isinstance(part, CloudRelay):
                    part.rehearse()
            with closing(RelayGraph(options, [part.topics for part in parts])) as graph:
                ready(f"ROS 2 domain {options.domain}")
                loop = _Loop(graph, parts, recorder, options)
                reason = loop.run(stopped)
                seconds, cpu_s = loop.seconds, loop.cpu_s
        for part in parts:
            if isinstance(part, FixRelay | CamRelay):
                part.write_labels()
    if played is not None:
        _complete(out, played, settings, set(families.values()))
    return RelaySummary(
        bag=out,
        topics=loop.rows(),
        recorded=recorder.recorded,
        unrecorded=recorder.lost,
        seconds=seconds,
        cpu_s=cpu_s,
        reason=reason,
    )


def _complete(out: Path, played: PlayedBag, settings: RelaySettings, families: Collection[str]) -> None:
    of_family = {"lidar": (CLOUDS, settings.cloud_topic), "gnss": (FIXES, settings.fix_topic)}
    stamped = dict(of_family[family] for family in sorted(families) if family in of_family)
    v2x = topics_of_v2x(vehicle_of(settings.packet_topic or settings.cam_topic)) if "v2x" in families else ()
    with working_on("completing the bag"):
        played.complete(out, stamped, v2x, write_layouts)


class _Loop:
    """Takes messages, lets the parts change them, and sends and records what comes of them."""

    def __init__(
        self, graph: RelayGraph, parts: Sequence[RelayPart], recorder: Recorder, options: RelayOptions
    ) -> None:
        self._graph, self._parts, self._recorder, self._options = graph, parts, recorder, options
        self._by_topic = {part.topics[0].name: part for part in parts}
        self._clock = GraphClock()
        self._has_begun, self._first_s = False, 0.0
        self._early = deque[tuple[str, bytes, float]](maxlen=_MOST_EARLY)
        self._begin_s = self._status_s = time.monotonic()
        self._begin_cpu_s = time.process_time()

    @property
    def seconds(self) -> float:
        """Since the relay began."""
        return time.monotonic() - self._begin_s

    @property
    def cpu_s(self) -> float:
        """Processor time since the relay began."""
        return time.process_time() - self._begin_cpu_s

    def rows(self) -> tuple[RelayedTopic, ...]:
        """What became of each topic's messages so far."""
        return tuple(
            part.counts.row(
                part.topics[0].name,
                self._options.published_name(part.topics[0].name),
                self._graph.missed(part.topics[0]),
            )
            for part in self._parts
        )

    def run(self, stopped: Deferred) -> str:
        """Until something ends it; returns what."""
        try:
            while not stopped.is_set():
                if self._options.duration_s is not None and self.seconds >= self._options.duration_s:
                    return "until its end"
                self._graph.join()
                for name, cdr in self._graph.receive(_WAIT_S):
                    self._take(name, cdr)
                self._send()
                self._say_status()
        except ClockJumpedBackError as error:
            return f"until {error}"
        finally:
            for part in self._parts:
                part.end()
        return "until it was stopped"

    def _take(self, name: str, cdr: bytes) -> None:
        if name == CLOCK.name:
            if self._clock.has_ticked or not self._has_begun:
                self._clock.tick(cdr)
            return
        if not self._has_begun:
            if self._graph.has_clock and not self._clock.has_ticked and not self._is_clock_silent():
                self._early.append((name, cdr, time.monotonic()))
                return  # nobody knows yet what time it is; the next tick is some milliseconds away
            self._has_begun = True
            for part in self._parts:
                part.begin(self._clock.now_ns())
        early, self._early = self._early, deque(maxlen=_MOST_EARLY)
        for topic_name, body, arrival_s in (*early, (name, cdr, time.monotonic())):
            self._by_topic[topic_name].take(body, self._clock.now_ns(), arrival_s)

    def _is_clock_silent(self) -> bool:
        """Whether /clock is announced, but shows nothing; the system's time is taken then."""
        self._first_s = self._first_s or time.monotonic()
        return time.monotonic() - self._first_s > _CLOCK_PATIENCE_S

    def _send(self) -> None:
        if not self._has_begun:
            return
        now_ns = self._clock.now_ns()
        for part in self._parts:
            for one in part.due(now_ns, time.monotonic()):
                is_taken = self._graph.publish(one.topic, one.cdr, now_ns)
                if one.topic is part.topics[0]:
                    part.counts.not_taken += not is_taken
                    part.counts.fates[one.fate] += 1
                    if one.arrival_s is not None:
                        part.counts.latency.add(time.monotonic() - one.arrival_s)
                self._recorder.record(one.topic, one.cdr, now_ns)

    def _say_status(self) -> None:
        if time.monotonic() - self._status_s >= _STATUS_S:
            self._status_s = time.monotonic()
            for row in self.rows():
                notice(row)


def _parts(settings: RelaySettings, families: Mapping[str, str], recorder: Recorder) -> tuple[RelayPart, ...]:
    """One for each family that is attacked; small messages come before clouds."""
    place = MapPlace(settings.origin)
    of = {
        family: [spec for spec in settings.attacks if families[spec.type] == family]
        for family in ("gnss", "v2x", "lidar")
    }
    parts: list[RelayPart] = []
    if of["gnss"]:
        parts.append(FixRelay(settings, of["gnss"], place, recorder))
    if of["v2x"]:
        parts.append(CamRelay(settings, of["v2x"], place, recorder))
    if of["lidar"]:
        parts.append(CloudRelay(settings, of["lidar"], recorder))
    return tuple(parts)


def _resolved(settings: RelaySettings) -> RelaySettings:
    """The same with attacks under their own names. Raises UsageError for an attack or parameter that is
    invalid."""
    resolved = settings.model_copy(update={"attacks": tuple(map(resolved_name, settings.attacks))})
    for spec in resolved.attacks:
        refuse_foreign_keys(relay_spec(spec))
        family = find_attack(relay_spec(spec).type).family
        if family in ("radar", "camera"):
            raise UsageError(f"{spec.type}: relay attacks no {family}s; attack a recorded drive")
        declaration_of(relay_spec(spec))
    return resolved


def _resolved_text(settings: RelaySettings) -> str:
    return yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=True)


def _provenance(settings: RelaySettings, options: RelayOptions) -> dict[str, str]:
    """That of an adversarial bag, whose clean one nobody recorded."""
    attacks: list[dict[str, Any]] = [
        {**spec.model_dump(mode="json"), "declared": declaration_of(relay_spec(spec)).plain()}
        for spec in settings.attacks
    ]
    return {
        "kind": "attack",
        "attack": "+".join(spec.type for spec in settings.attacks),
        "attacks": json.dumps(attacks, sort_keys=True),
        "relay": json.dumps({"domain": options.domain, "prefix": options.prefix}, sort_keys=True),
        "seed": str(settings.seed),
        "debug": json.dumps(options.debug),
        "versions": json.dumps({"advpipe": installed("advpipe")}),
    }
