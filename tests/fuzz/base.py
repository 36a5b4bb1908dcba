"""Makes the valid documents from which inputs are mutated, with advpipe itself; a few seconds per run."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

DRIVE, ARCHIVES, WEIGHTS, NETWORKS, TABLES = "drive", "archives", "weights", "networks", "tables"
REPORT = "report"
POINTS, RECORDINGS = "points", "recordings"

SETTINGS = (
    *("simulation.duration_s=1", "simulation.warmup_s=5", "vehicles={ego: {}, other: {}}"),
    *("traffic.vehicles=12", "traffic.pedestrians=3", "v2x.penetration=1"),
    "v2x.radio.building_loss=obstacles",
    *("sensors.lidars.lidar.channels=4", "sensors.lidars.lidar.points_per_second=4000"),
)
ATTACKS = {
    "cam": {"type": "cam-position-offset", "attackers": {"share": 0.3}},
    "gnss": {"type": "gnss-bias", "victim": "ego"},
    "detach": {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.05}, "frames": "::4"},
}
TRAJECTORY = "id,time_s,x_m,y_m,z_m,yaw_rad,body\n" + "".join(
    f"{name},{step / 10},{10 + step},{place},0,0.1,sedan\n"
    for place, name in enumerate(("car1", "car2"))
    for step in range(20)
)


def build(folder: Path) -> Path:
    """A drive of a second with attacks on clouds, V2X and GPS, and the other documents; returns `folder`."""
    if (folder / "whole").exists():
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    _drive(folder / DRIVE)
    _archives(folder / DRIVE, folder / ARCHIVES)
    _weights(folder / WEIGHTS)
    _networks(folder / NETWORKS)
    _tables(folder / TABLES)
    _report(folder / REPORT)
    _points(folder / POINTS)
    _recordings(folder / RECORDINGS)
    (folder / "whole").touch()
    return folder


def _drive(drive: Path) -> None:
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.pipeline.scenario.attacks import attack_spec
    from advpipe.stages.attack.run import AttackRequest, attack
    from advpipe.stages.simulate.run import simulate

    simulate(load_scenario("smoke", SETTINGS), drive)
    for name, options in ATTACKS.items():
        attack(drive / "clean", drive / name, AttackRequest((attack_spec(options),)), workers=1)


def _archives(drive: Path, archives: Path) -> None:
    """A data set as it is shared, without most of its bags, so that unpacking it takes milliseconds."""
    from advpipe.pipeline.dataset import checksums
    from advpipe.pipeline.dataset.archive import contents, pack

    whole = archives / "town"
    shutil.copytree(drive / "clean", whole / "clean")
    shutil.copy(drive / "scenario.yaml", whole)
    (whole / ("long-" * 25 + "name.txt")).write_text("a name that needs a pax header", encoding="utf-8")
    (whole / "größe.txt").write_text("and another", encoding="utf-8")
    checksums.write(whole)
    pack(contents(whole), archives / "town.tar")
    shutil.rmtree(whole)
    (archives / "town.tar.sha256").unlink()


def _weights(weights: Path) -> None:
    """A checkpoint of ours, and one of OpenPCDet's, in which every tensor repeats one stored number."""
    import torch

    from advpipe.pipeline.detector.common.openpcdet import their_names
    from advpipe.pipeline.detector.second.family import SHIPPED
    from advpipe.pipeline.detector.second.model import SecondNet
    from advpipe.pipeline.detector.second.presets import KITTI

    weights.mkdir()
    shutil.copy(SHIPPED["small"], weights / "small.safetensors")
    names = [their for name in SecondNet(KITTI).state_dict() for their in _names_of(name, their_names)]
    state = {name: torch.zeros(1).expand(3, 3) for name in names}
    torch.save({"model_state": state, "epoch": 80}, weights / "second.pth")


def _names_of(name: str, their_names: object) -> tuple[str, ...]:
    return () if name.endswith("num_batches_tracked") else tuple(their_names(name))  # type: ignore[operator]


def _networks(networks: Path) -> None:
    """Four junctions as SUMO and as OpenDRIVE have them."""
    from advpipe.stages.simulate.road_network.file import sumo_program

    networks.mkdir()
    net, xodr = networks / "town.net.xml", networks / "town.xodr"
    grid = ["--grid", "--grid.number", "2", "--default.lanenumber", "2", "--output-file", str(net)]
    subprocess.run([sumo_program("netgenerate"), *grid], check=True, capture_output=True)
    export = ["--sumo-net-file", str(net), "--opendrive-output", str(xodr)]
    subprocess.run([sumo_program("netconvert"), *export], check=True, capture_output=True)


def _tables(tables: Path) -> None:
    """Trajectories as text and as Parquet."""
    import pyarrow.csv
    import pyarrow.parquet

    tables.mkdir()
    (tables / "poses.csv").write_text(TRAJECTORY, encoding="utf-8")
    pyarrow.parquet.write_table(pyarrow.csv.read_csv(tables / "poses.csv"), tables / "poses.parquet")


def _report(report: Path) -> None:
    """A folder with one figure, as far as `advpipe figures` reads a report."""
    from advpipe.pipeline.core.figure import Figure
    from advpipe.stages.evaluate.report.pictures import to_svg

    figure = Figure(figsize=(2, 2), facecolor="white")
    axes = figure.add_subplot()
    axes.plot([0, 1], [1, 0], "o--", alpha=0.5)
    axes.scatter([0.5], [0.5], rasterized=True)
    (report / "figures").mkdir(parents=True)
    (report / "report.json").write_text("{}", encoding="utf-8")
    (report / "figures" / "one.svg").write_bytes(to_svg(figure))


def _points(points: Path) -> None:
    """A cloud in each format, and a folder of two clouds with all that may lie beside them."""
    import numpy as np

    from tests.stages.import_.point_bytes import pcd, ply, some_points

    some, clouds, drive = some_points(0, 60), points / "clouds", points / "drive"
    clouds.mkdir(parents=True)
    (drive / "labels").mkdir(parents=True)
    for form in ("ascii", "binary", "binary_compressed"):
        (clouds / f"{form}.pcd").write_bytes(pcd(some, form))
    for name, order in (("text", ""), ("little", "<"), ("big", ">")):
        (clouds / f"{name}.ply").write_bytes(ply(some, order))
    table = np.stack([some[name] for name in ("x", "y", "z", "intensity")], axis=1)
    np.save(clouds / "table.npy", table)
    np.save(clouds / "named.npy", some)
    (clouds / "table.bin").write_bytes(table.tobytes())
    for k in range(2):
        (drive / f"{k}.pcd").write_bytes(pcd(some_points(k, 60)))
        (drive / "labels" / f"{k}.txt").write_text("1 2 -1 4 2 1.5 0.1 car a\n9 2 -1 1 1 2 0.1 walker b\n")
    (drive / "times.txt").write_text("2011-09-26 13:02:25.964\n2011-09-26 13:02:26.067\n")
    (drive / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n")


def _recordings(recordings: Path) -> None:
    """Three ticks of CARLA's bridge as ROS 1 and ROS 2 record them."""
    from tests.stages.import_.ros_drives import carla, record

    recordings.mkdir()
    record(recordings / "town", "ros1", lambda made: carla(made, 3))
    record(recordings / "town2", "sqlite", lambda made: carla(made, 3))
