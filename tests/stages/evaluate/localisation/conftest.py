"""A vehicle on a circle with all that its filter needs in the bag, and its GPS attacked."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.localisation import initial_pose_message, onboard_messages
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.onboard import OnBoard
from advpipe.pipeline.localisation.section import GnssSensor
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.stages.attack.change import changed_messages
from advpipe.stages.attack.gnss.change import spoof

EGO = VehicleTopics("ego")
START_NS, STEP_NS, STEPS = 1_767_268_800_000_000_000, 100_000_000, 200
SENSORS = Sensors(gnss=GnssSensor(rate_hz=5))


@pytest.fixture(scope="session")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """20 s at 12 m/s on a circle of 80 m; five fixes a second."""
    path = tmp_path_factory.mktemp("localisation") / "clean"
    board = OnBoard("ego", SENSORS, Geodesy(50.1, 8.6, 100.0), 0.1, 11)
    scenario = {
        "sensors": SENSORS.model_dump(mode="json"),
        "map": {"origin": {"latitude_deg": 50.1, "longitude_deg": 8.6, "altitude_m": 100.0}},
        "simulation": {"seed": 11, "duration_s": 20, "step_s": 0.1},
    }
    with BagWriter(path, provenance={"kind": "clean"}) as bag:
        bag.write(SCENARIO_INFO, build.string(json.dumps(scenario)), START_NS)
        for index in range(STEPS):
            angle, stamp_ns = 0.15 * 0.1 * index, START_NS + index * STEP_NS
            pose = se3_from_yaw([80 * np.sin(angle), 80 - 80 * np.cos(angle), 0.0], angle)
            step = board.step(stamp_ns, pose, np.array([12.0, 0, 0]))
            if index == 0:
                assert board.initial is not None
                bag.write(*initial_pose_message(EGO, board.initial, stamp_ns))
            for stamped in onboard_messages(EGO, SENSORS.imu, step):
                bag.write(*stamped)
            truth = build.odometry(stamp_ns, pose, step.truth.base_velocity_mps, np.zeros(3))
            bag.write(EGO.true_odometry, truth, stamp_ns)
    return path


@pytest.fixture(scope="session")
def attacked(clean: Path) -> Callable[..., Path]:
    """Makes an adversarial bag beside the clean one."""

    def make(name: str, **spec: object) -> Path:
        reader, path = BagReader(clean), clean.parent / name
        if not path.exists():
            change = spoof(reader, [attack_spec(spec)], 7)
            with BagWriter(path, provenance={"kind": "attack"}) as bag:
                for raw in changed_messages(reader, [change]):
                    bag.copy(raw)
        return path

    return make
