"""Recover an incomplete recording as a complete bag."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.carried import CLOUD_TYPE, CarriedSensor, is_lidar, sensors_of_scenario
from advpipe.pipeline.bag.frames import vehicle_topics
from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.bag.partial_recording import SCENARIO_NAME, PartialRecording, find_partial_recording
from advpipe.pipeline.bag.provenance import RECORD_NAME, checked_provenance
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import FILES_RECORD, BagWriter
from advpipe.pipeline.core.document import read_text, read_yaml
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.checksums import validate_checksums
from advpipe.pipeline.mcap.salvage import Salvage
from advpipe.pipeline.messages.debug import is_debug
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.messages.types import typestore

DATA_SET = FolderKind("data set", (SCENARIO_NAME, CLEAN_NAME), (f"{CLEAN_NAME}/metadata.yaml",))
RECOVERED_KEY = "recovered"
"""Where the provenance of a recovered bag says what was saved and lost, as JSON."""

_TRUTH_TYPES = (VehicleTopics().objects.type, VehicleTopics().true_odometry.type)


@dataclass
class Recovery:
    """What was recovered to `out` (None: the bag was intact), and what was lost; `str` is one line."""

    source: PartialRecording
    out: Path | None = None
    messages: int = 0
    clouds: int = 0
    lost_bytes: int = 0
    lost_chunks: int = 0
    lost_messages: int = 0
    clouds_without_truth: int = 0

    def __str__(self) -> str:
        if self.out is None:
            return f"{self.source.bag}: intact, with {counted(self.messages, 'message')}; nothing to recover"
        lost = [
            f"{what} {count:,}"
            for what, count in {
                "bytes outside complete chunks": self.lost_bytes,
                "damaged chunks": self.lost_chunks,
                "messages in damaged chunks": self.lost_messages,
                "clouds without their ground truth": self.clouds_without_truth,
            }.items()
            if count
        ]
        messages, clouds = counted(self.messages, "message"), counted(self.clouds, "cloud")
        saved = f"{messages} ({clouds}) recovered from {self.source.found}"
        return (
            f"{self.out}: {saved}; lost, besides the index: "
            f"{', '.join(lost) or 'what had not been written yet'}"
        )

    def to_json(self) -> str:
        """The counts."""
        counts = {key: value for key, value in vars(self).items() if isinstance(value, int)}
        return json.dumps(counts, sort_keys=True)


@dataclass
class _Survey:
    """What the first of two passes over the files finds."""

    provenance: Provenance = field(default_factory=lambda: Provenance({}))
    clouds_ns: dict[str, set[int]] = field(default_factory=dict)
    truth_ns: dict[str, set[int]] = field(default_factory=dict)
    sensors: Mapping[str, CarriedSensor] | None = None

    def lone_clouds(self) -> set[tuple[str, int]]:
        """Topic and log time of LiDAR clouds whose ground truth was lost, which nothing can use.

        In advpipe's own bags, both have one log time; other tools' clouds are all kept.
        """
        found: set[tuple[str, int]] = set()
        for name, times_ns in self.clouds_ns.items() if self.provenance else ():
            if self.sensors is not None and not is_lidar(self.sensors.get(name)):
                continue
            vehicle = vehicle_topics(name)
            for truth in (vehicle.objects.name, vehicle.true_odometry.name):
                found |= {(name, time_ns) for time_ns in times_ns - self.truth_ns.get(truth, times_ns)}
        return found


def recover(path: Path, out: Path | None = None, *, overwrite: bool = False) -> Recovery:
    """Write the intact part of an incomplete bag to `out`, or to `<name>-recovered` next to it.

    path: see `find_partial_recording`. The source stays as it is, and an intact bag is left alone. A data set
    becomes a data set. Attachments are not kept. Raises AdvpipeError where nothing can be saved, an output
    exists, or a living run is still writing.
    """
    with find_partial_recording(Path(path)) as source:
        if not source.is_leftover and _is_whole(source):
            topics = BagReader(source.bag, debug=True).topics.values()
            return Recovery(source, messages=sum(topic.count for topic in topics))
        target = Path(out) if out else source.name.with_name(f"{source.name.name}-recovered")
        if target.exists() and not overwrite:
            raise OutputExistsError(target)
        recovery = Recovery(source, target)
        survey = _survey(recovery)
        if not source.is_data_set:
            _write(recovery, survey, target, overwrite)
            return recovery
        with staged_folder(target, overwrite, DATA_SET) as folder:
            if scenario := _scenario(source, survey):
                (folder / SCENARIO_NAME).write_text(scenario, encoding="utf-8")
            _write(recovery, survey, folder / CLEAN_NAME, overwrite=False)
    return recovery


def _is_whole(source: PartialRecording) -> bool:
    try:
        BagReader(source.bag)
        for file in source.files:
            validate_checksums(file)
    except AdvpipeError:
        return False
    return True


def _survey(recovery: Recovery) -> _Survey:
    """Reads all once, and counts in `recovery`."""
    survey = _Survey()
    for salvage in map(Salvage, recovery.source.filled_files):
        for raw in salvage.messages():
            recovery.messages += 1
            if raw.topic.type == CLOUD_TYPE and not is_debug(raw.topic.name):
                recovery.clouds += 1
                survey.clouds_ns.setdefault(raw.topic.name, set()).add(raw.log_time_ns)
            elif raw.topic.name == SCENARIO_INFO.name:
                survey.sensors = _sensors(raw)
            elif raw.topic.type in _TRUTH_TYPES:
                survey.truth_ns.setdefault(raw.topic.name, set()).add(raw.log_time_ns)
        recovery.lost_bytes += salvage.lost_bytes
        recovery.lost_chunks += salvage.lost_chunks
        recovery.lost_messages += salvage.lost_messages
        survey.provenance = survey.provenance or _provenance(salvage)
    recovery.clouds_without_truth = len(survey.lone_clouds())
    recovery.messages -= recovery.clouds_without_truth
    recovery.clouds -= recovery.clouds_without_truth
    if not recovery.messages:
        files = ", ".join(map(str, recovery.source.files))
        raise AdvpipeError(f"{files}: holds no complete chunk of messages; nothing can be recovered")
    return survey


def _sensors(raw: RawMessage) -> Mapping[str, CarriedSensor] | None:
    try:
        message = typestore().deserialize_cdr(raw.cdr, SCENARIO_INFO.type)
        return sensors_of_scenario(message.data, SCENARIO_INFO.name)  # type: ignore[attr-defined]
    except Exception:  # damaged, or another tool's: every cloud may be a LiDAR's
        return None


def _provenance(salvage: Salvage) -> Provenance:
    try:
        return checked_provenance(salvage.metadata.get(RECORD_NAME, {}), salvage.path)
    except AdvpipeError:  # missing or damaged: the bag is of unknown origin, like another tool's
        return Provenance({})


def _scenario(source: PartialRecording, survey: _Survey) -> str | None:
    file = source.found / SCENARIO_NAME
    if not file.is_file():
        return survey.provenance.fields.scenario
    text = read_text(file)
    read_yaml(text, dict[str, Any], str(file), "put the right scenario there, or remove it")
    return text


def _write(recovery: Recovery, survey: _Survey, bag: Path, overwrite: bool) -> None:
    provenance = {**survey.provenance, RECOVERED_KEY: recovery.to_json()}
    lone_clouds = survey.lone_clouds()
    with BagWriter(bag, provenance=provenance, overwrite=overwrite) as writer:
        for salvage in map(Salvage, recovery.source.filled_files):
            for raw in salvage.messages():
                if (raw.topic.name, raw.log_time_ns) not in lone_clouds:
                    writer.copy(raw)
            for name, record in salvage.metadata.items():
                if name not in (RECORD_NAME, FILES_RECORD, "rosbag2"):  # made anew
                    writer.add_metadata(name, record)
