"""Sections about attacked clouds: baselines, lost objects, displacements, the recount, defences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.results.figures import CloudFigures
from advpipe.pipeline.results.records import BaselineRecord, SuccessRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.condition import WHOLE
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.numbers import (
    NOTHING,
    formatted_number,
    interval,
    short_name,
    with_interval,
)
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import ReportSection, Table
from advpipe.stages.evaluate.report.transfer import transfer_section
from advpipe.stages.evaluate.report.wording import OVERLAPS, PLAIN_RANDOM, RANDOM_BEST

ANSWER = {True: "yes", False: "no", None: NOTHING}


def attacked_sections(summaries: Sequence[Summary]) -> Iterator[ReportSection]:
    """Those that there is something to say in."""
    attacked = [summary for summary in summaries if summary.comparison.bag]
    if any(summary.result.baselines for summary in attacked):
        yield baselines_section(attacked)
    if attacked:
        yield success_section(attacked)
        yield change_section(of_first_detector(attacked))
        yield recount_section(attacked)
    if any(summary.defended for summary in summaries):
        yield defences_section(summaries)
    yield from transfer_section(attacked)


def title_of(summary: Summary, summaries: Sequence[Summary]) -> str:
    """The attack; with the detector, where several look; with the bag, where two attacks are alike."""
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
        *("attack", f"{PLAIN_RANDOM} baseline", "its ratio %", "95 %"),
        *("attack minus it", "95 %", "beats it"),
    )
    lines = []
    for summary in summaries:
        title = title_of(summary, summaries)
        for word, baseline in summary.result.baselines.items():
            lines.append(
                (
                    title,
                    baseline_title(word),
                    formatted_number(baseline.figures.map_ratio_percent, 2),
                    interval(baseline.figures.map_ratio_ci95),
                    formatted_number(baseline.map_ratio_delta_points, 2),
                    interval(baseline.map_ratio_delta_points_ci95),
                    ANSWER[baseline.is_significant],
                )
            )
            title = ""
    return ReportSection(
        "baselines",
        "Against the same budget spent plainly at random",
        "Differences in points of mAP ratio, drawn together with the attack; an attack beats a baseline if "
        f"the 95 % interval of the difference lies below 0. {RANDOM_BEST}",
        (Table("", heads, tuple(lines)),),
        records=tuple(
            _baseline_record(summary.result, word)
            for summary in summaries
            for word in summary.result.baselines
        ),
    )


def _baseline_record(result: ResultRow, word: str) -> BaselineRecord:
    attack, baseline = result.attack, result.baselines[word]
    return BaselineRecord(
        result.bag,
        result.detector,
        attack.attack,
        attack.recipe,
        attack.parameter,
        attack.value,
        baseline=word,
        map_ratio_percent=baseline.figures.map_ratio_percent,
        map_ratio_ci95=baseline.figures.map_ratio_ci95,
        delta_points=baseline.map_ratio_delta_points,
        delta_points_ci95=baseline.map_ratio_delta_points_ci95,
        significant=baseline.is_significant,
    )


def success_section(summaries: Sequence[Summary]) -> ReportSection:
    """Attack success by class and range; beside the attack one draw of the baseline at random anywhere."""
    ranges = [WHOLE, *(stratum.name for stratum in STRATA if stratum.by == "range")]
    scores = {formatted_number(summary.min_score, 2) for summary in summaries}
    score = scores.pop() if len(scores) == 1 else "the working score of its bag"
    heads = (
        *("class", "strict: lost of found", *(f"loose, {name}: lost of found" for name in ranges)),
        *("one random draw, loose", "new FP", "one random draw"),
    )
    tables = []
    for summary in summaries:
        found = {(each.condition, each.class_name, each.range): each for each in summary.success}
        names = [name for _, name, place in found if place == WHOLE and ("adv", name, place) in found]
        lines = []
        for name in dict.fromkeys(names):
            mine = [found["adv", name, place] for place in ranges]
            random = found.get(("baseline", name, WHOLE))
            lines.append(
                (
                    "every class" if name == EVERY_CLASS else str(name),
                    _strict_share(mine[0]),
                    *(_share(each) for each in mine),
                    _share(random),
                    formatted_number(mine[0].new_false_positives, 0),
                    formatted_number(random.new_false_positives if random else None, 0),
                )
            )
        tables.append(Table(title_of(summary, summaries), heads, tuple(lines)))
    return ReportSection(
        "attack_success",
        "Attack success by class and range",
        "Lost objects: those that the detector finds on the clean cloud and misses on the attacked one, in "
        f"percent of those found, with a 95 % interval; with a score of at least {score}, and by the overlap "
        f"that stands above the column ({OVERLAPS}). A new FP is a detection that finds nothing, where none "
        "was before. The random draw, anywhere, is the weakest of the baselines.",
        tuple(tables),
        records=tuple(each for summary in summaries for each in summary.success),
    )


def change_section(summaries: Sequence[Summary]) -> ReportSection:
    """What was done to the clouds, told from the bags as stored."""
    heads = (
        "cloud", "CD m²", "removed", "added", "moved", "mean m", "RMS m", "median m", "95 % below m",
        "farthest m", "added, farthest m",
    )  # fmt: skip
    tables = []
    for summary in summaries:
        changed = {"attacked": summary.result.attacked}
        changed |= {baseline_title(word): each.figures for word, each in summary.result.baselines.items()}
        lines = tuple(_change_line(name, each) for name, each in changed.items() if each)
        tables.append(Table(title_of(summary, summaries), heads, lines))
    return ReportSection(
        "changes",
        "What was done to the clouds",
        "Read from the stored bags. Lengths are of the moved points, between the coordinates as stored; of "
        "an added point, to the nearest point of the clean cloud.",
        tuple(tables),
    )


def _change_line(name: str, figures: CloudFigures) -> tuple[str, ...]:
    lengths_m = (
        figures.mean_displacement_m,
        figures.rms_displacement_m,
        figures.median_displacement_m,
        figures.p95_displacement_m,
        figures.max_displacement_m,
        figures.max_added_m,
    )
    points = (figures.points_removed, figures.points_added, figures.points_moved)
    return (
        name,
        formatted_number(figures.chamfer_distance_m2, 5),
        *(formatted_number(count, 0) for count in points),
        *(formatted_number(length_m or None, 4) for length_m in lengths_m),
    )


def recount_section(summaries: Sequence[Summary]) -> ReportSection:
    heads = ("attack", "objects", "mAP ratio %", "lost (loose)", "success %") + (
        "objects, recounted", "mAP ratio %", "95 %", "lost (loose)", "success %",
    )  # fmt: skip
    lines = []
    for summary in summaries:
        attacked, recounted = summary.result.attacked, summary.result.recounted
        if attacked is None or recounted is None:
            continue
        lines.append(
            (
                title_of(summary, summaries),
                formatted_number(summary.result.counts.objects, 0),
                formatted_number(attacked.map_ratio_percent, 2),
                formatted_number(attacked.lost_objects, 0),
                formatted_number(attacked.attack_success_percent, 1),
                formatted_number(recounted.objects_recounted, 0),
                formatted_number(recounted.map_ratio_percent_recounted, 2),
                interval(recounted.map_ratio_recounted_ci95),
                formatted_number(recounted.lost_objects_recounted, 0),
                formatted_number(recounted.attack_success_percent_recounted, 1),
            )
        )
    return ReportSection(
        "recount",
        "If the objects were counted on the attacked clouds",
        "The objects of the clean clouds are what counts everywhere else. Recounted, those with too few "
        "points left are no objects to find, and others may have become some. The mAP ratio is at strict "
        "overlap; lost, and success, its share of those found, at loose overlap and the working score.",
        (Table("", heads, tuple(lines)),),
    )


def defences_section(summaries: Sequence[Summary]) -> ReportSection:
    heads = (
        "attack", "defence", "mAP clean", "kept %", "mAP attacked", "ratio %", "95 %", "of clean without %",
    )  # fmt: skip
    lines = []
    for summary in summaries:
        clean, attacked = summary.result.clean, summary.result.attacked
        lines.append(
            (
                title_of(summary, summaries),
                "none",
                formatted_number(clean.means["strict"].map_r40, 3),
                formatted_number(100.0, 1),
                formatted_number(attacked and attacked.map_adv, 3),
                formatted_number(attacked and attacked.map_ratio_percent, 2),
                interval(attacked and attacked.map_ratio_ci95),
                formatted_number(attacked and attacked.map_ratio_percent, 2),
            )
        )
        for each in summary.defended:
            lines.append(
                (
                    "",
                    each.defence,
                    formatted_number(each.map_clean, 3),
                    formatted_number(each.clean_map_kept_percent, 1),
                    formatted_number(each.attacked and each.attacked.map_adv, 3),
                    formatted_number(each.attacked and each.attacked.map_ratio_percent, 2),
                    interval(each.attacked and each.attacked.map_ratio_ci95),
                    formatted_number(each.attacked and each.attacked.map_adv_percent, 2),
                )
            )
    return ReportSection(
        "defences",
        "Under defences",
        "Each changes every cloud, clean and attacked, before the detector sees it; no attack knew of it. "
        "Kept: mAP on clean clouds under the defence, in percent of that without. Ratio: attacked to clean, "
        "both under the defence.",
        (Table("", heads, tuple(lines)),),
        records=tuple(each for summary in summaries for each in summary.defended),
    )


def _share(record: SuccessRecord | None) -> str:
    """The objects lost at loose overlap, of those found."""
    if record is None or not record.found_clean:
        return NOTHING
    percent = with_interval(record.attack_success_percent, record.attack_success_ci95, 0)
    return f"{percent} % ({formatted_number(record.lost, 0)} of {formatted_number(record.found_clean, 0)})"


def _strict_share(record: SuccessRecord) -> str:
    """Those lost at strict overlap."""
    if not record.strict_found_clean:
        return NOTHING
    percent = with_interval(record.strict_attack_success_percent, record.strict_attack_success_ci95, 0)
    lost, found = (formatted_number(count, 0) for count in (record.strict_lost, record.strict_found_clean))
    return f"{percent} % ({lost} of {found})"
