"""The report's part on coordinated attacks: several kinds at once, on one vehicle, on one time axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.results.coordinated import (
    AttackedCounts,
    AttacksByTarget,
    CoordinatedRecord,
    TogetherFigures,
)
from advpipe.stages.evaluate.coordinated.attack_timeline import AttackTimeline, read_struck
from advpipe.stages.evaluate.coordinated.effects import Effect, effects
from advpipe.stages.evaluate.coordinated.picture import draw_coordinated
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.section import SECTION, ReportPicture, ReportSection, Table

FORMULAS = (
    (
        "together",
        "from the first strike of the attack that begins last to the last strike of the one that ends first; "
        "messages count when they are sent, and strike the vehicle that the attack aims at, or without one "
        "all that listen",
    ),
)


def coordinated_sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, window: Window = WHOLE_DRIVE
) -> tuple[ReportSection, ...]:
    """One section on the vehicles that attacks of two kinds or three strike in one bag; else none.

    window: what strikes outside of it counts for nothing; bags of attacks that do not meet in it are named.
    `seed` serves no draw here. Raises AdvpipeError for labels that cannot be read.
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
    struck = [(bag, *each) for bag in adversarial for each in read_struck(reader, bag, window).items()]
    together_on = [each for each in struck if len(each[2]) > 1]
    if together_on:
        for bag, vehicle, strikes in track(together_on, "coordinated attacks", len(together_on)):
            name = bag_name(bag)
            span_ns, told = together(strikes), list(effects(reader, bag, vehicle, window))
            leads.append(_lead(name, vehicle, strikes, span_ns, start_ns))
            lines += [_line(name, one, start_ns) for one in strikes]
            if span_ns is not None:
                outcomes += [_outcome(name, vehicle, effect, span_ns) for effect in told]
            records.append(_record(name, vehicle, strikes, told, span_ns, start_ns))
            caption = f"{name}: what strikes {vehicle}, and what becomes of it"
            png = to_png(draw_coordinated(strikes, told, span_ns, start_ns))
            pictures.append(ReportPicture(SECTION, name, f"{name}-{vehicle}-coordinated.png", caption, png))
    apart = [bag for bag in adversarial if bag not in {each[0] for each in together_on}]
    if window != WHOLE_DRIVE and (idle := [bag_name(bag) for bag in apart if _is_of_kinds(bag)]):
        leads.append(f"{', '.join(idle)}: no vehicle is attacked in two ways in this window.")
    if not leads:
        return ()
    heads = ("bag", "vehicle", "attack", "strikes", "first s", "last s")
    tables = [Table("What strikes when", heads, tuple(lines))] if lines else []
    if outcomes:
        title = "While all strike, means"
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
        ),
    )


def together(strikes: Sequence[AttackTimeline]) -> tuple[int, int] | None:
    """From when to when all strike, in nanoseconds; None for never."""
    begin_ns = max(int(one.times_ns[0]) for one in strikes)
    end_ns = min(int(one.times_ns[-1]) for one in strikes)
    return (begin_ns, end_ns) if begin_ns <= end_ns else None


def _is_of_kinds(bag: Path) -> bool:
    """Whether a bag was attacked in two ways or three: fixes, messages, clouds."""
    return len({one.family for one in BagReader(bag).provenance.fields.attacks}) > 1


def _lead(
    name: str, vehicle: str, strikes: Sequence[AttackTimeline], span_ns: tuple[int, int] | None, start_ns: int
) -> str:
    *others, last = [" + ".join(one.attacks) for one in strikes]
    words = f"{', '.join(others)} and {last}"
    if span_ns is None:
        return f"{name}: {words} strike {vehicle}, but never at the same time."
    begin_s, end_s = ((ns - start_ns) / 1e9 for ns in span_ns)
    return f"{name}: {words} strike {vehicle} together from {begin_s:.1f} to {end_s:.1f} s."


def _line(name: str, one: AttackTimeline, start_ns: int) -> tuple[str, ...]:
    ends_s = [formatted_number((int(ns) - start_ns) / 1e9, 1) for ns in (one.times_ns[0], one.times_ns[-1])]
    return (name, one.vehicle, " + ".join(one.attacks), f"{len(one.times_ns):,} {one.what}", *ends_s)


def _outcome(name: str, vehicle: str, effect: Effect, span_ns: tuple[int, int]) -> tuple[str, ...]:
    figures = (
        formatted_number(each.mean(*span_ns), effect.digits) for each in (effect.clean, effect.attacked)
    )
    return (name, vehicle, effect.title, *figures)


def _record(
    name: str,
    vehicle: str,
    strikes: Sequence[AttackTimeline],
    told: Sequence[Effect],
    span_ns: tuple[int, int] | None,
    start_ns: int,
) -> CoordinatedRecord:
    found = CoordinatedRecord(
        name,
        vehicle,
        attacks=AttacksByTarget(**{one.what: one.attacks for one in strikes}),
        attacked=AttackedCounts(**{one.what: len(one.times_ns) for one in strikes}),
    )
    if span_ns is None:
        return found
    means = {effect.key: effect.attacked.mean(*span_ns) for effect in told}
    means |= {f"{effect.key}_clean": effect.clean.mean(*span_ns) for effect in told}
    from_s, to_s = ((ns - start_ns) / 1e9 for ns in span_ns)
    return replace(found, together=TogetherFigures(from_s, to_s, **means))
