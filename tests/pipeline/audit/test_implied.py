"""What attacks declare excuses the probes that it moves, and no others."""

from __future__ import annotations

import pytest

from advpipe.pipeline.audit.implied import implied
from advpipe.pipeline.audit.registry import PROBES
from advpipe.pipeline.bag.provenance_record import RecordedAttack
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.declared import declaration_of

PROBE = {probe.key: probe for probe in PROBES}


def reason(options: dict[str, object], probe: str, *, has_debug: bool = False) -> str:
    spec = attack_spec(options)
    attack = RecordedAttack(type=spec.type, declared=declaration_of(spec))
    return implied(PROBE[probe], [attack], has_debug=has_debug)


ATTACH = {"type": "attach", "parameters": {"eps_m": 0.5, "points": 7}}
DETACH = {"type": "detach", "parameters": {"ratio": 0.01}}
PERTURB = {"type": "perturb", "parameters": {"eps_cm": 5.0}}
DELAY = {"type": "cam-delay", "attackers": {"share": 0.3}}
OFFSET = {"type": "cam-position-offset", "attackers": {"share": 0.3}}
STALE = {"type": "cam-stale", "attackers": {"share": 0.3}}
CPM_GHOST = {"type": "cpm-ghost", "attackers": {"share": 0.3}}
JAM, SPOOF = ({"type": f"radar-{name}", "victim": "ego"} for name in ("jam", "spoof"))
SYBIL = {"type": "cam-sybil-congestion", "attackers": {"share": 0.3}}


@pytest.mark.parametrize(
    ("attack", "probe", "expected"),
    [
        (ATTACH, "cloud/points", "attach declares points added (points_added) of up to 7"),
        (ATTACH, "point/place", ""),
        (ATTACH, "point/steps-back", ""),
        (ATTACH, "point/equal-intensity", ""),
        (DETACH, "cloud/points", "detach does not bound the points removed (points_removed)"),
        (DETACH, "cloud/steps-back", ""),
        (PERTURB, "point/off-grid", ""),
        (PERTURB, "point/off-ray", "perturb does not bound the largest angle between the rays"),
        (PERTURB, "cloud/points", ""),
        (DELAY, "message/lag", "cam-delay declares delay of a message (delay_s) of up to 4"),
        (DELAY, "message/bytes", ""),
        (OFFSET, "message/interval", ""),
        (OFFSET, "message/id-age", ""),
        (SYBIL, "message/id-age", "cam-sybil-congestion sends messages that no station would"),
        (SYBIL, "message/lag", ""),
        (SYBIL, "message/bytes", ""),
        (SYBIL, "station/bytes", "cam-sybil-congestion sends messages that no station would"),
        (STALE, "message/id-age", "cam-stale repeats old messages, before which there are true ones"),
        (STALE, "message/interval", ""),
        (CPM_GHOST, "cpm/bytes", "cpm-ghost makes the perceived objects of its messages untrue"),
        (CPM_GHOST, "cpm/interval", ""),
        (JAM, "scan/returns", "radar-jam does not bound the returns added"),
        (SPOOF, "scan/returns", "radar-spoof declares returns added to a scan (returns_added) of up to 3"),
        (SPOOF, "return/place", ""),
        ({"type": "gnss-bias", "victim": "ego"}, "fix/digits", ""),
    ],
)
def test_the_reason(attack: dict[str, object], probe: str, expected: str) -> None:
    found = reason(attack, probe)
    assert found.startswith(expected)
    assert bool(found) == bool(expected)


def test_debug_topics_change_chunks() -> None:
    assert "debug topics" in reason(OFFSET, "chunk/bytes", has_debug=True)
    assert not reason(OFFSET, "chunk/bytes")
    assert not reason(OFFSET, "message/order", has_debug=True)


def test_false_positions_change_the_path_and_so_the_length_of_a_cam() -> None:
    for probe in ("message/bytes", "station/bytes", "station/bytes-spread", "message/interval-phase"):
        assert "makes the position of its messages untrue" in reason(OFFSET, probe)
        assert not reason({"type": "cam-speed-offset", "attackers": {"share": 0.3}}, probe)


def test_attacks_of_another_family_and_without_declaration_excuse_nothing() -> None:
    silent = RecordedAttack(type="attach")
    fix = RecordedAttack(type="x", declared=Declaration(family="gnss", bounds={"points_added": (0, 9)}))
    for attack in (silent, fix):
        assert implied(PROBE["cloud/points"], [attack], has_debug=False) == ""
