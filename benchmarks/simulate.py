"""Measures the stage `simulate` relative to bare ray casting of the same scene.

Bare casting is what a simulation cannot do without: one cast of all rays into the static scene, and one
into a scene of all moving meshes, which is built anew in every frame.

The drive is recorded twice in each round. First in one process, with the bare casts in every frame beside the
stage's own: that says where the time of the stage goes, and what bare casting takes. Then as users record it,
with the sensors in a process of their own where there is a second core. Both are from the first frame to the
whole bag. Prints the ratios of the rounds' least times to bare casting's: they need a quiet machine.

    python benchmarks/simulate.py [SCENARIO] [--frames 200] [--rounds 2] [--set key=value]
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
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.pipeline.sensors.lidar import rig, view_messages
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.stages.simulate import run
from advpipe.stages.simulate.network.embedded.network import EmbeddedNetwork
from advpipe.stages.simulate.recorder import Recorder
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic
from advpipe.stages.simulate.world.raycast.body_meshes import body_mesh
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

REACH = 1.6

PHASES = (
    (SumoTraffic, "step", "SUMO"),
    (SumoTraffic, "road_users", "road users"),
    (EmbeddedNetwork, "_step", "V2X network"),
    (EmbeddedNetwork, "update", "V2X stations"),
    (Lidar, "rays", "rays"),
    (Lidar, "measure", "measure"),
    (OnBoard, "step", "localisation"),
    (rig, "count_points", "points in boxes"),
    (view_messages, "view_messages", "clouds and truth as messages"),
    (Recorder, "record", "other messages, writing"),
    (BagWriter, "__exit__", "closing the bag"),
)


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


_CAST, _INIT = RaycastWorld.cast, Scene.__init__


class BareCasting:
    """Casts the rays of every frame with nothing but Open3D, beside the stage's own cast."""

    def __init__(self, watch: Stopwatch) -> None:
        self._ground: Mesh | None = None
        self._static: o3d.t.geometry.RaycastingScene | None = None
        self.seconds = 0.0
        self.users: list[int] = []
        bare = self

        def cast(world: RaycastWorld, rays: Any, users: Sequence[RoadUser], *args: Any, **kwargs: Any) -> Any:
            start = time.perf_counter()
            bare.cast(world, rays, users)
            middle = time.perf_counter()
            hits = _CAST(world, rays, users, *args, **kwargs)
            bare.seconds += middle - start
            watch.add("cast", time.perf_counter() - middle)
            return hits

        def remember(scene: Scene, mesh: Mesh, *args: Any) -> None:
            bare._ground = bare._ground or mesh  # the world's first scene is the static one
            _INIT(scene, mesh, *args)

        RaycastWorld.cast = cast  # type: ignore[method-assign]
        Scene.__init__ = remember  # type: ignore[method-assign]

    def uninstall(self) -> None:
        RaycastWorld.cast = _CAST  # type: ignore[method-assign]
        Scene.__init__ = _INIT  # type: ignore[method-assign]

    def cast(self, world: RaycastWorld, rays: Any, users: Sequence[RoadUser]) -> None:
        start = time.perf_counter()
        if self._static is None:
            assert self._ground is not None
            parked = [_mesh(car.variant).transformed(car.map_SE3_base) for car in world.parked]
            self._static = _scene(merge([self._ground, *parked]))
            self._static.cast_rays(o3d.core.Tensor.from_numpy(rays[:1]))
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="boulevard")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    scenario = load_scenario(given.scenario, given.set)
    duration_s = given.frames * scenario.simulation.step_s
    scenario = load_scenario(given.scenario, [*given.set, f"simulation.duration_s={duration_s}"])

    watch, pays_ahead = Stopwatch(), run.pays_ahead
    for owner, method, name in PHASES:
        watch.wrap(owner, method, name)
    alone_s, bare_s, stage_s = [], [], []
    for number in range(given.rounds):
        bare = BareCasting(watch)
        run.pays_ahead = lambda _: False
        seconds, phases = _recorded(scenario, watch)
        bare.uninstall()
        bare_s.append(bare.seconds)
        alone_s.append(seconds - bare.seconds)
        if number == 0:
            phases["the rest"] = alone_s[0] - sum(phases.values())
            users = np.mean(bare.users)
            print(f"{scenario.name}: {given.frames} frames, {users:.0f} moving road users in range")
            for name, phase_s in sorted(phases.items(), key=lambda item: -item[1]):
                print(f"  {name:22} {1000 * phase_s / given.frames:7.1f} ms a frame")
        run.pays_ahead = pays_ahead
        stage_s.append(_recorded(scenario, watch)[0])
    for name, seconds in (
        ("in one process", min(alone_s)),
        ("bare casting", min(bare_s)),
        ("whole stage", min(stage_s)),
    ):
        frame_ms = 1000 * seconds / given.frames
        print(f"{name:22} {frame_ms:9.1f} ms a frame; {seconds / min(bare_s):.2f} x bare casting")
    for name, who in (("this process", resource.RUSAGE_SELF), ("others", resource.RUSAGE_CHILDREN)):
        print(f"most memory, {name:12} {resource.getrusage(who).ru_maxrss / 1024:6.0f} MB")
    ratio = min(stage_s) / min(bare_s)
    print(f"ratio                  {ratio:9.2f} (reach: at most {REACH})")
    return int(ratio > REACH)


def _recorded(scenario: Scenario, watch: Stopwatch) -> tuple[float, dict[str, float]]:
    """Seconds from the first frame to the whole bag, and those of the phases."""
    watch.seconds.clear()
    loop: dict[str, float] = {}
    run.track = _timed_track(loop)  # type: ignore[assignment]
    with tempfile.TemporaryDirectory() as folder:
        run.simulate(scenario, Path(folder) / "drive")
    return loop["seconds"] + watch.seconds.get("closing the bag", 0.0), dict(watch.seconds)


def _timed_track(loop: dict[str, float]) -> Callable[..., Any]:
    def track(items: Any, _: str) -> Any:
        start = time.perf_counter()
        yield from items
        loop["seconds"] = time.perf_counter() - start

    return track


if __name__ == "__main__":
    sys.exit(main())
