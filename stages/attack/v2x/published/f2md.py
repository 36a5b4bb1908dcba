"""F2MD, the 19 attacks of the VeReMi Extension (IEEE ICC 2020): `MDAttack.cc` with `F2MDParameters.h`.

It calls all messages of an attacker false, except those that it sends as they are.
"""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.attack.base import PublishedPreset
from advpipe.stages.attack.v2x.published.f2md_claims import (
    F2mdConstantPosition,
    F2mdConstantSpeed,
    F2mdPositionOffset,
    F2mdRandomSpeed,
    F2mdRandomSpeedOffset,
    F2mdSpeedOffset,
    F2mdStale,
    F2mdStop,
)
from advpipe.stages.attack.v2x.published.f2md_flood import (
    F2mdDos,
    F2mdDosDisruptive,
    F2mdDosDisruptiveSybil,
    F2mdDosRandom,
    F2mdDosRandomSybil,
)
from advpipe.stages.attack.v2x.published.f2md_grid import F2mdGridSybil
from advpipe.stages.attack.v2x.published.f2md_replay import F2mdDisruptive, F2mdReplay, F2mdReplaySybil
from advpipe.stages.attack.v2x.published.veremi import VeremiRandomPosition

_VECTOR = "It writes velocities as vectors, of which a CAM states the magnitude; "
_RATE = (
    "Its rate is two or four times the attacker's own, of beacons once a second, and all of the attacker's "
    "messages are false; ours is four times the highest rate of the standard, beside the genuine messages."
)
_TWICE = (
    "Its rate is twice the attacker's own, and all of the attacker's messages are false; ours is four times "
    "the highest rate of the standard, beside the genuine messages."
)

PRESETS: Mapping[str, PublishedPreset] = {
    "cam-position-constant": PublishedPreset(
        attack_class=F2mdConstantPosition,
        remark="Draws in the whole playground, here the bounding box of the road network; ours where "
        "vehicles are when the drive begins.",
    ),
    "cam-position-offset": PublishedPreset(
        attack_class=F2mdPositionOffset,
        remark="Never to the west or north; ours draws the signs, so that no direction gives attackers away.",
    ),
    "cam-position-random": PublishedPreset(
        attack_class=VeremiRandomPosition,
        remark="Draws in the whole playground, here the bounding box of the road network; ours where "
        "vehicles are when the drive begins.",
    ),
    "cam-position-random-offset": PublishedPreset(
        parameters={"min_m": 0.0, "max_m": 35.0},
        remark="Many of its offsets are within the error of an honest fix, and are false all the same; "
        "ours has the larger ones of NextGen.",
    ),
    "cam-speed-constant": PublishedPreset(
        attack_class=F2mdConstantSpeed, remark=f"{_VECTOR}ours draws a speed of up to 40 m/s."
    ),
    "cam-speed-offset": PublishedPreset(
        attack_class=F2mdSpeedOffset,
        remark=f"{_VECTOR}ours adds to the speed, with either sign, as NextGen does.",
    ),
    "cam-speed-random": PublishedPreset(
        attack_class=F2mdRandomSpeed, remark=f"{_VECTOR}ours draws a speed of up to 40 m/s."
    ),
    "cam-speed-random-offset": PublishedPreset(
        attack_class=F2mdRandomSpeedOffset, remark=f"{_VECTOR}ours adds to the speed, as NextGen does."
    ),
    "cam-eventual-stop": PublishedPreset(
        attack_class=F2mdStop,
        remark="The probability is the attacker's own and does not grow; ours grows, so that all stop in "
        "a short drive.",
    ),
    "cam-disruptive-replay": PublishedPreset(
        attack_class=F2mdDisruptive,
        remark="Any of the last 20 messages of any station, whenever it was heard; ours of the last 10 s.",
    ),
    "cam-replay": PublishedPreset(
        attack_class=F2mdReplay,
        remark="Repeats what a victim has just sent; ours what it sent two seconds ago, so that a "
        "receiver who heard both has to notice the age.",
    ),
    "cam-stale": PublishedPreset(
        attack_class=F2mdStale,
        remark="A buffer of 60 messages, a minute at one a second, which is empty at first: until then "
        "it claims the playground's origin; ours has 20, two seconds or more, and sends the truth "
        "until then.",
    ),
    "cam-dos": PublishedPreset(attack_class=F2mdDos, remark=_RATE),
    "cam-dos-random": PublishedPreset(
        attack_class=F2mdDosRandom, remark=f"{_RATE} Its places are in the whole playground."
    ),
    "cam-dos-disruptive": PublishedPreset(attack_class=F2mdDosDisruptive, remark=_RATE),
    "cam-sybil-grid": PublishedPreset(
        attack_class=F2mdGridSybil,
        remark="One or five ghost vehicles behind the nearest station and to its left, with gaps of 5 "
        "and 2 m between boxes, a message each between two own ones, and the acceleration in the "
        "place of the speed; ours stand on a grid around the attacker, move consistently and send "
        "by the rules of CAMs.",
    ),
    "cam-sybil-replay": PublishedPreset(
        attack_class=F2mdReplaySybil,
        remark="Sends one victim's messages instead of its own, under a pseudonym for each victim; ours "
        "sends several whole tracks besides its own CAMs.",
    ),
    "cam-dos-random-sybil": PublishedPreset(
        attack_class=F2mdDosRandomSybil, remark=f"{_TWICE} Its places are in the whole playground."
    ),
    "cam-dos-disruptive-sybil": PublishedPreset(attack_class=F2mdDosDisruptiveSybil, remark=_TWICE),
}
