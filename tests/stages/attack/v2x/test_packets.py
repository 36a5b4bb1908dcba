"""Insiders and outsiders: what receivers that verify signatures make of their messages."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

pytest.importorskip("cryptography")

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.security.verifier import Rejection
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.attack.v2x.packets import AttackedPackets

SIGNED = ("v2x.security=etsi", "v2x.penetration=1", "v2x.security_rules={certificate_interval_s: 0}")


def outcome(reader: BagReader, name: str, credentials: str, **keys) -> Counter[str]:
    """Receptions of attacked messages, by verdict."""
    change = forge(reader, [attack_spec({"type": name, "credentials": credentials, **keys})], 1)
    list(change.messages())
    return Counter(
        {what: count for what, count in change.counts().items() if what.startswith("attacked CAMs")}
    )


ACCEPTED, REJECTED = "attacked CAMs that receivers verified", "attacked CAMs that receivers rejected: "


@pytest.mark.parametrize(
    ("credentials", "verdict"),
    [
        ("ticket", ACCEPTED),
        ("none", f"{REJECTED}unsigned"),
        ("untrusted", f"{REJECTED}untrusted ticket"),
        ("expired", f"{REJECTED}ticket not valid then"),
        ("stolen", f"{REJECTED}wrong signature"),
    ],
)
def test_only_insiders_get_through(recorded, credentials, verdict):
    found = outcome(recorded(*SIGNED), "cam-position-offset", credentials)
    assert set(found) == {verdict}
    assert found[verdict] > 5


def test_a_replay_word_for_word_needs_no_ticket_but_is_noticed(recorded):
    parameters = {"identity": "theirs", "restamp": False, "age_s": 0.5}
    found = outcome(recorded(*SIGNED), "cam-replay", "none", parameters=parameters)
    assert set(found) <= {f"{REJECTED}replayed", f"{REJECTED}unsigned", ACCEPTED}
    assert found[f"{REJECTED}replayed"] > 5
    assert found[f"{REJECTED}unsigned"] == 0


def test_the_recorded_drive_is_received_as_it_was(recorded):
    reader = recorded(*SIGNED)
    drive = V2xDrive(reader)
    channel = drive.channel()
    received = [one for step in drive.steps() for one in drive.send(channel, step, step.sent).received]
    topics = [topic for topic in reader.topics if topic.endswith("v2x/rx/raw")]
    assert len(received) == sum(reader.topics[topic].count for topic in topics) > 0
    assert "/v2x/packets" in reader.topics


def test_outsiders_need_a_signed_drive(recorded):
    with pytest.raises(UsageError, match="recorded without security"):
        outcome(recorded(), "cam-position-offset", "none")


def test_one_attacker_has_one_kind_of_credentials(recorded):
    reader = recorded(*SIGNED)
    specs = [
        attack_spec({"type": name, "credentials": credentials})
        for name, credentials in (("cam-drop", "ticket"), ("cam-speed-constant", "none"))
    ]
    with pytest.raises(UsageError, match="give it the same for all attacks"):
        forge(reader, specs, 1)


def test_truncated_envelopes_are_kept_as_bytes_and_counted(recorded):
    drive = V2xDrive(recorded(*SIGNED))
    channel, packets, rejected = drive.channel(), AttackedPackets(drive, {}), Counter()
    for step in drive.steps():
        cut = [replace(one, packet=one.packet[:100]) for one in step.sent]
        sent = packets.packed(cut, cut)
        assert sent == cut
        result = drive.send(channel, step, sent)
        rejected.update(one.rejection for one in result.rejected)
        assert not result.received
    assert set(rejected) == {Rejection.MALFORMED}
    assert rejected.total() > 20
