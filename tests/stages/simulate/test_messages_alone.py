"""A drive without instrumented vehicles: what stations send, and nothing else."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.simulate.run import simulate


def test_a_drive_of_messages_alone_is_recorded_and_attacked(tmp_path: Path) -> None:
    settings = ["vehicles={}", "simulation.duration_s=2", "v2x.penetration=1"]
    summary = simulate(load_scenario("smoke", settings), tmp_path / "drive")
    assert summary.v2x is not None
    assert summary.v2x.stations > 10
    assert summary.v2x.cams > 50
    reader = BagReader(summary.bag)
    assert set(reader.topics) == {
        *("/clock", "/map/lanes", "/scenario/info", "/tf", "/tf_static"),
        *("/v2x/sent", "/v2x/stations", "/v2x/statistics"),
    }
    assert reader.topics["/v2x/sent"].count == summary.v2x.cams
    spec = attack_spec({"type": "cam-speed-offset", "attackers": {"share": 0.5}})
    change = forge(reader, [spec], seed=1)
    change.write_labels(tmp_path)
    assert change.counts()["CAMs changed"] > 10
