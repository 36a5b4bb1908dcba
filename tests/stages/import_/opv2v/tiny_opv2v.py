"""A scenario in the form of OPV2V, written as OpenCDA writes it: left-handed, in degrees."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

TICKS = ("000068", "000070", "000072")
AGENTS = {"1045": 0.0, "1054": 20.0, "-1": -15.0}
"""Folders of agents, and how far each is ahead."""


def points(seed: int, count: int = 400) -> np.ndarray:
    """x, y, z in CARLA's frame and an intensity of 0 to 255."""
    rng = np.random.default_rng(seed)
    table = rng.uniform(-40, 40, (count, 4))
    table[:, 2] = rng.uniform(-1.9, 1, count)
    table[:, 3] = rng.integers(0, 256, count)
    return table.astype(np.float32)


def write_pcd(file: Path, table: np.ndarray, how: str = "binary") -> None:
    """Colours packed in a float, as Open3D writes them."""
    colour = (table[:, 3].astype(np.uint32) << 16).view(np.float32)
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\n"
        f"TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {len(table)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(table)}\nDATA {how}\n"
    )
    columns = np.column_stack([table[:, :3], colour]).astype("<f4")
    if how == "binary":
        data = columns.tobytes()
    else:
        data = "".join(" ".join(f"{value:.10g}" for value in row) + "\n" for row in columns).encode()
    file.write_bytes(header.encode() + data)


def document(agent: str, tick: int) -> dict[str, Any]:
    """What an agent writes at a tick: itself at x ahead + 0.5 m a tick, and two vehicles."""
    x = AGENTS[agent] + 0.5 * (tick - 68)
    vehicles = {
        1054 if agent == "1045" else 1045: vehicle(
            AGENTS["1054" if agent == "1045" else "1045"] + 0.5 * (tick - 68)
        ),
        777: {**vehicle(35.5), "bp_id": "vehicle.carlamotors.carlacola"},
    }
    found = {
        "ego_speed": 36.0,
        "lidar_pose": [x - 0.5, 3.0, 1.93, 0.1, 10.0, 0.2],
        "true_ego_pos": [x, 3.1, 0.03, 0.1, 10.0, 0.2],
        "vehicles": vehicles,
    }
    if agent.startswith("-"):
        del found["true_ego_pos"]
        found["lidar_pose"] = [AGENTS[agent], 8.0, 4.3, 0.0, 90.0, 0.0]
    return found


def vehicle(x: float) -> dict[str, Any]:
    return {
        "angle": [0.1, 30.0, 0.2],
        "center": [0.0, 0.0, 0.71],
        "extent": [2.45, 1.06, 0.75],
        "location": [x, 5.5, 0.03],
        "speed": 36.0,
    }


def write_opv2v(scenario: Path, how: str = "binary") -> Path:
    """Write a scenario; returns its folder."""
    for number, agent in enumerate(AGENTS):
        (scenario / agent).mkdir(parents=True)
        for tick in TICKS:
            write_pcd(scenario / agent / f"{tick}.pcd", points(number), how)
            (scenario / agent / f"{tick}.yaml").write_text(yaml.safe_dump(document(agent, int(tick))))
    (scenario / "data_protocol.yaml").write_text("world: {}\n")
    return scenario
