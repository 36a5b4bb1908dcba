"""VeReMi NextGen (2026): `attackGenerator.py`, which changes logs of received messages.

It draws for each received copy of a message where its code is not careful; here, each message is drawn for
once.
"""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.attack.base import PublishedPreset
from advpipe.stages.attack.v2x.published import nextgen_labels as labels
from advpipe.stages.attack.v2x.published.nextgen_claims import (
    NextgenFeignedBraking,
    NextgenMirrored,
    NextgenStop,
)
from advpipe.stages.attack.v2x.published.nextgen_streams import NextgenCongestion, NextgenDos, NextgenReplay

_BELOW_ZERO = "A CAM states no negative speed: what is below zero there is zero here and in ours."

PRESETS: Mapping[str, PublishedPreset] = {
    "cam-position-offset": PublishedPreset(),
    "cam-position-random-offset": PublishedPreset(),
    "cam-position-mirrored": PublishedPreset(
        attack_class=NextgenMirrored,
        remark="Moves by the distance to the middle of the road and half the width of the own side; ours "
        "by one lane, so that it needs no map.",
    ),
    "cam-speed-offset": PublishedPreset(remark=_BELOW_ZERO),
    "cam-speed-random-offset": PublishedPreset(remark=_BELOW_ZERO),
    "cam-speed-constant": PublishedPreset(
        parameters={"speed_mps": 0.0},
        matters=labels.of_moving_station,
        remark="Its zero speed report; ours draws a speed, as F2MD does.",
    ),
    "cam-speed-frozen": PublishedPreset(
        matters=labels.of_slower_claim,
        remark="Labels a message only where the vehicle is faster than it claims; by our rule also where "
        "it is slower.",
    ),
    "cam-heading-reversed": PublishedPreset(
        matters=labels.of_moving_station,
        remark="A standing vehicle's reversed heading is not false there; by our rule it is, as its box "
        "turns.",
    ),
    "cam-feigned-braking": PublishedPreset(
        attack_class=NextgenFeignedBraking,
        matters=labels.of_accelerating_station,
        remark="Changes only positive accelerations; ours claims to brake all the time, with the pedal "
        "pressed and 3 m/s² at least, as a vehicle at constant speed would not feign anything.",
    ),
    "cam-acceleration": PublishedPreset(
        matters=labels.of_changing_speed,
        remark="Labels by the true acceleration; our rule by the difference that the factor makes.",
    ),
    "cam-delay": PublishedPreset(
        parameters={"restamp": True},
        remark="Moves the sending time as well, so that nothing but the position tells the age; ours "
        "leaves the generation time, which receivers' maps then refuse.",
    ),
    "cam-dos": PublishedPreset(
        attack_class=NextgenDos,
        remark="Identical copies, two to four with the original, which counts as false, too; ours is a "
        "flood at a fixed rate whose messages move on, beside the genuine ones.",
    ),
    "cam-sybil-congestion": PublishedPreset(
        attack_class=NextgenCongestion,
        remark="Ghost vehicles around the attacker with new ids for each message, sent 2 to 200 s late; "
        "ours are a jam ahead of the target, whose vehicles last and brake.",
    ),
    "cam-sudden-stop": PublishedPreset(
        attack_class=NextgenStop,
        matters=labels.of_feigned_stop,
        remark="Claims no deceleration; ours brakes hard in its first message, as a vehicle that stops "
        "would.",
    ),
    "cam-replay": PublishedPreset(
        attack_class=NextgenReplay,
        remark="Begins with the oldest message of the last five seconds; ours with that of two seconds ago.",
    ),
}
