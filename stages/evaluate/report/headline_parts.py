"""What a first screen consists of."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.stages.evaluate.report.section import Table


@dataclass(frozen=True)
class Card:
    """One of the main values. interval: its 95 % interval, or why there is none; beside: what it is compared
    with, and compared: more on that; attacked: the value over the attacked frames alone, where these are not
    all; term: name of the definition that it is linked with."""

    title: str
    value: str
    interval: str = ""
    beside: str = ""
    meaning: str = ""
    term: str = ""
    attacked: str = ""
    compared: str = ""


@dataclass(frozen=True)
class Headline:
    """What one family of attacks did.

    done: what the attack did, as a title has it. does: the same after the words "the attack". clause: the
    verdict after these words. shown: the attack that the cards are of, where there are several. table: one
    line an attack, where there are several. bag: of the attack on the cards. section: the id of the part of
    the page that tells more. target: what the attacks change. attacks: their names, as a title lists them.
    """

    verdict: str
    cards: tuple[Card, ...]
    done: str = ""
    does: str = ""
    clause: str = ""
    shown: str = ""
    table: Table | None = None
    bag: str = ""
    section: str = ""
    target: str = ""
    attacks: tuple[str, ...] = ()
