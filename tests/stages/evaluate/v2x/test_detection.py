"""Detection on real drives: honest messages pass, lies are found out, and the labels say which is which."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.evaluate.v2x.detection import PUBLISHED_CATCH_F1, detect
from advpipe.stages.evaluate.v2x.labels import LABELS, MessageLabel, lies, read_labels
from advpipe.stages.evaluate.v2x.receptions import read_receptions


def test_fewer_than_one_honest_message_in_a_hundred_is_flagged(boulevard: Path) -> None:
    receptions = read_receptions(BagReader(boulevard))
    found = detect(receptions)
    assert found.messages > 1000
    assert found.lies == 0
    assert found.ours.false_positive_rate < 0.01


def test_receptions_are_those_in_the_bag(smoke: Path) -> None:
    """Claims say where the true senders are, up to what they know of themselves."""
    (ego,) = read_receptions(BagReader(smoke))
    assert ego.listener == "ego"
    off_m = [
        np.hypot(claim.x_m - radio.map_SE3_base[0, 3], claim.y_m - radio.map_SE3_base[1, 3])
        for claim, radio in zip(ego.claims, ego.radios, strict=True)
        if radio is not None
    ]
    assert len(off_m) == len(ego.claims) > 50
    assert np.median(off_m) < 2.0  # 0.5 m on each axis, and up to 0.2 s of driving
    own_m = [(r.x_m, r.y_m) for r in ego.receivers]
    assert len(set(own_m)) > 10


def test_all_stations_can_listen(smoke: Path) -> None:
    reader = BagReader(smoke)
    (ego,) = read_receptions(reader)
    everybody = read_receptions(reader, {one.sent.station_id for one in ego.received} | {ego.station_id})
    assert len(everybody) > 3
    again = next(one for one in everybody if one.station_id == ego.station_id)
    assert again.numbers == ego.numbers


def test_offsets_are_found_out(smoke: Path, offset: Path) -> None:
    labels = read_labels(offset)
    found = detect(read_receptions(BagReader(offset)), labels)
    assert found.attack == "cam-position-offset"
    assert 0 < found.lies < found.messages
    assert found.ours.recall > 0.7
    assert found.ours.precision > 0.7
    assert found.by_attack["cam-position-offset"] == pytest.approx(found.ours.recall)
    assert found.ours.latency_s < 1.0
    assert sum(found.objections.values()) >= found.ours.true_positives
    assert read_labels(smoke) == []


def test_a_lie_is_one_that_mattered_and_was_sent() -> None:
    labels = [
        MessageLabel(1, "cam-speed-constant", "car", "changed", True, 0, 7),
        MessageLabel(2, "cam-speed-constant", "car", "changed", False, 0, 7),
        MessageLabel(3, "cam-drop", "car", "dropped", True, 0, 7),
    ]
    assert lies([0, 1, 2, 3], labels).tolist() == [False, True, False, False]


def test_labels_that_are_none(tmp_path: Path) -> None:
    (tmp_path / LABELS).write_bytes(b"no parquet")
    with pytest.raises(AdvpipeError, match="holds no labels of messages"):
        read_labels(tmp_path)


def test_published_figures_are_of_attacks_that_exist() -> None:
    from advpipe.stages.attack.registry import ATTACKS

    assert set(PUBLISHED_CATCH_F1) <= set(ATTACKS)
