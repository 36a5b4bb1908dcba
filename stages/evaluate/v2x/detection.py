"""Scores of the misbehaviour detector and of the baseline on false and honest messages, by attack."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.labels.messages import MessageLabel, are_false
from advpipe.pipeline.misbehaviour.catch import (
    TUNED_CATCH,
    CatchParameters,
    catch_flags,
    catch_messages,
)
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.misbehaviour.scores import Bools, Scores, scores
from advpipe.stages.evaluate.v2x.receptions import ListenerReceptions


@dataclass(frozen=True)
class ScoredAttack:
    """One attack of a bag, scored on its false messages and all honest ones, without those of other attacks.

    attack: with the part of a mix, if labelled. published: F1 of CaTCH on other data, or NaN.
    """

    attack: str
    false_messages: int
    ours: Scores
    baseline: Scores
    published: float


@dataclass(frozen=True)
class Detection:
    """The results of two detectors on the messages that all listeners of a bag received.

    attack: empty for a clean bag. messages, false_messages: received, where the bag records their senders.
    undecoded: messages that are not CAMs and were not sent by an attack; decoders drop them, and they do not
    count. parts: by attack. flagged_by_check: flagged false messages, most first.
    """

    attack: str
    messages: int
    false_messages: int
    undecoded: int
    ours: Scores
    baseline: Scores
    parts: tuple[ScoredAttack, ...]
    flagged_by_check: dict[str, int]


@dataclass(frozen=True)
class _ReceivedMessages:
    """M received messages, (M,) each: numbers, flags of both detectors, senders, whether these attack, and
    arrival times."""

    numbers: list[int | None]
    ours: Bools
    baseline: Bools
    senders: np.ndarray[Any, np.dtype[np.int64]]
    is_attackers: Bools
    times_s: np.ndarray[Any, np.dtype[np.float64]]

    def scores(self, is_false_message: Bools, chosen: Bools) -> tuple[Scores, Scores]:
        """Scores of our detector and of the baseline on the chosen messages."""
        is_false, senders, times_s = is_false_message[chosen], self.senders[chosen], self.times_s[chosen]
        about = is_false, senders, times_s, self.is_attackers[chosen]
        return scores(self.ours[chosen], *about), scores(self.baseline[chosen], *about)


def detect(
    receptions: Sequence[ListenerReceptions],
    labels: Sequence[MessageLabel] = (),
    config: DetectorConfig | None = None,
    parameters: CatchParameters | None = None,
    published: Mapping[str, float] | None = None,
    window: Window = WHOLE_DRIVE,
) -> Detection:
    """Run both detectors, by default as tuned, on what each vehicle received, and score them by the labels.

    published: F1 for each attack in the bag, as `published_f1` reads it. window: messages that arrive in it
    count; detectors remember earlier ones. Without labels there are no false messages; with labels, a message
    counts if the bag records which sent message it was.
    """
    config, parameters = config or DetectorConfig(), parameters or TUNED_CATCH
    ours, baseline, senders, times_s, numbers, decoded = [], [], [], [], [], []
    flagged_by_check: Counter[str] = Counter()
    attackers = {label.station_id for label in labels if label.attacker}
    is_attackers: list[bool] = []
    for place, each in enumerate(receptions):
        judged = judge_all(each.claims, each.receivers, config)
        inside = window.holds([one.arrival_ns for one in each.received])
        if labels:
            inside &= np.array([number is not None for number in each.numbers], bool)
        received = [one for one, is_inside in zip(each.received, inside, strict=True) if is_inside]
        ours.append(judged.flagged[inside])
        baseline.append(catch_flags(catch_messages(each.claims, each.receivers), parameters)[inside])
        senders.append([place * 2**32 + (one.station_id or 0) for one in received])
        is_attackers += [one.station_id in attackers for one in received]
        times_s.append([one.arrival_ns / 1e9 for one in received])
        decoded.append(np.array([claim.is_cam for claim in each.claims], bool)[inside])
        numbers += [one.number for one in received]
        counts = judged.triggered(config)[inside & are_false(each.numbers, labels)].sum(axis=0).tolist()
        flagged_by_check.update(dict(zip(CHECKS, counts, strict=True)))
    messages = _ReceivedMessages(
        numbers,
        _joined(ours, bool),
        _joined(baseline, bool),
        _joined(senders, np.int64),
        np.array(is_attackers, bool),
        _joined(times_s, np.float64),
    )
    is_false_message = are_false(numbers, labels)
    is_scored = _joined(decoded, bool) | is_false_message
    return Detection(
        " + ".join(sorted({label.attack for label in labels})),
        len(is_false_message),
        int(is_false_message.sum()),
        int((~is_scored).sum()),
        *messages.scores(is_false_message, is_scored),
        tuple(_parts(messages, labels, is_false_message, is_scored, published or {})),
        {name: count for name, count in flagged_by_check.most_common() if count},
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
    received: _ReceivedMessages,
    labels: Sequence[MessageLabel],
    is_false_message: Bools,
    is_scored: Bools,
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
        found = received.scores(is_false, is_scored & (is_false | ~is_false_message))
        f1 = published.get(attack, math.nan)
        parts.append(ScoredAttack(name, int(is_false.sum()), *found, f1))
    return parts


def _joined(parts: Sequence[Any], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    return np.concatenate([np.asarray(part, kind) for part in parts]) if parts else np.zeros(0, kind)
