"""Draws what one LiDAR sees of a scenario: from above by class, and to the front by class and intensity.

python benchmarks/world_picture.py OUT.png [SCENARIO] [--frame 50] [--set key=value]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.walkers import draw_walkers
from advpipe.stages.simulate.world.raycast.materials import SEMANTIC, SEMANTIC_CLASSES
from advpipe.stages.simulate.world.raycast.world import RaycastWorld, within

COLOURS = {
    "road": "#8f4d9e", "marking": "#ffffff", "pavement": "#d9a0dd", "ground": "#7a5c2e",
    "vegetation": "#33aa44", "building": "#d89a2b", "pole": "#9aa7b0", "sign": "#ffee44",
    "barrier": "#c0563b", "vehicle": "#4a86ff", "person": "#ff3b3b", "other": "#55cccc",
}  # fmt: skip
HALF_M = 45.0
FRONT_DEG = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenario", nargs="?", default="boulevard")
    parser.add_argument("--frame", type=int, default=50)
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    scenario = load_scenario(given.scenario, given.set)
    seed = scenario.simulation.seed
    sensor = next(iter(scenario.sensors.lidars.values()))
    with tempfile.TemporaryDirectory() as scratch:
        network = load_network(scenario.map, Path(scratch), seed)
        variants = draw_variants(named_generator(seed, "bodies"), scenario.bodies)
        world = RaycastWorld(scenario, network, variants)
        with open_traffic(scenario, network, variants, Path(scratch)) as traffic:
            route_m = traffic.route_m(sensor.vehicle)
            walkers = draw_walkers(scenario, world.roads, variants, [route_m], network.pavements_m)
            for _ in range(given.frame + 1):
                traffic.step()
            users = traffic.road_users()
    carrier = users[sensor.vehicle]
    moving = [*users.values(), *(w.at(given.frame * scenario.simulation.step_s) for w in walkers)]
    near = [moving[index] for index in within(moving, carrier, sensor.range)]
    lidar = Lidar(sensor, scenario.simulation.step_s, scenario.environment.weather)
    rays = lidar.rays(carrier.map_SE3_base)
    hits = world.cast(rays, near, sensor.range)
    cloud = lidar.measure(hits, named_generator(seed, "picture"))
    seen = hits.range_m <= sensor.range
    local = rays[:, 3:] @ carrier.map_SE3_base[:3, :3].astype(np.float32)
    classes = np.where(seen, SEMANTIC[hits.materials], len(SEMANTIC_CLASSES))
    palette = ListedColormap([*(COLOURS[name] for name in SEMANTIC_CLASSES), "black"])

    figure = plt.figure(figsize=(15, 6.2), facecolor="black")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.42), wspace=0.02, hspace=0.14)
    above = figure.add_subplot(grid[:, 0])
    places = local * hits.range_m[:, None]
    colours = np.array(palette.colors, dtype=object)[classes[seen]]
    above.scatter(places[seen, 0], places[seen, 1], s=0.35, c=list(colours), linewidths=0)
    above.set(xlim=(-HALF_M, HALF_M), ylim=(-HALF_M, HALF_M), aspect="equal")
    shape = (sensor.columns, sensor.channels)
    bearing = np.arctan2(local[:, 1], local[:, 0]).reshape(shape)[:, 0]
    front = np.flatnonzero(np.abs(bearing) < np.deg2rad(FRONT_DEG))
    front = front[np.argsort(-bearing[front])]
    by_class = figure.add_subplot(grid[0, 1])
    image = classes.reshape(shape)[front].T[::-1]
    by_class.imshow(
        image, cmap=palette, vmin=-0.5, vmax=len(COLOURS) + 0.5, aspect="auto", interpolation="none"
    )
    by_intensity = figure.add_subplot(grid[1, 1])
    strength = np.full(len(rays), np.nan, np.float32)
    columns = np.round((np.arctan2(cloud["y"], cloud["x"]) - bearing[0]) * -sensor.columns / (2 * np.pi))
    index = columns.astype(int) % sensor.columns * sensor.channels + cloud["ring"]
    strength[index] = cloud["intensity"]
    by_intensity.imshow(
        strength.reshape(shape)[front].T[::-1],
        cmap="turbo",
        vmin=0,
        vmax=0.7,
        aspect="auto",
        interpolation="none",
    )
    for axes, title in (
        (above, "from above, by class"),
        (by_class, f"{2 * FRONT_DEG:.0f}° to the front, by class"),
        (by_intensity, f"{2 * FRONT_DEG:.0f}° to the front, by intensity"),
    ):
        axes.set_facecolor("black")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(title, color="white", fontsize=10)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(given.out, dpi=85, bbox_inches="tight", facecolor="black")


if __name__ == "__main__":
    main()
