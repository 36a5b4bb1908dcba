"""What a first screen consists of."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.stages.evaluate.report.section import Table

GOOD, BAD = "good", "bad"
"""What a value on a card means for the vehicle; neither where the attack changed nothing."""


@dataclass(frozen=True)
class Card:
    """One of the main values. interval: its 95 % interval, or why there is none; beside: what it is compared
    with, and compared: more on that; attacked: the value over the attacked frames alone, where these are not
    all; term: name of the definition that it is linked with; meant: `GOOD`, `BAD` or neither."""

    title: str
    value: str
    interval: str = ""
    beside: str = ""
    meaning: str = ""
    term: str = ""
    attacked: str = ""
    compared: str = ""
    meant: str = ""


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


def meant_by_more(attacked: float, clean: float) -> str:
    """Bad where the attack at least doubles a value that is better the lower it is."""
    return BAD if attacked > 0 and attacked >= 2 * clean else ""


def meant_by_share(share: float) -> str:
    """Good from 0.9 on, bad below 0.5: of a share in [0, 1] that is better the higher it is."""
    return GOOD if share >= 0.9 else BAD if share < 0.5 else ""
