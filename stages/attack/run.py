"""Stage 2: an adversarial bag from a clean one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import yaml

from advpipe.pipeline.bag.cloud import StampedCloud, cloud_from_cdr, cloud_to_cdr
from advpipe.pipeline.bag.frames import FrameSlice, find_lidar_topic, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import attack_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import RawMessage
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.jobs import run_jobs
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.attack.job import Job, open_job
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.request import AttackRequest, attack_id
from advpipe.stages.attack.selected import messages_of_frames
from advpipe.stages.attack.summary import AttackSummary
from advpipe.stages.attack.tables import AttackTables

__all__ = ["AttackRequest", "AttackSummary", "attack", "attack_id"]


def attack(
    clean: Path,
    out: Path,
    request: AttackRequest,
    *,
    overwrite: bool = False,
    workers: int | None = None,
) -> AttackSummary:
    """Craft the adversarial version of each chosen cloud of a bag, and write the bag that holds them.

    Every message that is no attacked cloud is copied byte for byte. Beside them in the folder `out` lie
    attack.yaml (the resolved request), labels.parquet and frames.parquet (see `tables`). A run that was
    interrupted goes on where it stopped. The bytes are the same for any number of worker processes
    (default: one for each core), and whether it ran in one go or in pieces.

    Raises AdvpipeError for an unknown attack, a bad parameter, a bag that is none or holds no clouds,
    frames that it does not have, an output that exists, and while the same attack runs elsewhere.
    """
    request.build()  # refuses a bad request at once
    reader = BagReader(resolve_bag(clean))
    chosen = request.frames.indices(reader.topics[find_lidar_topic(reader)].count)
    source = reader.path.resolve()
    if out.resolve() in (source, *source.parents):
        raise AdvpipeError(f"{out} is or holds the clean bag; choose another output")
    load_detector(request.detector)
    provenance = _provenance(reader, request)
    writer = BagWriter(out, provenance=provenance, overwrite=overwrite)  # refuses a bad output at once
    resolved = _resolved(provenance)
    summary = AttackSummary(out)
    with open_job(out, resolved) as job:
        todo = [index for index in chosen if job.load(index) is None]
        attacker = partial(_frame_attacker, reader.path, request, job)
        run_jobs(attacker, todo, f"attacking: {attack_id(request)}", workers)
        with writer as bag, AttackTables(bag.folder) as tables:
            (bag.folder / "attack.yaml").write_text(resolved, encoding="utf-8")
            for index, message in messages_of_frames(reader, find_lidar_topic(reader), chosen):
                if index is None:
                    bag.copy(message)
                    continue
                stamped, result = cloud_from_cdr(message.cdr), job.require(index)
                bag.copy(_with_result(message, stamped, result))
                tables.add(index, stamped.stamp_ns, len(stamped.cloud), result)
                summary.add(len(stamped.cloud), result)
    return summary


def _frame_attacker(clean: Path, request: AttackRequest, job: Job) -> Callable[[int], None]:
    """What one process does: the attack on one frame of the clean bag, kept in the job's folder."""
    attacker, detector = request.build(), load_detector(request.detector)

    def attack_frame(index: int) -> None:
        (frame,) = read_frames(clean, FrameSlice(index, index + 1, 1))
        rng = named_generator(request.seed, "attack", request.type, request.recipe, index)
        with fixed_torch_threads():
            job.store(index, attacker(frame.cloud, frame.boxes, detector, rng))

    return attack_frame


def _with_result(message: RawMessage, clean: StampedCloud, result: LidarResult) -> RawMessage:
    """The cloud's message with the adversarial points; as it was where none was touched."""
    if not len(result.labels):
        return message
    return replace(message, cdr=cloud_to_cdr(result.cloud, clean.stamp_ns, clean.frame_id))


def _provenance(reader: BagReader, request: AttackRequest) -> dict[str, str]:
    """Everything that decides the adversarial bag's bytes."""
    record = attack_provenance(
        reader.path,
        reader.provenance,
        attack=request.type,
        recipe=request.recipe,
        parameters=request.resolved_parameters(),
        seed=request.seed,
        frames=str(request.frames),
    )
    detector = {
        "detector": Path(request.detector).name,
        "detector_sha256": detector_sha256(request.detector),
    }
    return {**record, **detector}


def _resolved(provenance: dict[str, str]) -> str:
    """The text of attack.yaml: the request with every default filled in, and what it was run on."""
    plain = {key: value for key, value in provenance.items() if key not in ("kind", "scenario")}
    for key in ("parameters", "versions"):
        plain[key] = json.loads(plain[key])
    return yaml.safe_dump(plain, sort_keys=True)
