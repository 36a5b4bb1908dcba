"""Scores of misbehaviour detectors on false and honest messages, by attack."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.messages import MessageLabel, are_false
from advpipe.pipeline.misbehaviour.detectors import BASELINE, MISBEHAVIOUR_DETECTORS, OURS
from advpipe.pipeline.misbehaviour.roc import RocCurve, roc_curve
from advpipe.pipeline.misbehaviour.scores import Bools, Scores, scores
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector, Verdicts
from advpipe.stages.evaluate.v2x.receptions import ListenerReceptions


@dataclass(frozen=True)
class DetectorResult:
    """The scores of one detector's flags, and the thinned curve of its scores."""

    scores: Scores
    roc: RocCurve


@dataclass(frozen=True, kw_only=True)
class ScoredDetectors:
    """The results of misbehaviour detectors on the same messages, by name."""

    detectors: Mapping[str, DetectorResult]

    @property
    def ours(self) -> Scores:
        """The scores of our detector."""
        return self.detectors[OURS].scores

    @property
    def baseline(self) -> Scores:
        """The scores of CaTCH's checks, tuned as ours are."""
        return self.detectors[BASELINE].scores


@dataclass(frozen=True, kw_only=True)
class ScoredAttack(ScoredDetectors):
    """One attack of a bag, scored on its false messages and all honest ones, without those of other attacks.

    attack: with the part of a mix, if labelled. published: F1 of CaTCH on other data, or
    NaN.
    """

    attack: str
    false_messages: int
    published: float


@dataclass(frozen=True)
class ListenerVerdicts:
    """What all detectors say of the M messages that a listener received, by detector.

    numbers: of the message as in /v2x/sent, None where unknown. The others are (M,). is_counted: in the
    window, and known to be false or honest. is_scored: and a CAM, or false.
    """

    listener: str
    numbers: list[int | None]
    arrivals_ns: list[int]
    is_false: Bools
    is_counted: Bools
    is_scored: Bools
    detectors: Mapping[str, Verdicts]


@dataclass(frozen=True, kw_only=True)
class Detection(ScoredDetectors):
    """The results of detectors on the messages that all listeners of a bag received.

    attack: empty for a clean bag. messages, false_messages: received, where the bag records their senders.
    undecoded: messages that are not CAMs and were not sent by an attack; decoders drop them, and they do not
    count. detectors: on all messages. parts: by attack. flagged_by_check: false messages that each
    check of ours flags, most first.
    """

    attack: str
    messages: int
    false_messages: int
    undecoded: int
    parts: tuple[ScoredAttack, ...]
    flagged_by_check: dict[str, int]
    verdicts: tuple[ListenerVerdicts, ...] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True)
class _ScoredMessages:
    """The M received messages that count, (M,) each: numbers, senders, whether these attack, and arrival
    times; flags and scores by detector."""

    numbers: list[int | None]
    senders: np.ndarray[Any, np.dtype[np.int64]]
    is_attackers: Bools
    times_s: Float64
    flagged: Mapping[str, Bools]
    values: Mapping[str, Float64]

    def results(self, is_false_message: Bools, chosen: Bools) -> dict[str, DetectorResult]:
        """The result of each detector on the chosen messages."""
        is_false = is_false_message[chosen]
        about = is_false, self.senders[chosen], self.times_s[chosen], self.is_attackers[chosen]
        return {
            name: DetectorResult(
                scores(flagged[chosen], *about), roc_curve(self.values[name][chosen], is_false).thinned()
            )
            for name, flagged in self.flagged.items()
        }


def detect(
    receptions: Sequence[ListenerReceptions],
    labels: Sequence[MessageLabel] = (),
    detectors: Mapping[str, MisbehaviourDetector] = MISBEHAVIOUR_DETECTORS,
    published: Mapping[str, float] | None = None,
    window: Window = WHOLE_DRIVE,
) -> Detection:
    """Run detectors on what each vehicle received, and score them by the labels.

    published: F1 for each attack in the bag, as `published_f1` reads it. window: messages that arrive in it
    count; detectors remember earlier ones. Without labels there are no false messages; with labels, a message
    counts if the bag records which sent message it was.
    """
    verdicts = tuple(_verdicts(each, labels, detectors, window) for each in receptions)
    messages = _scored_messages(receptions, verdicts, labels)
    is_false_message = _joined([each.is_false[each.is_scored] for each in verdicts], bool)
    everything = np.ones(len(is_false_message), bool)
    flagged_by_check: Counter[str] = Counter()
    for each in verdicts:
        for name, check in each.detectors[OURS].checks.items():
            flagged_by_check[name] += int((check.flagged & each.is_false & each.is_scored).sum())
    received = sum(int(each.is_counted.sum()) for each in verdicts)
    return Detection(
        attack=" + ".join(sorted({label.attack for label in labels})),
        messages=received,
        false_messages=int(is_false_message.sum()),
        undecoded=received - len(is_false_message),
        detectors=messages.results(is_false_message, everything),
        parts=tuple(_parts(messages, labels, is_false_message, published or {})),
        flagged_by_check={name: count for name, count in flagged_by_check.most_common() if count},
        verdicts=verdicts,
    )


def _verdicts(
    each: ListenerReceptions,
    labels: Sequence[MessageLabel],
    detectors: Mapping[str, MisbehaviourDetector],
    window: Window,
) -> ListenerVerdicts:
    """The verdicts on all messages of a listener."""
    numbers, arrivals_ns = each.numbers, [one.arrival_ns for one in each.received]
    is_false = are_false(numbers, labels)
    is_counted = window.holds(arrivals_ns)
    if labels:
        is_counted &= np.array([number is not None for number in numbers], bool)
    is_scored = is_counted & (np.array([claim.is_cam for claim in each.claims], bool) | is_false)
    found = {name: detector.judge(each.claims, each.receivers) for name, detector in detectors.items()}
    return ListenerVerdicts(each.listener, numbers, arrivals_ns, is_false, is_counted, is_scored, found)


def _scored_messages(
    receptions: Sequence[ListenerReceptions],
    verdicts: Sequence[ListenerVerdicts],
    labels: Sequence[MessageLabel],
) -> _ScoredMessages:
    """The messages of all listeners that are scored."""
    attackers = {label.station_id for label in labels if label.attacker}
    pairs = list(zip(receptions, verdicts, strict=True))
    kept = [
        (place, one)
        for place, (each, judged) in enumerate(pairs)
        for one, is_scored in zip(each.received, judged.is_scored, strict=True)
        if is_scored
    ]
    names = list(verdicts[0].detectors) if verdicts else list(MISBEHAVIOUR_DETECTORS)
    return _ScoredMessages(
        [one.number for _, one in kept],
        np.array([place * 2**32 + (one.station_id or 0) for place, one in kept], np.int64),
        np.array([one.station_id in attackers for _, one in kept], bool),
        np.array([one.arrival_ns / 1e9 for _, one in kept], np.float64),
        {n: _joined([v.detectors[n].flagged[v.is_scored] for v in verdicts], bool) for n in names},
        {n: _joined([v.detectors[n].scores[v.is_scored] for v in verdicts], np.float64) for n in names},
    )


def published_f1(provenance: Provenance) -> dict[str, float]:
    """CaTCH's published F1 for the attacks of an adversarial bag and for the parts of a mix, if there is one.

    It was measured on VeReMi NextGen, urban traffic of low density: other data, for orientation only.
    """
    declared = {one.type: one.declared for one in provenance.fields.attacks if one.declared is not None}
    published = {part.name: part.published for each in declared.values() for part in each.parts}
    published |= {name: each.published for name, each in declared.items()}
    return {name: each.catch_f1 for name, each in published.items() if each.catch_f1 is not None}


def _parts(
    received: _ScoredMessages,
    labels: Sequence[MessageLabel],
    is_false_message: Bools,
    published: Mapping[str, float],
) -> list[ScoredAttack]:
    by_attack: dict[str, list[MessageLabel]] = {}
    for label in labels:
        for attack in {label.attack, label.attack_and_part}:
            by_attack.setdefault(attack, []).append(label)
    parts = []
    for name, own in sorted(by_attack.items()):
        is_false = are_false(received.numbers, own)
        attack = own[0].part if own[0].attack_and_part == name and own[0].part else own[0].attack
        found = received.results(is_false, is_false | ~is_false_message)
        parts.append(
            ScoredAttack(
                attack=name,
                false_messages=int(is_false.sum()),
                detectors=found,
                published=published.get(attack, math.nan),
            )
        )
    return parts


def _joined(parts: Sequence[Any], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    return np.concatenate([np.asarray(part, kind) for part in parts]) if parts else np.zeros(0, kind)
