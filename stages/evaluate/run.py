"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, FrameSlice, find_lidar_topic, has_ground_truth
from advpipe.pipeline.bag.ground_truth import BOX_TYPES
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import window_of
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.detector.device import CPU, device_record
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.stages.evaluate.cooperative.section import KEY as COOPERATIVE
from advpipe.stages.evaluate.cooperative.section import sections as cooperative
from advpipe.stages.evaluate.coordinated.section import sections as coordinated
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name, touches_clouds
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.looking import Looking
from advpipe.stages.evaluate.detection.pairing import chosen_indices
from advpipe.stages.evaluate.detection.scoring import known_classes
from advpipe.stages.evaluate.detection.summary import Summary, summarise
from advpipe.stages.evaluate.detection.write_back import write_detections
from advpipe.stages.evaluate.localisation.section import sections as localisation
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.provenance import (
    describe_bags,
    describe_detector,
    intensity_remark,
    topic_remark,
    transfer_remark,
)
from advpipe.stages.evaluate.report.attacked import attacked_sections
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.html import write_html
from advpipe.stages.evaluate.report.pictures import draw_pictures
from advpipe.stages.evaluate.report.report import FORMULAS, Report, precision_records
from advpipe.stages.evaluate.report.results import write_frames, write_results
from advpipe.stages.evaluate.report.section import Family, Section
from advpipe.stages.evaluate.report.table import print_report
from advpipe.stages.evaluate.training_map import map_status
from advpipe.stages.evaluate.v2x.section import sections as v2x

__all__ = ["Options", "Report", "evaluate", "print_report"]

REPORT = FolderKind(
    "report",
    ("report.json", "results.parquet", "frames.parquet", "figures", "report.html", "detections"),
    ("report.json",),
)


FRAMES = (
    "detection and cooperative perception are of the chosen clouds; localisation, V2X and coordinated "
    "attacks are of the window from the first of these to one period after the last, in which a step leaves "
    "out clouds alone"
)
OF_WINDOW = (
    "All figures of this part are of the window of {length_s:.1f} s from the first chosen cloud to one "
    "period after the last. Filters, radio, maps and detectors ran from the beginning of the drive to the "
    "window's end."
)


def families(clean: Path, options: Options) -> tuple[tuple[Family, str], ...]:
    """What the families of attacks add besides detection, and what to note on the time that they look at.

    A family adds no section where it has nothing to say. Raises AdvpipeError for frames that choose none.
    """
    window = window_of(BagReader(clean), options.frames, options.lidar_topic)
    timed = [partial(family, window=window) for family in (coordinated, localisation, v2x)]
    fused = partial(
        cooperative,
        detector=options.detectors[0],
        device=options.device,
        frames=options.frames,
        lidar_topic=options.lidar_topic,
    )
    length_s = (window.end_ns - window.begin_ns) / 1e9 if window.end_ns is not None else None
    note = OF_WINDOW.format(length_s=length_s) if length_s is not None else ""
    return (*((family, note) for family in timed), (fused, ""))


def evaluate(
    clean: Path,
    adversarial: Sequence[Path],
    out: Path,
    *,
    detector: str | Sequence[str] = "small",
    seed: int = 0,
    baseline: bool = True,
    baseline_tries: int | None = 1,
    defences: Sequence[str] = (),
    frames: FrameSlice = ALL_FRAMES,
    overwrite: bool = False,
    bootstrap_draws: int = 1000,
    lidar_topic: str | None = None,
    workers: int | None = None,
    detections: bool = False,
    with_clouds: bool = False,
    device: str = CPU,
) -> Report:
    """Score detectors on a clean bag and on adversarial versions of it, and write a report.

    An adversarial bag may hold some of the frames only; its clean figures are those of the same
    frames. Without adversarial bags all clean frames are scored. `out` becomes a folder with
    report.html, report.json, results.parquet (every detection and every object), frames.parquet and
    figures/; with `detections` also detections/, a bag to view for each bag. The other options are those
    of `Options`. `workers` processes detect, by default one for each core; their number changes no byte.
    A bag whose attacks left the clouds alone is not shown to detectors.

    Raises AdvpipeError for bags that do not belong together, lack clouds or ground truth, for an unknown
    detector or defence and for an existing `out`.
    """
    options = Options(
        detectors=(detector,) if isinstance(detector, str) else tuple(detector),
        seed=seed,
        baseline=baseline,
        baseline_tries=baseline_tries,
        defences=tuple(defences),
        frames=frames,
        bootstrap_draws=bootstrap_draws,
        lidar_topic=lidar_topic,
        detections=detections,
        with_clouds=with_clouds,
        device=device,
    )
    # Whole bags are hashed last: what can be refused at once is.
    _refuse_adversarial(clean)
    provenances = {bag: BagReader(bag).provenance for bag in adversarial}
    _refuse_equal_names(adversarial)
    on_clouds = [bag for bag in adversarial if touches_clouds(provenances[bag])]
    is_looked_at = bool(on_clouds) or not adversarial
    if is_looked_at:
        _require_ground_truth(clean, lidar_topic)
        chosen_indices(clean, frames, lidar_topic)  # refuses a bag without clouds
    window_of(BagReader(clean), frames, lidar_topic)  # refuses a choice of none
    models = [load_detector(name, device) for name in options.detectors] if is_looked_at else []
    with staged_folder(out, overwrite, REPORT) as folder:
        clean_sha256 = parent_sha256(clean)
        for bag, provenance in provenances.items():
            _refuse_another_parent(bag, provenance, clean, clean_sha256)
        summaries: list[Summary] = []
        for name, model in zip(options.detectors, models, strict=False):
            about = tuple(provenances[bag] for bag in on_clouds)
            looking = _looking(name, clean, on_clouds, about, options)
            compared = looking.comparisons(workers)
            for each in track(compared, "figures and their intervals", len(compared)):
                topic = find_lidar_topic(BagReader(clean), lidar_topic)
                remarks = [
                    *transfer_remark(each),
                    *topic_remark(each, topic),
                    *intensity_remark(clean, topic),
                ]
                summaries.append(summarise(each, known_classes(model), bootstrap_draws, seed, remarks))
        sections = [*attacked_sections(summaries)]
        sections += added_sections(clean, adversarial, options)
        comparisons = [summary.comparison for summary in of_first_detector(summaries)]
        if not models and any(section.key == COOPERATIVE for section in sections):
            models = [load_detector(options.detectors[0], device)]  # it looked for that section alone
        about_clean = BagReader(clean).provenance
        maps = [map_status(*each, about_clean) for each in zip(options.detectors, models, strict=False)]
        detectors = [
            describe_detector(name, model, detector_sha256(name), of_map.is_training_map)
            for name, model, of_map in zip(options.detectors, models, maps, strict=False)
        ]
        origin: Row = {
            "bootstrap_draws": bootstrap_draws,
            "seed": seed,
            "detectors": detectors,
            "baseline_tries": baseline_tries if baseline else 0,
            "defences": list(options.defences),
            **device_record(device),
            **describe_bags(clean, clean_sha256, comparisons, [b for b in adversarial if b not in on_clouds]),
        }
        rows = tuple(summary.row for summary in summaries)
        formulas = FORMULAS if frames == ALL_FRAMES else {**FORMULAS, "frames": f"{frames}: {FRAMES}"}
        banners = tuple(each.text for each in maps if each.text)
        report = Report(rows, origin, formulas, precision_records(summaries), tuple(sections), banners)
        (folder / "report.json").write_text(report.to_json(), encoding="utf-8")
        if summaries:
            write_results(summaries, folder / "results.parquet")
            write_frames(summaries, folder / "frames.parquet")
        pictures = draw_pictures(clean, summaries, lidar_topic)
        (folder / "figures").mkdir()
        for picture in [*pictures, *(picture for section in sections for picture in section.pictures)]:
            (folder / "figures" / picture.file_name).write_bytes(picture.png)
        write_html(report, summaries, pictures, folder / "report.html")
        if detections and summaries:
            _write_detections(
                clean, comparisons, folder / "detections", detectors[0], lidar_topic, with_clouds
            )
    return report


def added_sections(clean: Path, adversarial: Sequence[Path], options: Options) -> list[Section]:
    """What all families add; where frames were chosen, with a note on the time of each part."""
    sections: list[Section] = []
    for family, note in families(clean, options):
        noted = (note,) if note else ()
        sections += [
            replace(each, notes=(*each.notes, *noted)) for each in family(clean, adversarial, options.seed)
        ]
    return sections


def _looking(
    detector: str,
    clean: Path,
    adversarial: Sequence[Path],
    about: tuple[Provenance, ...],
    options: Options,
) -> Looking:
    return Looking(
        detector,
        clean,
        tuple(adversarial),
        about,
        options.lidar_topic,
        options.seed,
        options.baseline,
        options.baseline_tries,
        options.defences,
        options.frames,
        options.device,
    )


def _write_detections(
    clean: Path,
    comparisons: Sequence[Comparison],
    folder: Path,
    detector: Row,
    lidar_topic: str | None,
    with_clouds: bool,
) -> None:
    """A bag of the clean bag's detections, and one for each adversarial bag."""
    found = {frame.index: frame.clean.detections for each in comparisons for frame in each.frames}
    bags = [(clean, "clean", found)]
    for each in comparisons:
        frames = [(frame.adversarial_index, frame.adversarial) for frame in each.frames]
        if each.bag:
            bags.append((each.bag, each.name, {index: seen.detections for index, seen in frames if seen}))
    for source, name, detections in bags:
        write_detections(
            source, folder / name, detections, detector, lidar_topic=lidar_topic, with_clouds=with_clouds
        )


def _refuse_adversarial(clean: Path) -> None:
    if BagReader(clean).provenance.is_attack:
        raise UsageError(
            f"{clean} is an adversarial bag; give the clean bag that it was made from first, then this one"
        )


def _require_ground_truth(clean: Path, lidar_topic: str | None) -> None:
    if not has_ground_truth(clean, lidar_topic):
        raise UsageError(
            f"{clean} has no ground truth (no topic of {' or '.join(BOX_TYPES)}); "
            "give the clean bag that holds it"
        )


def _refuse_another_parent(bag: Path, provenance: Provenance, clean: Path, clean_sha256: str) -> None:
    """Raises AdvpipeError for an adversarial bag that says that it was made from another bag."""
    told = provenance.said.parent_sha256
    if told is not None and told != clean_sha256:
        raise UsageError(
            f"{bag} was made from another bag than {clean} (parent SHA-256 {told[:12]}…, not "
            f"{clean_sha256[:12]}…); give the bag that was attacked; if that was recorded anew since, "
            "attack again with --overwrite or remove that folder"
        )


def _refuse_equal_names(bags: Sequence[Path]) -> None:
    names = [bag_name(bag) for bag in bags]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(
                f"two adversarial bags are named {name}; rename one, the report tells them by name"
            )
