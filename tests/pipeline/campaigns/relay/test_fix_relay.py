"""Fixes between the receiver and its consumers."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from relay_messages import BEGIN_NS, LATITUDE_DEG, LONGITUDE_DEG, fix_cdr
from relay_parts import recording, settings_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.relay.fix_relay import FixRelay
from advpipe.pipeline.campaigns.relay.outgoing import ATTACKED, UNCHANGED, OutgoingMessage
from advpipe.pipeline.campaigns.relay.place import MapPlace
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.types import typestore
from advpipe.stages.attack.gnss.base import gnss_traits
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS

PERIOD_NS = 100_000_000


def run(tmp_path: Path, attack: dict[str, Any], fixes: list[bytes]) -> list[OutgoingMessage]:
    """A drive to the north, one fix after the other."""
    settings = settings_of(attack, seed=5)
    sent: list[OutgoingMessage] = []
    with recording(tmp_path / "bag") as recorder:
        relay = FixRelay(settings, settings.attacks, MapPlace(None), recorder)
        relay.begin(BEGIN_NS)
        for number, cdr in enumerate(fixes):
            relay.take(cdr, BEGIN_NS + number * PERIOD_NS, 0.0)
            sent += relay.due(BEGIN_NS, 0.0)
        relay.write_labels()
    return sent


def offsets_m(sent: list[OutgoingMessage], fixes: list[bytes]) -> np.ndarray:
    """False minus true position (N, 3), east, north and up."""
    geodesy = Geodesy(LATITUDE_DEG, LONGITUDE_DEG, 520.0)
    found = []
    for cdrs in zip([one.cdr for one in sent], fixes, strict=True):
        false, true = (typestore().deserialize_cdr(cdr, "sensor_msgs/msg/NavSatFix") for cdr in cdrs)
        places = [geodesy.to_map([one.latitude, one.longitude, one.altitude]) for one in (false, true)]
        found.append(places[0] - places[1])
    return np.array(found)


def test_a_drift_out_of_the_lane(tmp_path: Path) -> None:
    """The vehicle drives north, so that its left is west."""
    fixes = [fix_cdr(float(number)) for number in range(20)]
    attack = {"type": "gnss-drift", "parameters": {"rate_mps": 2.0}, "schedule": {"from_s": 0.5}}
    sent = run(tmp_path, attack, fixes)
    expected_m = [[-2.0 * max(number * 0.1 - 0.5, 0.0), 0, 0] for number in range(20)]
    assert np.allclose(offsets_m(sent, fixes), expected_m, atol=1e-3)
    assert [one.fate for one in sent] == [UNCHANGED] * 6 + [ATTACKED] * 14
    assert [one.cdr for one in sent[:5]] == fixes[:5]
    labels = pq.read_table(tmp_path / "bag" / "gnss_labels.parquet").to_pylist()
    assert [row["offset_east_m"] for row in labels] == pytest.approx([x for x, _, _ in expected_m], abs=1e-3)
    assert {row["vehicle"] for row in labels} == {"ego"}
    shown = BagReader(tmp_path / "bag", debug=True).topics["/advpipe/debug/ego/gnss/fix"]
    assert shown.count == 15


@pytest.mark.parametrize(
    "name", [name for name in GNSS_ATTACKS if not gnss_traits(GNSS_ATTACKS[name]).needs_filter]
)
def test_every_attack(tmp_path: Path, name: str) -> None:
    fixes = [fix_cdr(5.0 * number) for number in range(40)]
    sent = run(tmp_path, {"type": name}, fixes)
    assert len(sent) == 40
    assert [one.fate for one in sent].count(ATTACKED) > (0 if name == "gnss-jump" else 20)


def test_a_frozen_fix(tmp_path: Path) -> None:
    fixes = [fix_cdr(float(number)) for number in range(5)]
    assert offsets_m(run(tmp_path, {"type": "gnss-freeze"}, fixes), fixes)[:, 1] == pytest.approx(
        [0, -1, -2, -3, -4], abs=0.02
    )


def test_what_is_no_fix_passes(tmp_path: Path) -> None:
    fixes = [fix_cdr(0.0, is_fix=False), b"\0\1\0\0", fix_cdr(1.0), fix_cdr(2.0, is_fix=False)]
    sent = run(tmp_path, {"type": "gnss-bias"}, fixes)
    assert [one.fate for one in sent] == [UNCHANGED, UNCHANGED, ATTACKED, UNCHANGED]
    assert [sent[place].cdr for place in (0, 1, 3)] == [fixes[place] for place in (0, 1, 3)]
    assert math.isfinite(offsets_m(sent[2:3], fixes[2:3]).sum())


def test_an_attack_that_needs_a_filter(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="gnss-drift-aware needs the victim's filter"):
        run(tmp_path, {"type": "gnss-drift-aware"}, [])
