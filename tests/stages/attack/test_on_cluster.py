"""An attack on a cluster: the bytes of one local worker, also when a node is killed in the middle."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from two_nodes import RayCluster, ray_cluster

from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.core.job_engine import chosen_engine
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack

pytestmark = pytest.mark.nightly

SLOW = '''
import time
import linear_detector

class Slow(linear_detector.Shipped):
    """Frames take a second, as real ones do."""

    def occupancy_loss(self, *given, **named):
        time.sleep(0.05)
        return super().occupancy_loss(*given, **named)
'''


def request(detector: str) -> AttackRequest:
    return AttackRequest((AttackSpec(type="detach", parameters={"ratio": 0.1}, detector=detector),), 3)


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


def kill_in_the_middle(cluster: RayCluster, doomed: object, out: Path) -> None:
    while not list(out.parent.glob(f".{out.name}.*.job/*.npz")):
        time.sleep(0.02)
    cluster.kill(doomed)


def test_a_killed_node_changes_no_byte(
    clean_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slow_detector.py").write_text(SLOW)
    monkeypatch.syspath_prepend(tmp_path)
    asked = request("slow_detector:Slow")
    local, remote = tmp_path / "local" / "adv", tmp_path / "ray" / "adv"
    attack(clean_bag, local, asked, workers=1)
    with ray_cluster(1) as cluster:
        doomed = cluster.add()
        killer = threading.Thread(target=kill_in_the_middle, args=(cluster, doomed, remote), daemon=True)
        with use_cluster(cluster.address):
            assert chosen_engine() is not None
            killer.start()
            attack(clean_bag, remote, asked)
        killer.join(timeout=30)
        assert not killer.is_alive()
    assert content(local) == content(remote)
