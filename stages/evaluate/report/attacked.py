"""Sections about attacked clouds: baselines, lost objects, displacements, the recount."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.results.metrics import CloudMetrics
from advpipe.pipeline.results.records import BaselineRecord, SuccessRecord
from advpipe.pipeline.results.row import RANDOM_BEST, FrameCounts, ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.condition_matches import WHOLE
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.attack_detection import attack_detection_sections
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.defences import defences_section
from advpipe.stages.evaluate.report.effects import effects_section
from advpipe.stages.evaluate.report.numbers import (
    ANSWER,
    NOTHING,
    formatted_number,
    formatted_ratio,
    interval_cell,
    short_name,
    shown_interval,
    with_interval,
)
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import ReportSection, Table
from advpipe.stages.evaluate.report.transfer import transfer_section
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, OVERLAPS, TO_BEAT


def attacked_sections(summaries: Sequence[Summary]) -> Iterator[ReportSection]:
    """The sections that have content."""
    attacked = [summary for summary in summaries if summary.comparison.bag]
    if any(summary.result.baselines for summary in attacked):
        yield baselines_section(attacked)
    if attacked:
        yield effects_section({title_of(each, attacked): each for each in attacked})
        yield success_section(attacked)
        yield change_section(of_first_detector(attacked))
        yield recount_section(attacked)
    yield from attack_detection_sections({title_of(each, attacked): each for each in attacked})
    if any(summary.defended for summary in summaries):
        yield defences_section(summaries, title_of)
    yield from transfer_section(attacked)


def title_of(summary: Summary, summaries: Sequence[Summary]) -> str:
    """The attack; with the detector if there are several, and with the bag if two attacks are alike."""
    own = attack_title(summary.result.attack)
    title = own if summary.comparison.bag else "clean"
    alike = [each for each in summaries if attack_title(each.result.attack) == own]
    if len({each.comparison.name for each in alike}) > 1:
        title += f" ({summary.comparison.name})"
    if len({each.comparison.detector for each in summaries}) > 1:
        title += f", seen by {short_name(summary.comparison.detector)}"
    return title


def baselines_section(summaries: Sequence[Summary]) -> ReportSection:
    heads = (
        *("attack", "random baseline", "baseline's mAP ratio %", "95 %"),
        *("Δ to baseline, points", "95 %", "significant"),
        *("loose ratio %", "95 %", "Δ, loose", "95 %"),
    )
    lines = []
    for summary in summaries:
        title, counts = title_of(summary, summaries), summary.result.counts
        map_clean, map_loose = (summary.result.clean.means[each].map_r40 for each in ("strict", "loose"))
        for name, baseline in summary.result.baselines.items():
            lines.append(
                (
                    title,
                    baseline_title(name, summary.result.attack.baseline_tries),
                    formatted_ratio(baseline.metrics.map_ratio_percent, map_clean),
                    interval_cell(baseline.metrics.map_ratio_ci95, counts),
                    formatted_number(baseline.map_ratio_delta_points, 2),
                    interval_cell(baseline.map_ratio_delta_points_ci95, counts),
                    ANSWER[baseline.is_significant],
                    formatted_ratio(baseline.metrics.map_loose_ratio_percent, map_loose),
                    interval_cell(baseline.metrics.map_loose_ratio_ci95, counts),
                    formatted_number(baseline.map_loose_ratio_delta_points, 2),
                    interval_cell(baseline.map_loose_ratio_delta_points_ci95, counts),
                )
            )
            title = ""
    return ReportSection(
        "baselines",
        "Against random baselines of equal budget",
        "Δ: the attack's mAP ratio minus the baseline's, in percentage points, drawn together; the attack is "
        "significantly stronger if the 95 % interval of Δ at strict overlap lies below 0; nothing is said "
        f"without an interval. {ABOUT_BASELINES}",
        (Table("mAP ratio of each attack and random baseline, strict and loose", heads, tuple(lines)),),
        records=tuple(
            _baseline_record(summary.result, name)
            for summary in summaries
            for name in summary.result.baselines
        ),
    )


def _baseline_record(result: ResultRow, name: str) -> BaselineRecord:
    baseline = result.baselines[name]
    return BaselineRecord(
        *result.identity,
        baseline=name,
        map_ratio_percent=baseline.metrics.map_ratio_percent,
        map_ratio_ci95=baseline.metrics.map_ratio_ci95,
        delta_points=baseline.map_ratio_delta_points,
        delta_points_ci95=baseline.map_ratio_delta_points_ci95,
        significant=baseline.is_significant,
        map_loose_ratio_percent=baseline.metrics.map_loose_ratio_percent,
        map_loose_ratio_ci95=baseline.metrics.map_loose_ratio_ci95,
        loose_delta_points=baseline.map_loose_ratio_delta_points,
        loose_delta_points_ci95=baseline.map_loose_ratio_delta_points_ci95,
    )


def success_section(summaries: Sequence[Summary]) -> ReportSection:
    """Attack success by class and range; beside the attack the baseline to beat."""
    ranges = [WHOLE, *(stratum.name for stratum in STRATA if stratum.by == "range")]
    scores = {formatted_number(summary.min_score, 2) for summary in summaries}
    score = scores.pop() if len(scores) == 1 else "the working score of its bag"
    heads = (
        *("class", "strict: lost of found", *(f"loose, {name}: lost of found" for name in ranges)),
        *(f"{TO_BEAT}, loose", "new FP", f"{TO_BEAT}: new FP"),
    )
    tables = []
    for summary in summaries:
        counts = summary.result.counts
        found = {(each.condition, each.class_name, each.range): each for each in summary.success}
        names = [name for _, name, place in found if place == WHOLE and ("adv", name, place) in found]
        lines = []
        for name in dict.fromkeys(names):
            mine = [found["adv", name, place] for place in ranges]
            random = found.get((RANDOM_BEST, name, WHOLE))
            lines.append(
                (
                    "every class" if name == EVERY_CLASS else str(name),
                    _strict_share(mine[0], counts),
                    *(_share(each, counts) for each in mine),
                    _share(random, counts),
                    formatted_number(mine[0].new_false_positives, 0),
                    formatted_number(random.new_false_positives if random else None, 0),
                )
            )
        title = f"Objects lost and new false positives: {title_of(summary, summaries)}"
        tables.append(Table(title, heads, tuple(lines)))
    return ReportSection(
        "attack_success",
        "Attack success by class and range",
        "Lost objects are those that the detector finds on the clean cloud and misses on the attacked one, "
        f"in percent of those found, with a 95 % interval; with a score of at least {score}, and by the "
        f"overlap in the column's head ({OVERLAPS}). A new FP is a false positive where the clean cloud has "
        "none.",
        tuple(tables),
        records=tuple(each for summary in summaries for each in summary.success),
    )


def change_section(summaries: Sequence[Summary]) -> ReportSection:
    """How the attacks changed the clouds, measured on the stored bags."""
    heads = (
        "condition", "CD m²", "removed", "added", "moved", "mean m", "RMS m", "median m", "95 % below m",
        "farthest m", "added, farthest m", "off their ray", "at a voxel's face %", "clean %",
    )  # fmt: skip
    tables = []
    for summary in summaries:
        changed = {"attacked": summary.result.attacked}
        changed |= {baseline_title(name): each.metrics for name, each in summary.result.baselines.items()}
        lines = tuple(_change_line(name, each) for name, each in changed.items() if each)
        title = f"Changes of the clouds: {title_of(summary, summaries)}"
        tables.append(Table(title, heads, lines))
    return ReportSection(
        "changes",
        "Changes of the clouds",
        "Measured on the stored bags. Distances are those that points were moved, between the stored "
        "coordinates; for an added point, the distance to the nearest point of the clean cloud. Off their "
        "ray: moved points over 1 mm beside the ray from the LiDAR to where they were, which no real echo "
        "is. At a voxel's face: moved and added points within 1.5 mm of one, and beside it all points of the "
        "clean clouds.",
        tuple(tables),
    )


def _change_line(name: str, metrics: CloudMetrics) -> tuple[str, ...]:
    lengths_m = (
        metrics.mean_displacement_m,
        metrics.rms_displacement_m,
        metrics.median_displacement_m,
        metrics.p95_displacement_m,
        metrics.max_displacement_m,
        metrics.max_added_m,
    )
    points = (metrics.points_removed, metrics.points_added, metrics.points_moved)
    return (
        name,
        formatted_number(metrics.chamfer_distance_m2, 5),
        *(formatted_number(count, 0) for count in points),
        *(formatted_number(length_m or None, 4) for length_m in lengths_m),
        _share_off_ray(metrics),
        formatted_number(metrics.at_face_percent, 1),
        formatted_number(metrics.at_face_clean_percent, 1),
    )


def _share_off_ray(metrics: CloudMetrics) -> str:
    """Such as `1,203 (98.2 %)` of the moved points."""
    if not metrics.points_moved or metrics.points_off_ray is None:
        return NOTHING
    percent = 100 * metrics.points_off_ray / metrics.points_moved
    return f"{metrics.points_off_ray:,} ({formatted_number(percent, 1)} %)"


def recount_section(summaries: Sequence[Summary]) -> ReportSection:
    heads = ("attack", "objects", "mAP ratio %", "lost (loose)", "success %") + (
        "objects, recounted", "mAP ratio %", "95 %", "lost (loose)", "success %",
    )  # fmt: skip
    lines = []
    for summary in summaries:
        attacked, recounted = summary.result.attacked, summary.result.recounted
        if attacked is None or recounted is None:
            continue
        map_clean = summary.result.clean.means["strict"].map_r40
        lines.append(
            (
                title_of(summary, summaries),
                formatted_number(summary.result.counts.objects, 0),
                formatted_ratio(attacked.map_ratio_percent, map_clean),
                formatted_number(attacked.lost_objects, 0),
                formatted_number(attacked.attack_success_percent, 1),
                formatted_number(recounted.objects_recounted, 0),
                formatted_ratio(recounted.map_ratio_percent_recounted, map_clean),
                interval_cell(recounted.map_ratio_recounted_ci95, summary.result.counts),
                formatted_number(recounted.lost_objects_recounted, 0),
                formatted_number(recounted.attack_success_percent_recounted, 1),
            )
        )
    return ReportSection(
        "recount",
        "If the objects were counted on the attacked clouds",
        "All other tables count the objects of the clean clouds. Recounted, objects with too few points left "
        "no longer count, and others may count instead. The mAP ratio is at strict overlap; lost objects, "
        "and attack success, their share of the objects found, are at loose overlap and the working score.",
        (Table("Objects of the clean clouds, and recounted on the attacked ones", heads, tuple(lines)),),
    )


def _share(record: SuccessRecord | None, counts: FrameCounts) -> str:
    """The share of found objects that are lost at loose overlap."""
    if record is None or not record.found_clean:
        return NOTHING
    bounds = shown_interval(record.attack_success_ci95, counts)
    percent = with_interval(record.attack_success_percent, bounds, 0)
    return f"{percent} % ({formatted_number(record.lost, 0)} of {formatted_number(record.found_clean, 0)})"


def _strict_share(record: SuccessRecord, counts: FrameCounts) -> str:
    """The share of found objects that are lost at strict overlap."""
    if not record.strict_found_clean:
        return NOTHING
    bounds = shown_interval(record.strict_attack_success_ci95, counts)
    percent = with_interval(record.strict_attack_success_percent, bounds, 0)
    lost, found = (formatted_number(count, 0) for count in (record.strict_lost, record.strict_found_clean))
    return f"{percent} % ({lost} of {found})"
