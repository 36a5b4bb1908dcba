"""The first screen of a report: what was done, how bad it is in a sentence, and the main values on cards."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.coordinated import CoordinatedRecord
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.v2x import V2xRecord
from advpipe.stages.evaluate.report.headline_detection import clean_headline, detection_headline
from advpipe.stages.evaluate.report.headline_heard import heard_headlines
from advpipe.stages.evaluate.report.headline_messages import localisation_headline, v2x_headline
from advpipe.stages.evaluate.report.headline_parts import Headline
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import attack_name
from advpipe.stages.evaluate.report.wording import changed_points

MOST_NAMES = 3


@dataclass(frozen=True)
class FirstScreen:
    """title: what was done. about: on what, in a line. verdicts: how bad it is, in a sentence or two each.
    headlines: one for each family of attacks."""

    title: str
    about: str
    verdicts: tuple[str, ...]
    headlines: tuple[Headline, ...]


def first_screen(report: Report) -> FirstScreen:
    """What a reader sees first; the clean results only where nothing was attacked."""
    headlines = tuple(_headlines(report))
    if not headlines and report.results:
        headlines = (clean_headline(report.results),)
    verdicts = tuple(headline.verdict for headline in headlines)
    if _is_one_coordinated_attack(report):
        does = _listed([headline.does for headline in headlines if headline.does])
        clauses = _listed([headline.clause for headline in headlines])
        verdicts = (f"The attack {does}. It {clauses}." if does else f"The attack {clauses}.",)
    elif len(headlines) > 1:
        first, *others = (
            f"on {headline.target} {' and '.join(filter(None, (headline.does, headline.clause)))}"
            for headline in headlines
        )
        verdicts = (f"The strongest attack {'; that '.join([first, *others])}.",)
    return FirstScreen(_title(report, headlines), _about(report), verdicts, headlines)


def _headlines(report: Report) -> Iterator[Headline]:
    if any(row.attacked for row in report.results):
        yield detection_headline(report)
    if positions := report.listed(LocalisationRecord):
        yield localisation_headline(positions)
    spoofed = {each.bag for each in positions}
    drives = [each for each in report.listed(V2xRecord) if each.attacks]
    # False fixes change the vehicle's own CAMs, too: without a false message received, that is no V2X attack.
    if own := [each for each in drives if each.false_messages or each.bag not in spoofed]:
        clean = {each.vehicle: each for each in report.listed(V2xRecord) if not each.attack}
        yield v2x_headline(own, clean)
    yield from heard_headlines(report)


def _is_one_coordinated_attack(report: Report) -> bool:
    bags = {each.bag for each in report.listed(CoordinatedRecord)}
    return len(bags) == 1 == sum(1 for each in report.origin.compared if each.sha256)


def _listed(parts: Sequence[str]) -> str:
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def _title(report: Report, headlines: tuple[Headline, ...]) -> str:
    drive = report.origin.clean.scenario or report.origin.clean.bag
    attacked = [row for row in report.results if row.attacked]
    bags = {row.bag for row in attacked}
    others = [name for headline in headlines for name in headline.attacks if name not in bags]
    names = list(dict.fromkeys([*(attack_name(row.attack) for row in attacked), *others]))
    if not names:
        detectors = ", ".join(each.name for each in report.origin.detectors)
        return f"What detector {detectors} finds on the drive {drive}" if detectors else f"The drive {drive}"
    targets = _listed([headline.target for headline in headlines])
    if len(names) > 1:
        return f"{len(names)} attacks on {targets}, drive {drive}"
    if _is_one_coordinated_attack(report):
        return f"Coordinated attack on {targets}, drive {drive}"
    done = changed_points(attacked[0]) if len(attacked) == 1 else None
    about = done.passive if done else headlines[0].done
    return f"Attack {names[0]}{f': {about}' if about else ''}, drive {drive}"


def _about(report: Report) -> str:
    """The detectors, the bags and the frames."""
    parts = [f"clean bag {report.origin.clean.bag}"]
    compared = [each.bag for each in report.origin.compared if each.sha256]
    if 0 < len(compared) <= MOST_NAMES:
        parts.append(f"adversarial bag{'s' if len(compared) > 1 else ''} {', '.join(compared)}")
    elif compared:
        parts.append(f"{len(compared)} adversarial bags")
    if report.results:
        detectors = [f"{each.name} ({', '.join(each.classes)})" for each in report.origin.detectors]
        parts.insert(0, f"detector{'s' if len(detectors) > 1 else ''} {', '.join(detectors)}")
        counts = report.results[0].counts
        parts.append(f"{counted(counts.frames, 'frame')} with {counted(counts.objects, 'evaluated object')}")
    return "; ".join(parts)
