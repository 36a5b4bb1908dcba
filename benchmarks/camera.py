"""Measures a camera relative to casting the same primary and shadow rays bare, in the same run.

Bare casting is what a picture cannot do without: casts of all its primary rays, those that smooth edges
included, into the static scene and into a scene of all moving meshes, which is built anew in every frame; and
of its shadow rays, asked only whether anything is hit. Both are timed in every frame, one after the other, so
that whatever else the machine does weighs on both. The camera's side is everything from the rays to the JPEG
file and the ground truth. Prints the ratio of their sums, in time and in processor time.

With --stage, it instead prints the speed of all of stage 1 with a LiDAR, a camera and, where the registry has
radars, a radar; the mark is half real time.

    python benchmarks/camera.py [SCENARIO] [--frames 60] [--set key=value] [--large] [--stage]
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from common import finish
from simulate import _mesh, _scene, _timed_track

from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.camera.cameras import Cameras
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.stages.simulate import run
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.mesh import merge
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.view import Viewer
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

MARK = 1.6
SMALL = ("image_size_x=640", "image_size_y=360")
LARGE = ("image_size_x=1280", "image_size_y=720", "samples=4")
NOON = "simulation.start=2026-06-21T10:00:00Z"
"""With the sun in the sky: without it there are no shadow rays."""


class Clock:
    """Seconds of the clock on the wall and of the processor."""

    def __init__(self) -> None:
        self.wall_s = self.processor_s = 0.0

    def run(self, work: Any, *args: Any, **kwargs: Any) -> Any:
        start = time.perf_counter(), time.process_time()
        result = work(*args, **kwargs)
        self.wall_s += time.perf_counter() - start[0]
        self.processor_s += time.process_time() - start[1]
        return result


class BareRays:
    """Notes the rays of each picture, and casts them again with nothing but Open3D."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.primary = self.shadow = 0
        self._mesh: Any = None
        self._static: Any = None
        self._world: RaycastWorld | None = None
        self._users: dict[str, RoadUser] = {}
        self._rays: tuple[list[Any], list[Any]] = [], []

    def install(self) -> None:
        bare, surfaces, is_shaded = self, Viewer.surfaces, Viewer.is_shaded
        world_init, scene_init = RaycastWorld.__init__, Scene.__init__

        def remember_world(world: RaycastWorld, *args: Any) -> None:
            bare._world = world
            world_init(world, *args)

        def remember_scene(scene: Scene, mesh: Any, *args: Any) -> None:
            bare._mesh = bare._mesh or mesh  # the world's first scene is the static one
            scene_init(scene, mesh, *args)

        def look(viewer: Viewer, rays: Any, users: Sequence[RoadUser], *args: Any) -> Any:
            bare._users = {user.id: user for user in users if "parked" not in user.id}
            bare._rays[0].append(rays)
            return surfaces(viewer, rays, users, *args)

        def shade(viewer: Viewer, points: Any, sun: Any, users: Sequence[RoadUser]) -> Any:
            rays = np.empty((points.shape[1], 6), np.float32)
            rays[:, :3], rays[:, 3:] = points.T, sun
            bare._rays[1].append(rays)
            return is_shaded(viewer, points, sun, users)

        RaycastWorld.__init__ = remember_world  # type: ignore[method-assign]
        Scene.__init__ = remember_scene  # type: ignore[method-assign]
        Viewer.surfaces = look  # type: ignore[method-assign]
        Viewer.is_shaded = shade  # type: ignore[method-assign]

    def cast_again(self, counts: bool) -> None:
        """Cast the rays noted since the last call; counts: whether they count."""
        if self._static is None:
            parked = [_mesh(car.variant).transformed(car.map_SE3_base) for car in self._world.parked]
            self._static = _scene(merge([self._mesh, *parked]))
        primary, shadow = (np.concatenate(rays) for rays in self._rays)
        for rays in self._rays:
            rays.clear()
        clock = self.clock if counts else Clock()
        clock.run(self._cast, primary, shadow)
        if counts:
            self.primary, self.shadow = self.primary + len(primary), self.shadow + len(shadow)

    def _cast(self, primary: Any, shadow: Any) -> None:
        users = self._users.values()
        moving = _scene(merge(_mesh(user.variant).transformed(user.map_SE3_base) for user in users))
        for scene in (self._static, moving):
            scene.cast_rays(o3d.core.Tensor.from_numpy(primary))["t_hit"].numpy()
            scene.test_occlusions(o3d.core.Tensor.from_numpy(shadow)).numpy()


@cache
def _radar_keys() -> tuple[str, ...]:
    return ("sensors.radars={front_radar: {}}",) if "radars" in SENSORS else ()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="district")
    parser.add_argument("--frames", type=int, default=50)  # more: sensors have another process
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--large", action="store_true", help="1280 x 720 with four samples a pixel")
    parser.add_argument("--stage", action="store_true", help="the speed of all of stage 1")
    given = parser.parse_args()
    step_s = load_scenario(given.scenario, given.set).simulation.step_s
    size = ", ".join(key.replace("=", ": ") for key in (LARGE if given.large else SMALL))
    keys = [
        NOON,
        f"simulation.duration_s={given.frames * step_s}",
        f"sensors.cameras={{front: {{{size}, fov: 70}}}}",
    ]
    keys += [*_radar_keys()] if given.stage else ["sensors.lidars={}"]
    scenario = load_scenario(given.scenario, [*keys, *given.set])
    finish(_stage(scenario, given.frames) if given.stage else _ratio(scenario, given.frames, given.large))


def _stage(scenario: Any, frames: int) -> bool:
    loop: dict[str, float] = {}
    run.track = _timed_track(loop)  # type: ignore[assignment]
    start_s = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        run.simulate(scenario, Path(folder) / "drive")
    used_s = time.process_time() - start_s
    speed = frames * scenario.simulation.step_s / loop["seconds"]
    print(
        f"{scenario.name}: {frames} frames, {1000 * loop['seconds'] / frames:.1f} ms a frame, "
        f"{1000 * used_s / frames:.1f} of processor with preparation"
    )
    print(f"speed of stage 1       {speed:9.2f} of real time (mark: at least 0.50)")
    return speed >= 0.5


def _ratio(scenario: Any, frames: int, is_large: bool) -> bool:
    bare, whole, sense, memory = BareRays(), Clock(), Cameras.sense, []
    bare.install()

    def timed(cameras: Cameras, instant: Any) -> Any:
        memory.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        is_first = len(memory) == 1  # it loads libraries and draws the sky
        reading = (Clock() if is_first else whole).run(sense, cameras, instant)
        bare.cast_again(not is_first)
        return reading

    Cameras.sense = timed  # type: ignore[method-assign]
    with tempfile.TemporaryDirectory() as folder:
        run.simulate(scenario, Path(folder) / "drive")
    frames = len(memory) - 1
    ours_s, own_s = whole.wall_s, whole.processor_s
    print(
        f"{scenario.name}: {frames} frames, {bare.primary / frames:,.0f} primary and "
        f"{bare.shadow / frames:,.0f} shadow rays a frame"
    )
    print(
        f"camera                 {1000 * ours_s / frames:9.1f} ms a frame, "
        f"{1000 * own_s / frames:.1f} of processor"
    )
    print(
        f"bare casting           {1000 * bare.clock.wall_s / frames:9.1f} ms a frame, "
        f"{1000 * bare.clock.processor_s / frames:.1f} of processor"
    )
    print(
        f"most memory            {memory[-1]:9.0f} MB, "
        f"{memory[-1] - memory[len(memory) // 3]:.0f} MB since a third of the frames"
    )
    ratio = ours_s / bare.clock.wall_s
    print(f"ratio in processor time{own_s / bare.clock.processor_s:9.2f}")
    verdict = "printed only" if is_large else f"mark: at most {MARK}"
    print(f"ratio                  {ratio:9.2f} ({verdict})")
    return is_large or ratio <= MARK


if __name__ == "__main__":
    main()
