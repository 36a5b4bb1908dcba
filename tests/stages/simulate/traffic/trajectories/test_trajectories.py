"""Vehicles that are moved from outside: exact, on slopes and off roads too, and traffic reacts to them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import yaw_of
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.trajectories.table import Rows
from advpipe.stages.simulate.traffic.trajectories.trajectories import Trajectory

Drive = list[dict[str, RoadUser]]
Driver = Callable[[Scenario, int], Drive]
HEAD = "id,time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,body\n"


def trajectory(variants: dict[str, Variant], rows: list[list[float]]) -> Trajectory:
    return Trajectory.of("a", variants["sedan.0"], Rows(np.array(rows, dtype=np.float64), "sedan"))


def test_position_is_interpolated_halfway(variants: dict[str, Variant]) -> None:
    """Yaw from 170 to -170 degrees goes through 180, not through 0."""
    turn = np.deg2rad(170)
    user = trajectory(variants, [[0, 0, 0, 0, turn, 0, 0], [2, 4, 8, 2, -turn, 0.2, 0]]).at(1.0)
    assert user.position_m == pytest.approx([2, 4, 1])
    assert abs(yaw_of(user.map_SE3_base)) == pytest.approx(np.pi)
    assert user.map_SE3_base[2, 0] == pytest.approx(-np.sin(0.1))
    assert user.velocity_mps == pytest.approx([2, 4, 1])


def test_velocity_matches_a_smooth_curve(variants: dict[str, Variant]) -> None:
    """x = t^2 at rows of unequal spacing: its velocity at t = 3 is 6."""
    rows = [[t, t * t, 0, 0, 0, 0, 0] for t in (0.0, 1.0, 2.5, 3.0, 4.0)]
    assert trajectory(variants, rows).at(3.0).velocity_mps == pytest.approx([6, 0, 0])


def test_a_vehicle_exists_from_its_first_to_its_last_row(variants: dict[str, Variant]) -> None:
    one = trajectory(variants, [[0.3, 0, 0, 0, 0, 0, 0], [0.7, 1, 0, 0, 0, 0, 0]])
    assert [one.exists_at(k / 10) for k in range(10)] == [False] * 3 + [True] * 5 + [False] * 2


def scenario(folder: Path, net: Path, rows: str, *settings: str) -> Scenario:
    (folder / "t.csv").write_text(HEAD + rows)
    more = [f"map.sumo_net={net}", "trajectories.file=" + str(folder / "t.csv"), "simulation.warmup_s=2"]
    more += [
        "traffic.vehicles=0",
        "traffic.pedestrians=0",
        "traffic.parked_per_km=0",
        "simulation.duration_s=10",
    ]
    return load_scenario("smoke", [*more, *settings])


def test_poses_on_a_slope_match_the_rows(tmp_path: Path, road: Callable[..., Path], drive: Driver) -> None:
    """A climb of 30 m in 300 m; the ego's rows alone say where it is, to the last frame."""
    pitch_rad = -np.arctan(0.1)
    rows = "".join(f"ego,{t},{20 + 12 * t},-1.6,{2 + 1.2 * t},0,{pitch_rad},0,sedan\n" for t in range(11))
    settings = ["vehicles={ego: {driver: trajectory}}"]
    states = drive(scenario(tmp_path, road(300, rise_m=30), rows, *settings), 100)
    for frame, state in enumerate(states):
        ego = state["ego"]
        assert ego.position_m == pytest.approx([20 + 1.2 * frame, -1.6, 2 + 0.12 * frame])
        assert ego.map_SE3_base[2, 0] == pytest.approx(np.sin(np.arctan(0.1)))
        assert ego.velocity_mps == pytest.approx([12, 0, 1.2])


def test_traffic_stops_behind_a_standing_trajectory_vehicle(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    """Unhindered, the ego drives the 400 m through; behind a standing car it stops before its rear."""
    net = road(400)
    rows = "".join(f"wall,{t},300,-1.6,0,0,0,0,sedan\n" for t in range(61))
    settings = ["simulation.duration_s=60", "vehicles={ego: {route: [ab, bc]}}"]
    ends = []
    for more in (rows, rows.replace("300,-1.6", "300,50")):
        states = drive(scenario(tmp_path, net, more, *settings), 600)
        ends.append(states[-1]["ego"].position_m[0])
        assert states[-1]["wall"].position_m[0] == 300
    assert ends[0] < 300 - 4.5
    assert ends[0] > 280
    assert ends[1] > 380


def test_a_trajectory_vehicle_off_the_road_stays_in_the_world(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    """It drives straight across the road and on into the fields, and back."""
    track = [(t, 100, -60 + 20 * t if t < 6 else 180 - 20 * t) for t in range(10)]
    rows = "".join(f"stray,{t},{x},{y},0,1.5,0,0,bus\n" for t, x, y in track)
    states = drive(scenario(tmp_path, road(300), rows), 92)
    assert all("stray" in state for state in states[:91])
    assert "stray" not in states[91]
    assert states[55]["stray"].position_m == pytest.approx([100, 50, 0])
    assert states[0]["stray"].variant.body.label == "truck"


def test_trajectory_vehicles_come_and_go_without_affecting_others(
    tmp_path: Path, grid: Callable[..., Path], drive: Driver
) -> None:
    """Sixty vehicles of SUMO's, twenty of the table's that appear and vanish among them."""
    rng = np.random.default_rng(4)
    rows = ""
    for index in range(20):
        start, place = rng.uniform(0, 4), rng.uniform(0, 300, 2)
        for t in range(4):
            rows += f"v{index},{start + t},{place[0] + 8 * t},{place[1]},0,0,0,0,sedan\n"
    path = grid("--grid.number", "4", "--grid.length", "100")
    states = drive(scenario(tmp_path, path, rows, "traffic.vehicles=60"), 80)
    counts = [sum(name.startswith("v") and "." not in name for name in state) for state in states]
    assert max(counts) > 5
    assert counts[-1] == 0
    assert all("ego" in state for state in states)
    assert len(states[-1]) > 50


BAD = {
    "x,0,0,0,0,0,0,0,sedan\nx,9,0,0,0,0,0,0,sedan\n": r"t\.csv has no row of id ego",
    "ego,0,0,0,0,0,0,0,sedan\nego,5,0,0,0,0,0,0,sedan\n": r"rows only from 0 s to 5 s of .* 0 s to 9\.9 s",
}


@pytest.mark.parametrize(("rows", "message"), BAD.items(), ids=range(len(BAD)))
def test_an_instrumented_vehicle_needs_rows_for_the_whole_recording(
    tmp_path: Path, road: Callable[..., Path], drive: Driver, rows: str, message: str
) -> None:
    with pytest.raises(AdvpipeError, match=message):
        drive(scenario(tmp_path, road(200), rows, "vehicles={ego: {driver: trajectory}}"), 1)


def test_reserved_names_are_refused(tmp_path: Path, road: Callable[..., Path], drive: Driver) -> None:
    rows = "pedestrian.3,0,0,0,0,0,0,0,sedan\npedestrian.3,1,0,0,0,0,0,0,sedan\n"
    with pytest.raises(AdvpipeError, match=r"pedestrian\.3 is a reserved name; .* traffic\.pedestrians to 0"):
        drive(scenario(tmp_path, road(200), rows, "traffic.pedestrians=5"), 1)
    rows = "ego,0,0,0,0,0,0,0,sedan\nego,1,0,0,0,0,0,0,sedan\n"
    with pytest.raises(AdvpipeError, match=r"rows of ego, whose driver is traffic"):
        drive(scenario(tmp_path, road(200), rows), 1)
