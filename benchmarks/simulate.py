"""Measures the stage `simulate` relative to bare ray casting, in the same run.

Bare casting is what a simulation cannot do without: one cast of all rays into the static scene, and one
into a scene of all moving meshes, which is built anew in every frame. Both are timed in every frame, one
after the other, so that whatever else the machine does weighs on both. Prints the ratio of their sums,
and where the time of the stage goes.

    python benchmarks/simulate.py [SCENARIO] [--frames 200] [--set key=value]
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.localisation.onboard import OnBoard
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.lidar import rig
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.stages.simulate import run
from advpipe.stages.simulate.recorder import Recorder
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic
from advpipe.stages.simulate.world.raycast.body_meshes import body_mesh
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

REACH = 1.6


class Stopwatch:
    """Seconds by name; wraps methods so that they count."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def add(self, name: str, seconds: float) -> None:
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def wrap(self, owner: Any, method: str, name: str) -> None:
        original: Callable[..., Any] = getattr(owner, method)

        def timed(*args: Any, **kwargs: Any) -> Any:
            start = time.perf_counter()
            try:
                return original(*args, **kwargs)
            finally:
                self.add(name, time.perf_counter() - start)

        setattr(owner, method, timed)


class BareCasting:
    """Casts the rays of every frame with nothing but Open3D, beside the stage's own cast."""

    def __init__(self, watch: Stopwatch) -> None:
        self._watch = watch
        self._ground: Mesh | None = None
        self._static: o3d.t.geometry.RaycastingScene | None = None
        self.seconds = 0.0
        self.users: list[int] = []
        self._stage_cast = RaycastWorld.cast

    def install(self) -> None:
        bare = self

        def cast(world: RaycastWorld, rays: Any, users: Sequence[RoadUser], *args: Any, **kwargs: Any) -> Any:
            start = time.perf_counter()
            bare.cast(world, rays, users)
            middle = time.perf_counter()
            hits = bare._stage_cast(world, rays, users, *args, **kwargs)
            bare.seconds += middle - start
            bare._watch.add("cast", time.perf_counter() - middle)
            return hits

        RaycastWorld.cast = cast  # type: ignore[method-assign]
        original = Scene.__init__

        def remember(scene: Scene, mesh: Mesh, *args: Any) -> None:
            bare._ground = bare._ground or mesh  # the world's first scene is the static one
            original(scene, mesh, *args)

        Scene.__init__ = remember  # type: ignore[method-assign]

    def cast(self, world: RaycastWorld, rays: Any, users: Sequence[RoadUser]) -> None:
        start = time.perf_counter()
        if self._static is None:
            assert self._ground is not None
            parked = [_mesh(car.variant).transformed(car.map_SE3_base) for car in world.parked]
            self._static = _scene(merge([self._ground, *parked]))
            self.seconds -= time.perf_counter() - start  # made once
        moving = _scene(merge(_mesh(user.variant).transformed(user.map_SE3_base) for user in users))
        tensor = o3d.core.Tensor.from_numpy(rays)
        for scene in (self._static, moving):
            scene.cast_rays(tensor)["t_hit"].numpy()
        self.users.append(len(users))


_mesh = cache(body_mesh)


def _scene(mesh: Mesh) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices_m.astype(np.float32)), o3d.core.Tensor(mesh.triangles.astype(np.uint32))
    )
    return scene


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="boulevard")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    scenario = load_scenario(given.scenario, given.set)
    duration_s = given.frames * scenario.simulation.step_s
    scenario = load_scenario(given.scenario, [*given.set, f"simulation.duration_s={duration_s}"])

    watch = Stopwatch()
    bare = BareCasting(watch)
    bare.install()
    for owner, method, name in (
        (SumoTraffic, "step", "SUMO"),
        (SumoTraffic, "road_users", "road users"),
        (Lidar, "rays", "rays"),
        (Lidar, "measure", "measure"),
        (OnBoard, "step", "localisation"),
        (rig, "count_points", "points in boxes"),
        (Recorder, "record", "messages and writing"),
        (BagWriter, "__exit__", "closing the bag"),
    ):
        watch.wrap(owner, method, name)
    loop: dict[str, float] = {}
    run.track = _timed_track(loop)  # type: ignore[assignment]
    with tempfile.TemporaryDirectory() as folder:
        summary = run.simulate(scenario, Path(folder) / "drive")
    stage_s = loop["seconds"] + watch.seconds.get("closing the bag", 0.0) - bare.seconds
    watch.seconds["the rest"] = stage_s - sum(watch.seconds.values())
    frames = summary.frames
    print(f"{scenario.name}: {frames} frames, {np.mean(bare.users):.0f} moving road users in range")
    for name, seconds in sorted(watch.seconds.items(), key=lambda item: -item[1]):
        print(f"  {name:22} {1000 * seconds / frames:7.1f} ms a frame")
    print(
        f"whole stage            {1000 * stage_s / frames:9.1f} ms a frame, {frames / stage_s:.1f} frames/s"
    )
    print(f"bare casting           {1000 * bare.seconds / frames:9.1f} ms a frame")
    print(f"most memory            {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:9.0f} MB")
    ratio = stage_s / bare.seconds
    print(f"ratio                  {ratio:9.2f} (reach: at most {REACH})")
    return int(ratio > REACH)


def _timed_track(loop: dict[str, float]) -> Callable[..., Any]:
    def track(items: Any, _: str) -> Any:
        start = time.perf_counter()
        yield from items
        loop["seconds"] = time.perf_counter() - start

    return track


if __name__ == "__main__":
    sys.exit(main())
