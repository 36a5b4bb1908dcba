"""Clouds between their publisher and their consumers: their order, and attacks that take too long."""

import re
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from relay_messages import BEGIN_NS, cloud, cloud_cdr
from relay_parts import recording, settings_of

from advpipe.pipeline.adversary.constraints import Constraints
from advpipe.pipeline.adversary.goal import known_boxes
from advpipe.pipeline.adversary.targets import detection_loss, find_targets
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.relay.cloud_relay import CloudRelay
from advpipe.pipeline.campaigns.relay.outgoing import ATTACKED, LATE, UNCHANGED, OutgoingMessage
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.attacked import load_attacked
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import cloud_from_cdr
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarResult, LidarTraits, unchanged

DETACH = {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.1}}
SLOW = {"type": f"{__name__}:Slow", "detector": f"{__name__}:NothingDetector"}
gate = threading.Event()


class Slow(LidarAttack):
    """Waits until the test lets it go on."""

    traits = LidarTraits(budget=Budget(title="Nothing", parameter="none", unit=""))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {}

    def __call__(self, cloud: Any, boxes: Any, detector: Any, rng: Any) -> LidarResult:
        assert gate.wait(20)
        return unchanged(cloud, "")


class Leisurely(Slow):
    """Takes longer than the time between two clouds."""

    traits = Slow.traits

    def __call__(self, cloud: Any, boxes: Any, detector: Any, rng: Any) -> LidarResult:
        time.sleep(0.45 if len(cloud) == 10 else 0)
        return unchanged(cloud, "")


class NothingDetector:
    classes = ("car",)
    range_m = None

    def detect(self, cloud: Any) -> Any: ...
    def loss(self, points: Any, boxes: Any, labels: Any) -> Any: ...


def passing(relay: CloudRelay, before: int = 0, timeout_s: float = 20) -> list[OutgoingMessage]:
    """What is sent until nothing waits. before: messages that were sent earlier."""
    sent: list[OutgoingMessage] = []
    end_s = time.monotonic() + timeout_s
    while before + len(sent) + relay.counts.withheld < relay.counts.received:
        assert time.monotonic() < end_s
        sent += relay.due(BEGIN_NS, time.monotonic())
        time.sleep(0.002)
    return sent


def test_each_cloud_is_attacked_and_labelled(tmp_path: Path) -> None:
    settings = settings_of(DETACH, seed=3, max_latency_s=30)
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        relay.begin(BEGIN_NS)
        sent = []
        for number in range(3):
            relay.take(cloud_cdr(number), BEGIN_NS + number, time.monotonic())
            sent += passing(relay, number)
        relay.end()
    assert [one.fate for one in sent] == [ATTACKED] * 3
    clouds = [cloud_from_cdr(one.cdr) for one in sent]
    assert [one.stamp_ns for one in clouds] == [BEGIN_NS + number for number in range(3)]
    labels = pq.read_table(tmp_path / "bag" / "labels.parquet").to_pylist()
    for number, stamped in enumerate(clouds):
        removed = [row["point"] for row in labels if row["frame"] == number]
        assert len(removed) == 200
        assert np.array_equal(stamped.cloud, np.delete(cloud(seed=number), removed))
    frames = pq.read_table(tmp_path / "bag" / "frames.parquet").to_pylist()
    assert [row["attack"] for row in frames] == ["detach"] * 3
    debug = BagReader(tmp_path / "bag", debug=True).topics["/advpipe/debug/ego/lidar/points"]
    assert debug.count == 3


def test_a_schedule(tmp_path: Path) -> None:
    """The middle one of three seconds."""
    settings = settings_of({**DETACH, "schedule": {"from_s": 1, "to_s": 2}}, max_latency_s=30)
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        relay.begin(BEGIN_NS)
        for number in range(3):
            relay.take(cloud_cdr(number), BEGIN_NS + number * 10**9, time.monotonic())
        sent = passing(relay)
        relay.end()
    assert [one.fate for one in sent] == [UNCHANGED, ATTACKED, UNCHANGED]
    assert [sent[0].cdr, sent[2].cdr] == [cloud_cdr(0), cloud_cdr(2)]


@pytest.mark.parametrize(("when_late", "fates"), [("pass", [LATE] * 40), ("drop", [])])
def test_an_attack_that_does_not_keep_up(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], when_late: str, fates: list[str]
) -> None:
    """Clouds pass in their order, after the longest time that is allowed; and it says so."""
    gate.clear()
    settings = settings_of(SLOW, max_latency_s=0.1, when_late=when_late)
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        relay.begin(BEGIN_NS)
        for number in range(40):
            relay.take(cloud_cdr(number, 10), BEGIN_NS, time.monotonic())
        begin_s = time.monotonic()
        sent = passing(relay)
        assert time.monotonic() - begin_s < 5
        gate.set()
        relay.end()
    assert [one.fate for one in sent] == fates
    assert [one.cdr for one in sent] == [cloud_cdr(number, 10) for number in range(len(fates))]
    assert relay.counts.withheld == 40 - len(fates)
    said = capsys.readouterr().err
    assert said.count("this machine does not keep up; some clouds are") == 2
    assert ("dropped" if when_late == "drop" else "passed on unchanged") in said
    notes = {row["note"] for row in pq.read_table(tmp_path / "bag" / "frames.parquet").to_pylist()}
    assert notes == {"the attack takes longer than max_latency_s", "others were being attacked"}


def test_bytes_that_are_no_cloud_pass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = settings_of(DETACH, max_latency_s=30)
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        for _ in range(2):
            relay.take(b"\0\1\0\0nonsense", BEGIN_NS, time.monotonic())
        sent = passing(relay)
        relay.end()
    assert [one.cdr for one in sent] == [b"\0\1\0\0nonsense"] * 2
    assert capsys.readouterr().err.count("malformed PointCloud2 message") == 1


@pytest.mark.parametrize(
    ("attack", "line"),
    [
        (
            {"type": "detach", "recipe": "paper"},
            "detach needs true boxes, which a relay does not have; set truth",
        ),
        ({"type": "detach", "recipe": "random", "parameters": {"ratio": 2}}, "detach: ratio is 2"),
    ],
)
def test_refusals(tmp_path: Path, attack: dict[str, Any], line: str) -> None:
    settings = settings_of({"parameters": {"ratio": 0.01}, **attack})
    with recording(tmp_path / "bag", has_clouds=True) as recorder, pytest.raises(UsageError) as found:
        CloudRelay(settings, settings.attacks, recorder)
    assert str(found.value).startswith(line)


@pytest.mark.nightly
def test_one_pass_of_a_detectors_gradient(tmp_path: Path) -> None:
    """The paper's greedy removal in one round, against what the detector finds itself."""
    parameters = {"ratio": 0.01, "rounds": 1, "truth": "detections"}
    settings = settings_of({"type": "detach", "recipe": "paper", "parameters": parameters}, max_latency_s=60)
    from advpipe.pipeline.dataset.sample import shipped_sample

    (raw, *_) = BagReader(shipped_sample() / "clean").raw_messages(["/ego/lidar/points"])
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        relay.take(raw.cdr, BEGIN_NS, time.monotonic())
        (sent,) = passing(relay, timeout_s=100)
        relay.end()
    (frame,) = pq.read_table(tmp_path / "bag" / "frames.parquet").to_pylist()
    assert sent.fate == ATTACKED
    assert frame["points_adversarial"] == frame["points_clean"] - round(0.01 * frame["points_clean"])
    assert np.isnan([frame["loss_before"], frame["loss_after"]]).all()
    clean, attacked = (cloud_from_cdr(cdr).cloud for cdr in (raw.cdr, sent.cdr))
    detector = load_attacked("small")
    targets = find_targets(
        detector, clean, known_boxes(Constraints(truth="detections"), detector, clean, Boxes())
    )
    losses = [detection_loss(detector, cloud, targets) for cloud in (clean, attacked)]
    assert losses[1] > losses[0]


def test_a_rate_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One cloud is attacked, those that come meanwhile keep their pace behind it, and so on."""
    settings = settings_of({**SLOW, "type": f"{__name__}:Leisurely"}, max_latency_s=5)
    period_s, sent = 0.1, []
    with recording(tmp_path / "bag", has_clouds=True) as recorder:
        relay = CloudRelay(settings, settings.attacks, recorder)
        relay.begin(BEGIN_NS)
        begin_s = time.monotonic()
        for number in range(20):
            while time.monotonic() < begin_s + number * period_s:
                sent += [(one, time.monotonic()) for one in relay.due(BEGIN_NS, time.monotonic())]
                time.sleep(0.002)
            relay.take(cloud_cdr(number, 10), BEGIN_NS, time.monotonic())
        while len(sent) < 20:
            sent += [(one, time.monotonic()) for one in relay.due(BEGIN_NS, time.monotonic())]
            time.sleep(0.002)
        relay.end()
    assert [one.cdr for one, _ in sent] == [cloud_cdr(number, 10) for number in range(20)]
    attacked = [number for number, (one, _) in enumerate(sent) if one.fate == UNCHANGED]
    assert 3 <= len(attacked) <= 5
    assert attacked[0] == 0
    assert sum(one.fate == LATE for one, _ in sent) == 20 - len(attacked)
    gaps_s = np.diff([at_s for _, at_s in sent])
    assert np.median(gaps_s) == pytest.approx(period_s, abs=0.03)
    assert all(at_s - (one.arrival_s or 0) < 1.5 for one, at_s in sent)
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(
        r"some clouds are passed on unchanged \(others were being attacked, 0\.[4-9] s for each\)", line
    )


def test_a_rehearsal_leaves_no_trace(tmp_path: Path) -> None:
    """The first cloud is attacked as without it, and nothing is counted or recorded."""
    settings = settings_of(DETACH, max_latency_s=30)
    sent = []
    for name in ("with", "without"):
        with recording(tmp_path / name, has_clouds=True) as recorder:
            relay = CloudRelay(settings, settings.attacks, recorder)
            if name == "with":
                relay.rehearse()
            assert not relay.counts.received
            relay.begin(BEGIN_NS)
            relay.take(cloud_cdr(), BEGIN_NS, time.monotonic())
            sent.append(passing(relay))
            relay.end()
    assert sent[0][0].fate == ATTACKED
    assert sent[0][0].cdr == sent[1][0].cdr
    frames = pq.read_table(tmp_path / "with" / "frames.parquet").to_pylist()
    assert [row["frame"] for row in frames] == [0]
