"""What a first screen consists of."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.stages.evaluate.report.section import Table


@dataclass(frozen=True)
class Card:
    """One of the main values. interval: its 95 % interval, or why there is none; beside: what it is compared
    with; attacked: the value over the attacked frames alone, where these are not all; term: name of the
    definition that it is linked with."""

    title: str
    value: str
    interval: str = ""
    beside: str = ""
    meaning: str = ""
    term: str = ""
    attacked: str = ""


@dataclass(frozen=True)
class Headline:
    """What one family of attacks did. table: one line an attack, where there are several. section: the id of
    the part of the page that tells more. target: what they change. attacks: their names, as a title
    lists them."""

    verdict: str
    cards: tuple[Card, ...]
    table: Table | None = None
    section: str = ""
    target: str = ""
    attacks: tuple[str, ...] = ()
