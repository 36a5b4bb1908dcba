"""Sections about attacked clouds: baselines, lost objects, displacements, the recount, defences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.stages.evaluate.detection.arm import WHOLE
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.numbers import NOTHING, interval, number, short_name, with_interval
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import Section, Table
from advpipe.stages.evaluate.report.transfer import transfer_section
from advpipe.stages.evaluate.report.wording import OVERLAPS, PLAIN_RANDOM, RANDOM_BEST

ANSWER = {True: "yes", False: "no", None: NOTHING}


def attacked_sections(summaries: Sequence[Summary]) -> Iterator[Section]:
    """Those that there is something to say in."""
    attacked = [summary for summary in summaries if summary.comparison.bag]
    if any(summary.row["baselines"] for summary in attacked):
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
    title = attack_title(summary.row) if summary.comparison.bag else "clean"
    alike = [each for each in summaries if attack_title(each.row) == attack_title(summary.row)]
    if len({each.comparison.name for each in alike}) > 1:
        title += f" ({summary.comparison.name})"
    if len({each.comparison.detector for each in summaries}) > 1:
        title += f", seen by {short_name(summary.comparison.detector)}"
    return title


def baselines_section(summaries: Sequence[Summary]) -> Section:
    heads = (
        *("attack", f"{PLAIN_RANDOM} baseline", "its ratio %", "95 %"),
        *("attack minus it", "95 %", "beats it"),
    )
    lines = []
    for summary in summaries:
        row, title = summary.row, title_of(summary, summaries)
        for word in _words(row):
            lines.append(
                (
                    title,
                    baseline_title(word),
                    number(row[f"{word}_map_ratio_percent"], 2),
                    interval(row[f"{word}_map_ratio_ci95"]),
                    number(row[f"map_ratio_minus_{word}"], 2),
                    interval(row[f"map_ratio_minus_{word}_ci95"]),
                    ANSWER[_flag(row[f"beats_{word}"])],
                )
            )
            title = ""
    return Section(
        "baselines",
        "Against the same budget spent plainly at random",
        "Differences in points of mAP ratio, drawn together with the attack; an attack beats a baseline if "
        f"the 95 % interval of the difference lies below 0. {RANDOM_BEST}",
        (Table("", heads, tuple(lines)),),
        records=tuple(
            {
                **{
                    key: summary.row[key]
                    for key in ("bag", "detector", "attack", "recipe", "parameter", "value")
                },
                "baseline": word,
                "map_ratio_percent": summary.row[f"{word}_map_ratio_percent"],
                "map_ratio_ci95": summary.row[f"{word}_map_ratio_ci95"],
                "minus": summary.row[f"map_ratio_minus_{word}"],
                "minus_ci95": summary.row[f"map_ratio_minus_{word}_ci95"],
                "beats": summary.row[f"beats_{word}"],
            }
            for summary in summaries
            for word in _words(summary.row)
        ),
    )


def success_section(summaries: Sequence[Summary]) -> Section:
    """Attack success by class and range; beside the attack one draw of the baseline at random anywhere."""
    ranges = [WHOLE, *(stratum.name for stratum in STRATA if stratum.by == "range")]
    scores = {number(summary.min_score, 2) for summary in summaries}
    score = scores.pop() if len(scores) == 1 else "the working score of its bag"
    heads = (
        *("class", "strict: lost of found", *(f"loose, {name}: lost of found" for name in ranges)),
        *("one random draw, loose", "new FP", "one random draw"),
    )
    tables = []
    for summary in summaries:
        found = {(row["cloud"], row["class"], row["range"]): row for row in summary.success}
        names = [name for _, name, place in found if place == WHOLE and ("adv", name, place) in found]
        lines = []
        for name in dict.fromkeys(names):
            mine = [found["adv", name, place] for place in ranges]
            random = found.get(("baseline", name, WHOLE), {})
            lines.append(
                (
                    "every class" if name == EVERY_CLASS else str(name),
                    _share(mine[0], "strict_"),
                    *(_share(row) for row in mine),
                    _share(random),
                    number(mine[0]["new_false_positives"], 0),
                    number(random.get("new_false_positives"), 0),
                )
            )
        tables.append(Table(title_of(summary, summaries), heads, tuple(lines)))
    return Section(
        "attack_success",
        "Attack success by class and range",
        "Lost objects: those that the detector finds on the clean cloud and misses on the attacked one, in "
        f"percent of those found, with a 95 % interval; with a score of at least {score}, and by the overlap "
        f"that stands above the column ({OVERLAPS}). A new FP is a detection that finds nothing, where none "
        "was before. The random draw, anywhere, is the weakest of the baselines.",
        tuple(tables),
        records=tuple(row for summary in summaries for row in summary.success),
    )


def change_section(summaries: Sequence[Summary]) -> Section:
    """What was done to the clouds, told from the bags as stored."""
    heads = (
        "cloud", "CD m²", "removed", "added", "moved", "mean m", "RMS m", "median m", "95 % below m",
        "farthest m", "added, farthest m",
    )  # fmt: skip
    tables = []
    for summary in summaries:
        words = ["", *(f"{word}_" for word in _words(summary.row))]
        lines = tuple(
            (
                baseline_title(prefix.removesuffix("_")) if prefix else "attacked",
                number(summary.row[f"{prefix}chamfer_distance_m2"], 5),
                *(number(summary.row[f"{prefix}points_{what}"], 0) for what in ("removed", "added", "moved")),
                *(
                    number(summary.row[f"{prefix}{what}_displacement_m"] or None, 4)
                    for what in ("mean", "rms", "median", "p95", "max")
                ),
                number(summary.row[f"{prefix}max_added_m"] or None, 4),
            )
            for prefix in words
        )
        tables.append(Table(title_of(summary, summaries), heads, lines))
    return Section(
        "changes",
        "What was done to the clouds",
        "Read from the stored bags. Lengths are of the moved points, between the coordinates as stored; of "
        "an added point, to the nearest point of the clean cloud.",
        tuple(tables),
    )


def recount_section(summaries: Sequence[Summary]) -> Section:
    heads = ("attack", "objects", "mAP ratio %", "lost (loose)", "success %") + (
        "objects, recounted", "mAP ratio %", "95 %", "lost (loose)", "success %",
    )  # fmt: skip
    lines = []
    for summary in summaries:
        row = summary.row
        lines.append(
            (
                title_of(summary, summaries),
                number(row["objects"], 0),
                number(row["map_ratio_percent"], 2),
                number(row["lost_objects"], 0),
                number(row["attack_success_percent"], 1),
                number(row["objects_recounted"], 0),
                number(row["map_ratio_percent_recounted"], 2),
                interval(row["map_ratio_recounted_ci95"]),
                number(row["lost_objects_recounted"], 0),
                number(row["attack_success_percent_recounted"], 1),
            )
        )
    return Section(
        "recount",
        "If the objects were counted on the attacked clouds",
        "The objects of the clean clouds are what counts everywhere else. Recounted, those with too few "
        "points left are no objects to find, and others may have become some. The mAP ratio is at strict "
        "overlap; lost, and success, its share of those found, at loose overlap and the working score.",
        (Table("", heads, tuple(lines)),),
    )


def defences_section(summaries: Sequence[Summary]) -> Section:
    heads = (
        "attack", "defence", "mAP clean", "kept %", "mAP attacked", "ratio %", "95 %", "of clean without %",
    )  # fmt: skip
    lines = []
    for summary in summaries:
        row, title = summary.row, title_of(summary, summaries)
        lines.append(
            (
                title,
                "none",
                number(row["map_clean"], 3),
                number(100.0, 1),
                number(row["map_adv"], 3),
                number(row["map_ratio_percent"], 2),
                interval(row["map_ratio_ci95"]),
                number(row["map_ratio_percent"], 2),
            )
        )
        for each in summary.defended:
            lines.append(
                (
                    "",
                    str(each["defence"]),
                    number(each["map_clean"], 3),
                    number(each["kept_percent"], 1),
                    number(each.get("map_adv"), 3),
                    number(each.get("map_ratio_percent"), 2),
                    interval(each.get("map_ratio_ci95")),
                    number(each.get("map_adv_percent"), 2),
                )
            )
    return Section(
        "defences",
        "Under defences",
        "Each changes every cloud, clean and attacked, before the detector sees it; no attack knew of it. "
        "Kept: mAP on clean clouds under the defence, in percent of that without. Ratio: attacked to clean, "
        "both under the defence.",
        (Table("", heads, tuple(lines)),),
        records=tuple(row for summary in summaries for row in summary.defended),
    )


def _words(row: Row) -> list[str]:
    words = row["baselines"]
    return [str(word) for word in words] if isinstance(words, list) else []


def _share(row: Row, prefix: str = "") -> str:
    if not row or not row[f"{prefix}found_clean"]:
        return NOTHING
    counts = f"{number(row[f'{prefix}lost'], 0)} of {number(row[f'{prefix}found_clean'], 0)}"
    percent, bounds = row[f"{prefix}attack_success_percent"], row[f"{prefix}attack_success_ci95"]
    return f"{with_interval(percent, bounds, 0)} % ({counts})"


def _flag(value: object) -> bool | None:
    return value if isinstance(value, bool) else None
