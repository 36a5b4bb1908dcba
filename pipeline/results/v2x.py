"""What `report.json` lists as `v2x`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Flat, Listed


@dataclass(frozen=True)
class ScoreFigures:
    """How well lies are told from honest messages; each as `misbehaviour.scores.Scores` has it."""

    precision: float
    recall: float
    f1: float
    mcc: float
    latency_s: float
    caught: float
    false_positive_rate: float


@dataclass(frozen=True)
class AttackScores:
    """Our detector and the baseline on the lies of one attack and all honest messages."""

    attack: str
    false_messages: int
    ours: Annotated[ScoreFigures, Flat("")]
    baseline: Annotated[ScoreFigures, Flat("baseline_")]


@dataclass(frozen=True)
class LdmFigures:
    """A Local Dynamic Map against the truth: means over time, and the most false entries at once."""

    known: float
    stations: float
    false_entries: float
    false_entries_max: float
    missing: float
    displaced: float
    error_m: float


@dataclass(frozen=True)
class Warnings:
    """What a warning fed by the map did against one fed by the truth.

    alarms, dangers: warnings by the map and by the truth, each counted once while it lasts. false_alarms:
    alarms with no danger near in time; misses: dangers with no alarm. Seconds: how long each was on.
    """

    alarms: int
    dangers: int
    false_alarms: int
    misses: int
    alarm_s: float
    danger_s: float
    false_alarm_s: float


@dataclass(frozen=True)
class RadioFigures:
    """Messages sent and never sent, of everybody, attackers included; the share of pairs of such a message
    and a receiver within 300 m that is delivered; channel busy ratios over stations and time; mean delay.

    Of whole drives: bags tell of no single pair.
    """

    cams: int
    dropped: int
    delivered: float
    busy_mean: float
    busy_max: float
    delay_s: float


@dataclass(frozen=True)
class V2xRecord(Listed):
    """What one listener made of the messages of a bag.

    attack, attacks: all of the bag's in one word, and each by itself. messages, lies, undecoded: of all
    listeners. has_roads: whether the bag tells its roads, which some checks need. honest_delivered: the share
    of the messages near the listener that no attack touched that it received, and of the same ones in the
    clean drive. radio: None for a part of a drive.
    """

    bag: str
    vehicle: str
    attack: str
    false_messages: int
    messages: int
    undecoded: int
    has_roads: bool
    attacks: tuple[AttackScores, ...]
    honest_delivered: float
    honest_delivered_clean: float
    ours: Annotated[ScoreFigures, Flat("")]
    baseline: Annotated[ScoreFigures, Flat("baseline_")]
    ldm: Annotated[LdmFigures, Flat("ldm_")]
    warning: Annotated[Warnings, Flat("warning_")]
    radio: Annotated[RadioFigures | None, Flat("radio_")]
