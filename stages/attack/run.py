"""Stage 2: an adversarial bag from a clean one."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.gc_freeze import gc_frozen
from advpipe.pipeline.core.job_engine import runs_elsewhere
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names, with_plugin_errors
from advpipe.pipeline.core.progress import plan_progress, working_on
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.detector.device import frames_at_once
from advpipe.pipeline.detector.input_notice import notice_unexpected_input
from advpipe.pipeline.detector.registry import load_detector, member_names
from advpipe.pipeline.image_detector.registry import differentiable_image_detector
from advpipe.pipeline.labels.clouds import LabelledFrame, PointTables
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.cloud import StampedCloud, cloud_to_cdr
from advpipe.pipeline.viewer_layouts.files import write_layouts
from advpipe.stages.attack.change import changed_messages
from advpipe.stages.attack.cloud_attack import cloud_attacker, groups_of, unfinished
from advpipe.stages.attack.clouds import CloudPlan, plan_clouds, topic_of
from advpipe.stages.attack.contradictions import refuse_contradictions
from advpipe.stages.attack.debug import DebugMessages, touched_cloud
from advpipe.stages.attack.job import Job, open_job
from advpipe.stages.attack.lidar.base import LidarResult, unchanged
from advpipe.stages.attack.lidar.build import adaptation_of
from advpipe.stages.attack.messages import change_messages
from advpipe.stages.attack.output_name import attack_id
from advpipe.stages.attack.provenance import job_provenance, resolved_text
from advpipe.stages.attack.recording import recording_of
from advpipe.stages.attack.request import AttackRequest, image_detectors_of
from advpipe.stages.attack.selected import messages_of_frames
from advpipe.stages.attack.summary import NOT_SCHEDULED, AttackSummary

__all__ = ["AttackRequest", "AttackSummary", "attack", "attack_id"]

LOADING, MESSAGES, CLOUDS, WRITING = (
    *("loading the detector", "changing messages", "attacking clouds", "writing the bag"),
)
"""The phases of an attack."""


def attack(
    clean: Path,
    out: Path,
    request: AttackRequest,
    *,
    overwrite: bool = False,
    workers: int | None = None,
) -> AttackSummary:
    """Carry out the attacks of a request on a bag and write the bag they make.

    GPS comes first, then V2X, radar, cameras and LiDAR. Every message that is not attacked is copied byte for
    byte. Frames that are not chosen are left out, or their clouds alone where messages are attacked too.
    Beside the bag in the folder `out` lie attack.yaml (the resolved request) and Parquet files with the
    labels: labels.parquet and frames.parquet of clouds (see `labels.clouds`), and those of each change of
    messages.
    Debug topics (`messages.debug`) show viewers what was attacked, unless the request leaves them out; those
    of the given bag are not copied.
    An interrupted run resumes where it stopped. The bytes are the same for any number of worker processes
    (default: one for each core, or one where a GPU takes several clouds at once), and whether it ran in one
    go or in pieces.

    Raises AdvpipeError for an unknown attack, a bad parameter, an invalid bag, a bag that lacks what is
    attacked or the chosen frames or times, attacks that contradict each other, an output that exists, and
    while another run makes the same output.
    """
    plan_progress({LOADING: 5, MESSAGES: 20, CLOUDS: 200, WRITING: 10})
    request.check()
    reader = BagReader(resolve_bag(clean))
    source = reader.path.resolve()
    if out.resolve() in (source, *source.parents):
        raise UsageError(f"{out} is or holds the clean bag; choose another output")
    plan = _plan(reader, request)
    for spec in request.lidar:
        notice_default_lidar(reader, spec.lidar or spec.victim)
    with working_on(LOADING):
        _check_detectors(reader, request)
    provenance = job_provenance(reader, request)
    # Made here, as it refuses a bad output at once.
    split = BagSplit.of(reader.provenance)
    writer = BagWriter(out, provenance=provenance, overwrite=overwrite, finish=write_layouts, split=split)
    resolved = resolved_text(provenance)
    summary = AttackSummary(out)
    gnss, v2x = request.of("gnss"), request.of("v2x")
    radar, camera = request.of("radar"), request.of("camera")
    types = [spec.type for spec in (*gnss, *v2x, *radar, *camera)]
    detectors = [name for spec in camera for name in image_detectors_of(spec)]
    with (
        plugin_errors(plugin_names([*types, *detectors])),
        open_job(out, resolved) as job,
        gc_frozen(),
    ):
        debug = DebugMessages() if request.debug else None
        with working_on(MESSAGES):
            changes = change_messages(reader, gnss, v2x, request.seed, debug, radar, camera)
        messages = changed_messages(reader, changes, debug)
        if plan is not None:
            _attack_clouds(reader.path, plan, request, job, workers)
        with working_on(WRITING), writer as bag:
            (bag.folder / "attack.yaml").write_text(resolved, encoding="utf-8")
            if plan is None:
                for message in messages:
                    bag.copy(message)
            else:
                _write_with_clouds(reader, messages, plan, request, job, bag, summary)
            for change in changes:
                summary.replaced |= change.topics & set(reader.topics)
                change.write_labels(bag.folder)
                summary.counts.update(change.counts())
    for warning in summary.warnings:
        notice(f"warning: {warning}")
    return summary


def _check_detectors(reader: BagReader, request: AttackRequest) -> None:
    """Raises UsageError for a detector that cannot be loaded, adapted or differentiated; says where the
    clouds differ from those that it expects."""
    for name in dict.fromkeys(each for spec in request.of("camera") for each in image_detectors_of(spec)):
        differentiable_image_detector(name)
    victims = [(spec, name) for spec in request.lidar for name in member_names(spec.detector)]
    detectors = {name: load_detector(name, request.device) for name in dict.fromkeys(n for _, n in victims)}
    for spec, name in victims:
        adaptation = adaptation_of(spec)
        adaptation.check(detectors[name], name)
        notice_unexpected_input(reader, topic_of(reader, spec), name, detectors[name], adaptation)


def _attack_clouds(
    clean: Path, plan: CloudPlan, request: AttackRequest, job: Job, workers: int | None
) -> None:
    """Attack the clouds that the job lacks; batches in one process, unless more workers are requested.

    Each result is stored here as soon as it comes, so that the workers need not see the job's folder.
    """
    at_once = frames_at_once(request.device)
    groups = groups_of(plan.attacked, at_once)
    done = frozenset(place for place in range(len(plan.attacked)) if job.load(place) is not None)
    attacker = partial(
        cloud_attacker, clean, request.lidar, plan.attacked, groups, request.seed, done, request.device
    )
    named = [name for spec in request.lidar for name in (spec.type, *member_names(spec.detector))]
    if own := plugin_names(named):
        attacker = partial(with_plugin_errors, attacker, own)
    if at_once > 1 and not runs_elsewhere():
        workers = workers or 1
    with closing(stream_jobs(attacker, unfinished(groups, done), CLOUDS, workers)) as finished:
        for _, results in finished:
            for place, result in results:
                job.store(place, result)


def _plan(reader: BagReader, request: AttackRequest) -> CloudPlan | None:
    """The clouds to attack, None without any. Raises AdvpipeError if the bag does not fit the request."""
    recording = recording_of(reader)
    for spec in request.attacks:
        recording.refuse_outside(spec)
    refuse_contradictions(reader, request.of("v2x"), request.seed)
    if not request.lidar:
        return None
    return plan_clouds(reader, request.lidar, request.frames, recording, request.seed)


def _write_with_clouds(
    reader: BagReader,
    messages: Iterable[RawMessage],
    plan: CloudPlan,
    request: AttackRequest,
    job: Job,
    bag: BagWriter,
    summary: AttackSummary,
) -> None:
    """The messages of the chosen frames, adversarial clouds among them, with their labels."""
    place_of = {(cloud.topic, cloud.frame): place for place, cloud in enumerate(plan.attacked)}
    with PointTables(bag.folder) as tables:
        changed = messages if request.has_messages else None
        for frame, message in messages_of_frames(reader, plan, changed):
            if frame is None:
                bag.copy(message)
                continue
            stamped, place = reader.cloud(message), place_of.get((message.topic.name, frame))
            if place is None:
                result, name = unchanged(stamped.cloud, NOT_SCHEDULED), ""
            else:
                result, name = job.require(place), request.lidar[plan.attacked[place].attack].type
            bag.copy(_with_result(message, stamped, result))
            if request.debug and len(result.labels):
                topic, cdr = touched_cloud(message.topic.name, stamped, result)
                bag.write_cdr(topic, cdr, message.log_time_ns)
            row = LabelledFrame(
                *(message.topic.name, frame, name, stamped, len(result.cloud)),
                *(result.loss_before, result.loss_after, result.note),
            )
            tables.add(row, result.labels)
            summary.add(len(stamped.cloud), result)


def _with_result(message: RawMessage, clean: StampedCloud, result: LidarResult) -> RawMessage:
    """The cloud's message with the adversarial points; unchanged if none was touched."""
    if not len(result.labels):
        return message
    return replace(message, cdr=cloud_to_cdr(result.cloud, clean.stamp_ns, clean.frame_id))
