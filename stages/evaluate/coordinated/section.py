"""The report's part on coordinated attacks: attacks of several families on one vehicle, on one time axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.results.coordinated import (
    AttackedCounts,
    AttacksByTarget,
    CoordinatedRecord,
    TogetherMetrics,
)
from advpipe.stages.evaluate.coordinated.attack_timeline import AttackTimeline, read_attack_timelines
from advpipe.stages.evaluate.coordinated.effects import DetectedFrames, Effect, believed_track, effects
from advpipe.stages.evaluate.coordinated.picture import draw_coordinated
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

FORMULAS = (
    Formula(
        "together",
        "from the beginning of the attack that begins last to the end of the one that ends first. Messages "
        "count when they are sent; a message attack without a target attacks all vehicles that receive "
        "messages",
        ("from_s", "to_s", "own_place_m", "map_wrong", "points_touched"),
        title="While all attacks are active",
    ),
)

SINGLE = {"fixes": "fix", "messages": "message", "clouds": "cloud", "scans": "scan", "images": "image"}


def coordinated_sections(
    clean: Path,
    adversarial: Sequence[Path],
    seed: int = 0,
    window: Window = WHOLE_DRIVE,
    detected: Mapping[Path, DetectedFrames] | None = None,
) -> tuple[ReportSection, ...]:
    """One section on the vehicles that attacks of several families attack in one bag; else none.

    window: the part of the drive that is evaluated; bags whose attacks do not meet in it are named. `seed`
    is not used. Raises AdvpipeError for labels that cannot be read.
    """
    del seed
    reader = BagReader(clean)
    start_ns = min(
        (int(t[0]) for t in map(reader.log_times_ns, reader.topics) if len(t)),
        default=0,
    )
    leads: list[str] = []
    lines: list[tuple[str, ...]] = []
    outcomes: list[tuple[str, ...]] = []
    pictures: list[ReportPicture] = []
    records: list[CoordinatedRecord] = []
    attacked = [
        (bag, *each) for bag in adversarial for each in read_attack_timelines(reader, bag, window).items()
    ]
    together_on = [each for each in attacked if len(each[2]) > 1]
    if together_on:
        for bag, vehicle, timelines in track(together_on, "coordinated attacks", len(together_on)):
            name = bag_name(bag)
            span_ns, seen = together(timelines), (detected or {}).get(bag)
            found_effects = list(effects(reader, bag, vehicle, window, seen))
            leads.append(_lead(name, vehicle, timelines, span_ns, start_ns))
            lines += [_line(name, one, start_ns) for one in timelines]
            if span_ns is not None:
                outcomes += [_outcome(name, vehicle, effect, span_ns) for effect in found_effects]
            records.append(_record(name, vehicle, timelines, found_effects, span_ns, start_ns))
            caption = (
                f"{name}: the attacks on {vehicle} and their effects; below, where it was and where it "
                "believed to be"
            )
            believed = believed_track(bag, vehicle, window)
            figure = draw_coordinated(timelines, found_effects, span_ns, start_ns, believed)
            file_name = f"{name}-{vehicle}-coordinated.png"
            pictures.append(picture_of(SECTION, name, file_name, caption, figure))
    apart = [bag for bag in adversarial if bag not in {each[0] for each in together_on}]
    names = [bag_name(bag) for bag in apart if _has_several_families(bag)]
    if window != WHOLE_DRIVE and names:
        leads.append(f"{', '.join(names)}: no vehicle is attacked in two ways in this window.")
    if not leads:
        return ()
    heads = ("bag", "vehicle", "attack", "attacked", "first s", "last s")
    tables = [Table("Attack times", heads, tuple(lines))] if lines else []
    if outcomes:
        title = "Means while all attacks are active"
        tables.append(Table(title, ("bag", "vehicle", "effect", "clean", "attacked"), tuple(outcomes)))
    return (
        ReportSection(
            key="coordinated",
            title="Coordinated attacks",
            lead=" ".join(leads),
            tables=tuple(tables),
            pictures=tuple(pictures),
            records=tuple(records),
            formulas=FORMULAS,
            terminal=_overview(lines, outcomes),
        ),
    )


def together(timelines: Sequence[AttackTimeline]) -> tuple[int, int] | None:
    """The time in which all attacks are active, in nanoseconds; None if there is none."""
    begin_ns = max(int(one.times_ns[0]) for one in timelines)
    end_ns = min(int(one.times_ns[-1]) for one in timelines)
    return (begin_ns, end_ns) if begin_ns <= end_ns else None


def _overview(lines: Sequence[tuple[str, ...]], outcomes: Sequence[tuple[str, ...]]) -> tuple[Table, ...]:
    """The main columns of both tables, for a terminal."""
    times = Table(
        "Coordinated attacks: what was attacked when",
        ("attack", "attacked", "first s", "last s"),
        tuple((f"{bag}: {attack} on {vehicle}", *cells) for bag, vehicle, attack, *cells in lines),
    )
    effects_of_all = Table(
        "Means while all attacks are active",
        ("effect", "clean", "attacked"),
        tuple((f"{bag}: {vehicle}: {effect}", *cells) for bag, vehicle, effect, *cells in outcomes),
    )
    return tuple(table for table in (times, effects_of_all) if table.lines)


def _has_several_families(bag: Path) -> bool:
    """Whether a bag was attacked in several ways: fixes, messages, clouds, scans, images."""
    return len({one.family for one in BagReader(bag).provenance.fields.attacks}) > 1


def _lead(
    name: str,
    vehicle: str,
    timelines: Sequence[AttackTimeline],
    span_ns: tuple[int, int] | None,
    start_ns: int,
) -> str:
    *others, last = [" + ".join(one.attacks) for one in timelines]
    listed = f"{', '.join(others)} and {last}"
    if span_ns is None:
        return f"{name}: {listed} attack {vehicle}, but never at the same time."
    begin_s, end_s = ((ns - start_ns) / 1e9 for ns in span_ns)
    return f"{name}: {listed} attack {vehicle} together from {begin_s:.1f} to {end_s:.1f} s."


def _line(name: str, one: AttackTimeline, start_ns: int) -> tuple[str, ...]:
    ends_s = [formatted_number((int(ns) - start_ns) / 1e9, 1) for ns in (one.times_ns[0], one.times_ns[-1])]
    return (name, one.vehicle, " + ".join(one.attacks), _count(one), *ends_s)


def _count(one: AttackTimeline) -> str:
    """Such as `1 fix`, `12 messages`."""
    return f"1 {SINGLE[one.what]}" if len(one.times_ns) == 1 else f"{len(one.times_ns):,} {one.what}"


def _outcome(name: str, vehicle: str, effect: Effect, span_ns: tuple[int, int]) -> tuple[str, ...]:
    figures = (
        formatted_number(each.mean(*span_ns), effect.digits) for each in (effect.clean, effect.attacked)
    )
    return (name, vehicle, effect.title, *figures)


def _record(
    name: str,
    vehicle: str,
    timelines: Sequence[AttackTimeline],
    found_effects: Sequence[Effect],
    span_ns: tuple[int, int] | None,
    start_ns: int,
) -> CoordinatedRecord:
    found = CoordinatedRecord(
        name,
        vehicle,
        attacks=AttacksByTarget(**{one.what: one.attacks for one in timelines}),
        attacked=AttackedCounts(**{one.what: len(one.times_ns) for one in timelines}),
    )
    if span_ns is None:
        return found
    means = {effect.key: effect.attacked.mean(*span_ns) for effect in found_effects}
    means |= {f"{effect.key}_clean": effect.clean.mean(*span_ns) for effect in found_effects}
    from_s, to_s = ((ns - start_ns) / 1e9 for ns in span_ns)
    return replace(found, together=TogetherMetrics(from_s, to_s, **means))
