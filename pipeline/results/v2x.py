"""What `report.json` lists as `v2x`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Flat, Listed


@dataclass(frozen=True)
class ScoreMetrics:
    """How well false messages are told apart from honest ones; each as in `misbehaviour.scores.Scores`."""

    precision: Annotated[float, "precision of flagged messages, in [0, 1]; null where none is flagged"]
    recall: Annotated[float, "share of false messages that are flagged, in [0, 1]"]
    f1: Annotated[float, "F1 of messages, in [0, 1]"]
    mcc: Annotated[float, "Matthews' correlation coefficient, in [-1, 1]"]
    latency_s: Annotated[
        float, "mean time from an attacker's first false message to its first flagged one, in seconds"
    ]
    caught: Annotated[float, "share of attackers with any flagged false message, in [0, 1]"]
    false_positive_rate: Annotated[float, "share of honest messages that are flagged, in [0, 1]"]
    innocent_false_positive_rate: Annotated[
        float, "share of the messages of stations that do not attack that are flagged, in [0, 1]"
    ]


@dataclass(frozen=True)
class DetectorRecord:
    """One misbehaviour detector on the false messages of one attack and all honest messages. The points of
    the curve run from (0, 0) to (1, 1), 65 of them at most; none where no message is false."""

    detector: Annotated[str, "name of the misbehaviour detector, or the user's `module:Class`"]
    scores: Annotated[ScoreMetrics, Flat("")]
    auc: Annotated[float, "area under the ROC curve of the detector's scores of messages, in [0, 1]"]
    roc_false_positive_rates: Annotated[
        tuple[float, ...], "share of honest messages above each threshold of the curve, in [0, 1]"
    ]
    roc_recalls: Annotated[
        tuple[float, ...], "share of false messages above each threshold of the curve, in [0, 1]"
    ]


@dataclass(frozen=True)
class AttackScores:
    """The detectors on the false messages of one attack and all honest messages."""

    attack: Annotated[str, "name of the attack, with the part of a mix"]
    false_messages: Annotated[int, "number of its false messages received"]
    ours: Annotated[ScoreMetrics, Flat("")]
    baseline: Annotated[ScoreMetrics, Flat("baseline_", "baseline: ")]
    detectors: Annotated[tuple[DetectorRecord, ...], "every misbehaviour detector, with its ROC curve"]


@dataclass(frozen=True)
class LdmMetrics:
    """A Local Dynamic Map against the truth: means over time, and the most false entries at once."""

    known: Annotated[float, "mean number of entries"]
    stations: Annotated[float, "mean number of stations within 150 m"]
    false_entries: Annotated[float, "mean number of entries of stations that do not exist"]
    false_entries_max: Annotated[float, "largest number of such entries at once"]
    missing: Annotated[float, "mean number of stations within 150 m without an entry"]
    displaced: Annotated[float, "mean number of entries more than 3 m from their station"]
    error_m: Annotated[float, "mean distance of entries from their stations, in metres"]


@dataclass(frozen=True)
class Warnings:
    """What a warning fed by the map did against one fed by the truth.

    alarms, dangers: warnings by the map and by the truth, each counted once while it lasts. false_alarms:
    alarms with no danger near in time; misses: dangers with no alarm. Seconds: how long each was on.
    """

    alarms: Annotated[int, "number of collision warnings fed by the Local Dynamic Map"]
    dangers: Annotated[int, "number of collision warnings fed by true positions"]
    false_alarms: Annotated[int, "number of alarms without a danger within 1 s"]
    misses: Annotated[int, "number of dangers without an alarm within 1 s"]
    alarm_s: Annotated[float, "time with an alarm, in seconds"]
    danger_s: Annotated[float, "time with a danger, in seconds"]
    false_alarm_s: Annotated[float, "time with a false alarm, in seconds"]


@dataclass(frozen=True)
class RadioMetrics:
    """Messages sent and never sent, of everybody, attackers included; the share of pairs of such a message
    and a receiver within 300 m that is delivered; channel busy ratios over stations and time; mean delay.

    Of whole drives: bags do not record single pairs.
    """

    cams: Annotated[int, "number of messages sent by all stations, including attackers"]
    dropped: Annotated[int, "number of messages generated but never sent"]
    delivered: Annotated[
        float, "share of pairs of message and receiver within 300 m that were delivered, in [0, 1]"
    ]
    busy_mean: Annotated[float, "channel busy ratio, mean over stations and time, in [0, 1]"]
    busy_max: Annotated[float, "largest channel busy ratio of a station in 100 ms, in [0, 1]"]
    delay_s: Annotated[float, "mean delay from request to reception, in seconds"]


@dataclass(frozen=True)
class V2xRecord(Listed):
    """The messages of a bag as one listener evaluates them.

    attack, attacks: all of the bag's in one text, and each by itself. messages, false_messages, undecoded:
    of all listeners. has_roads: whether the bag holds its roads, which some checks need. honest_delivered: of
    the messages near the listener that no attack touched, the share that it received; and of the same ones
    in the clean drive. ldm_attacked, ldm_attacked_clean: of the maps from the first attacked message to the
    last, and of the clean drive in this time; None where no message is attacked. radio: None for a part of a
    drive.
    """

    bag: Annotated[str, "adversarial bag, or `clean`"]
    vehicle: Annotated[str, "receiving vehicle"]
    attack: Annotated[str, "names of the bag's attacks in one text; empty for the clean bag"]
    false_messages: Annotated[int, "number of false messages received by all instrumented vehicles"]
    messages: Annotated[int, "number of messages received by all instrumented vehicles"]
    undecoded: Annotated[int, "number of received messages that are not CAMs and were not sent by an attack"]
    has_roads: Annotated[bool, "whether the bag holds its roads, which some checks need"]
    attacks: Annotated[tuple[AttackScores, ...], "the detectors' scores for each attack of the bag"]
    honest_delivered: Annotated[
        float, "share of untouched messages sent within 300 m that the vehicle received, in [0, 1]"
    ]
    honest_delivered_clean: Annotated[
        float, "share of the same messages that it received in the clean drive, in [0, 1]"
    ]
    ours: Annotated[ScoreMetrics, Flat("")]
    baseline: Annotated[ScoreMetrics, Flat("baseline_", "baseline: ")]
    ldm: Annotated[LdmMetrics, Flat("ldm_", "Local Dynamic Map: ")]
    ldm_attacked: Annotated[
        LdmMetrics | None,
        Flat("ldm_attacked_", "Local Dynamic Map, from the first attacked message sent to the last: "),
    ]
    ldm_attacked_clean: Annotated[
        LdmMetrics | None,
        Flat("ldm_attacked_clean_", "Local Dynamic Map, clean drive in that time: "),
    ]
    warning: Annotated[Warnings, Flat("warning_", "forward-collision warning: ")]
    radio: Annotated[RadioMetrics | None, Flat("radio_", "radio channel: ")]
