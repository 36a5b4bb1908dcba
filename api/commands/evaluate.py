"""Stage 3 as a function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike, bag_or_newest, default_output, refuse_existing
from advpipe.pipeline.bag.locate import CLEAN_NAME, adversarial_bags, resolve_bag
from advpipe.pipeline.core.errors import as_usage_error
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.detector.registry import detector_slug
from advpipe.pipeline.process.folder import refuse_undecodable
from advpipe.stages.evaluate.options import Options

if TYPE_CHECKING:
    from advpipe.stages.evaluate.run import Report


@with_progress("evaluating {clean}")
def evaluate(
    clean: PathLike | None = None,
    *adversarial: PathLike,
    detector: str | Sequence[str] = Options.detectors,
    device: str = Options.device,
    frames: str = "::",
    defence: str | Sequence[str] = Options.defences,
    defence_frames: int | None = Options.defence_frames,
    detect_attacks: str | Sequence[str] = Options.detect_attacks,
    misbehaviour_detector: str | Sequence[str] = Options.misbehaviour_detectors,
    image_detector: str = Options.image_detector,
    seed: int = Options.seed,
    baseline: bool = Options.baseline,
    baseline_tries: int | None = Options.baseline_tries,
    lidar: str | None = Options.lidar_topic,
    lidar_height_m: float | None = Options.lidar_height_m,
    level: bool = Options.level,
    scale_intensity: float = Options.scale_intensity,
    write_detections: bool = Options.detections,
    with_clouds: bool = Options.with_clouds,
    scene: bool = Options.scene,
    workers: int | None = None,
    cluster: str | None = None,
    out: PathLike | None = None,
    overwrite: bool = False,
) -> Report:
    """Stage 3: run a detector on clean and adversarial bags; AP, mAP ratio, Chamfer distance, report.

    clean: a data set, a bag, or the result of `simulate`; by default the newest data set under `datasets`.
    adversarial: what `attack` made of it; without any, all the bags of the data set, if it is one's clean
    bag. detector: a shipped name, a .safetensors file, or `module:Class`; several make a matrix of transfer.
    device: where it computes, `cpu`, `cuda` or `cuda:N`. frames: `start:stop:step`, counted in the clean bag:
    which clouds detection looks at. defence: `NAME[:parameters]` before the detector, such as `jitter:0.02`,
    or several; or `default`, `all` or `none`. defence_frames: the most frames that defences are scored on.
    detect_attacks: checks that try to tell attacked clouds from clean ones, `all` or `none`.
    misbehaviour_detector: your own detector of false V2X messages, `module:Class`, or several.
    image_detector: looks at the pictures of cameras: `small`, a .safetensors file, `module:Class`, or `none`.
    seed: of the bootstrap, the baselines and the defences. baseline: also scores a random attack with the
    same budget; baseline_tries: its queries, of which it keeps the best, by default as many as the attack
    has.
    lidar: the topic of the clouds, among several. lidar_height_m: its height above the ground where that
    differs from what the detector expects: clouds are shifted for the detector. level: fits the ground in
    each cloud, and levels and shifts the cloud. scale_intensity: multiplies intensities. Boxes
    and figures stay in the frame of the recording. write_detections: writes bags that show the detections;
    with_clouds: with the clouds in them. scene: shows frames in 3D in the page. workers: processes, by
    default one a core; their number changes no byte. cluster: as `attack` has it. out:
    the report's folder, by default `reports/<detector>` of the data set. overwrite: replaces one that exists.

    Returns the report, written to `out`: `to_dicts()` has the rows of report.json, mAP as a share, ratios in
    percent, distances in metres. Raises UsageError for bags that do not belong together or lack what is
    scored, for an unknown detector and for an output that exists.

    >>> report = advpipe.evaluate(drive, detached)
    >>> report.to_dicts()[0]["map_ratio_percent"]
    """
    with as_usage_error():
        scored, others = bag_or_newest(clean), [resolve_bag(Path(bag)) for bag in adversarial]
        chosen = FrameSlice.parse(frames)
    if not others and scored.name == CLEAN_NAME:
        others = adversarial_bags(scored.parent)
    detectors = (detector,) if isinstance(detector, str) else tuple(detector)
    name = "+".join(detector_slug(each) for each in detectors)
    target = default_output(scored, name, "reports") if out is None else Path(out)
    refuse_existing(target, overwrite)
    refuse_undecodable(scored, *others, target)
    detail(f"{', '.join(detectors)} on {device}, seed {seed}: {scored} and {len(others)} adversarial bags")
    with working_on("loading libraries"):
        from advpipe.pipeline.cluster.connect import use_cluster
        from advpipe.stages.evaluate.run import evaluate as run

    options = Options(
        detectors=detectors,
        image_detector=image_detector,
        seed=seed,
        baseline=baseline,
        baseline_tries=baseline_tries,
        defences=(defence,) if isinstance(defence, str) else tuple(defence),
        defence_frames=defence_frames,
        detect_attacks=(detect_attacks,) if isinstance(detect_attacks, str) else tuple(detect_attacks),
        misbehaviour_detectors=(misbehaviour_detector,)
        if isinstance(misbehaviour_detector, str)
        else tuple(misbehaviour_detector),
        frames=chosen,
        lidar_topic=lidar,
        lidar_height_m=lidar_height_m,
        level=level,
        scale_intensity=scale_intensity,
        detections=write_detections or with_clouds,
        with_clouds=with_clouds,
        device=device,
        scene=scene,
    )
    with use_cluster(cluster, device):
        return run(scored, others, target, options, overwrite=overwrite, workers=workers)
