"""What a CARLA server really does, point by point of what advpipe relies on: for its first start with one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.scenario.carla import Carla
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.traffic.road_users import RoadUser, boxes_of
from advpipe.stages.simulate.world.carla.blueprints import Blueprints
from advpipe.stages.simulate.world.carla.check_sight import SightCheck
from advpipe.stages.simulate.world.carla.client import VERSION, carla_library, connect
from advpipe.stages.simulate.world.carla.feeds import FIRST_TICKS, Feed
from advpipe.stages.simulate.world.carla.finding import CarlaFinding, finding, require
from advpipe.stages.simulate.world.carla.lidar import RAY_CAST, SEMANTIC, CarlaLidar
from advpipe.stages.simulate.world.carla.mirror import Mirror
from advpipe.stages.simulate.world.carla.poses import pose_of, vector_of
from advpipe.stages.simulate.world.carla.positioning import GNSS, IMU, GnssProjection, specific_force_of
from advpipe.stages.simulate.world.carla.radars import RADAR
from advpipe.stages.simulate.world.carla.session import Session

STEP_S, TICKS = 0.1, 20
ASIDE_M, ASIDE_MPS = 8.0, 1.0
RAYS_ON_GRID_DEG = 0.02
NEEDED = ("server", "map", "synchronous mode", "blueprints", "mirrored vehicles", "sensors start", "frames")
"""Checks whose failure prevents all that follow."""

CALM_MPS2 = 0.5
LIDAR = LidarSensor(
    channels=32,
    points_per_second=320_000,
    upper_fov=5.0,
    lower_fov=-25.0,
    dropoff_general_rate=0.0,
    dropoff_zero_intensity=0.0,
    noise_stddev=0.0,
)


class CarlaCheck:
    """The checks in order; each works on what the one before it has left in the server."""

    def __init__(self, settings: Carla) -> None:
        self._settings = settings
        self._opened = ExitStack()
        self._feeds: dict[str, Feed] = {}
        self._data: dict[str, Any] = {}
        self._lidar, self._sight = CarlaLidar(LIDAR, STEP_S), SightCheck(STEP_S, ASIDE_M)
        self._mounts: dict[str, Float64] = {}

    def run(self) -> list[CarlaFinding]:
        """Run all checks, as far as one failure does not prevent the next; the server is left asynchronous.

        Raises UsageError if CARLA's client is missing.
        """
        carla_library()
        steps = (
            ("server", self._server),
            ("map", self._map),
            ("synchronous mode", self._clock),
            ("blueprints", self._boxes),
            ("mirrored vehicles", self._vehicles),
            ("sensors start", self._sensors),
            ("frames", self._frames),
            ("LiDAR's rays", self._rays),
            ("LiDAR's axes and ids", self._axes),
            ("LiDAR's intensity", self._intensity),
            ("GNSS", self._gnss),
            ("IMU", self._imu),
            ("cameras", self._pictures),
            ("radar", self._radar),
        )
        findings = []
        for name, step in steps:
            findings.append(finding(name, step))
            if not findings[-1].is_good and name in NEEDED:
                break
        findings.append(finding("asynchronous afterwards", self._end))
        return findings

    def _server(self) -> str:
        self._client = connect(self._settings)
        self._world = self._client.get_world()
        return f"CARLA {VERSION} at {self._settings.server}"

    def _map(self) -> str:
        self._carla_map = self._world.get_map()
        lanes, spots = self._carla_map.generate_waypoints(20.0), self._carla_map.get_spawn_points()
        require(bool(lanes) and bool(spots), "the loaded map has no lanes or no spawn points; load another")
        spot = pose_of(spots[0])
        self._place = se3(np.eye(3), spot[:3, 3])
        return f"{self._carla_map.name}, {len(lanes)} points on lanes, {len(spots)} spawn points"

    def _clock(self) -> str:
        self._session = Session(self._client, self._world, STEP_S)
        self._opened.callback(self._session.end)
        self._session.begin()
        begin_s = time.perf_counter()
        for _ in range(TICKS):
            self._session.tick()
        each_ms = 1000 * (time.perf_counter() - begin_s) / TICKS
        return f"{TICKS} steps of {STEP_S} s, frame by frame; {each_ms:.1f} ms each"

    def _boxes(self) -> str:
        variants = draw_variants(named_generator(0, "check"))
        self._variants = {name: one for name, one in variants.items() if name.endswith(".0")}
        self._blueprints = Blueprints(self._world.get_blueprint_library(), self._settings.blueprints)
        self._blueprints.measure(self._client, self._session, self._variants.values())
        chosen = {one.body.name: self._blueprints.choose(one) for one in self._variants.values()}
        missing = [body for body, blueprint in chosen.items() if blueprint is None]
        require(chosen["sedan"] is not None, "the server has no car")
        lacking = f", none for {', '.join(missing)}" if missing else ""
        found = len({name for name in chosen.values() if name})
        return f"{found} for {len(chosen)} bodies, such as {chosen['sedan']}{lacking}"

    def _vehicles(self) -> str:
        """One vehicle, and one eight metres to its right, moved by a metre."""
        self._mirror = Mirror(self._client, self._blueprints, STEP_S)
        self._opened.callback(self._mirror.remove_all)
        self._show(0.0)
        self._session.tick()
        users = self._show(1.0)
        snapshot = self._session.tick()
        state = snapshot.find(self._mirror.actors["check"])
        there = pose_of(state.get_transform()) @ self._mirror.box("check").actor_SE3_base
        off_m = float(np.linalg.norm(there[:3, 3] - users[0].position_m))
        speed_mps = float(np.linalg.norm(vector_of(state.get_velocity())))
        require(off_m < 0.02, f"one tick after a move, the vehicle is {off_m:.2f} m from its place")
        return f"{off_m * 1000:.1f} mm from its place one tick after a move; velocity reads {speed_mps:g} m/s"

    def _sensors(self) -> str:
        carrier = self._world.get_actor(self._mirror.actors["check"])
        base = self._mirror.box("check").actor_SE3_base
        on_board: dict[str, tuple[Float64, Mapping[str, object]]] = {
            **{
                each: (self._lidar.base_SE3_sensor, values) for each, values in self._lidar.attributes.items()
            },
            **dict.fromkeys((GNSS, IMU), (np.eye(4), {})),
            **self._sight.mounts(),
        }
        for blueprint, (mount, attributes) in on_board.items():
            self._mounts[blueprint] = mount
            self._feeds[blueprint] = Feed(
                self._world, carrier, blueprint, blueprint, attributes, base @ mount
            )
            self._opened.callback(self._remove, self._feeds[blueprint])
        ticks: dict[str, int] = {}
        for tick in range(1, FIRST_TICKS + 1):
            self._session.tick()
            silent = [feed for feed in self._feeds.values() if feed.name not in ticks]
            ticks |= {feed.name: tick for feed in silent if feed.has_sent(0.2)}
        silent_names = sorted(self._feeds.keys() - ticks.keys())
        require(not silent_names, f"{', '.join(silent_names)}: nothing after {FIRST_TICKS} ticks")
        return ", ".join(f"{name.partition('.')[2]} after {tick}" for name, tick in ticks.items())

    def _frames(self) -> str:
        users = self._show(1.0)
        for _ in range(5):
            snapshot = self._session.tick()
            self._data = {
                name: feed.take(snapshot.frame, self._settings.timeout_s)
                for name, feed in self._feeds.items()
            }
        off_m = [
            float(np.linalg.norm(pose_of(data.transform)[:3, 3] - self._sensor_place(name, users[0])))
            for name, data in self._data.items()
        ]
        require(max(off_m) < 0.05, f"a sensor measured {max(off_m):.2f} m from its place")
        return f"every sensor sent each of 5 frames, from at most {1000 * max(off_m):.1f} mm off its place"

    def _rays(self) -> str:
        data = self._data["sensor.lidar.ray_cast_semantic"]
        rows = np.frombuffer(data.raw_data, SEMANTIC)
        counts = [data.get_point_count(channel) for channel in range(LIDAR.channels)]
        azimuth = np.rad2deg(np.arctan2(rows["y"].astype(float), rows["x"].astype(float)))
        flat = np.hypot(rows["x"].astype(float), rows["y"].astype(float))
        elevation = np.rad2deg(np.arctan2(rows["z"].astype(float), flat))
        wanted = np.repeat(np.linspace(LIDAR.upper_fov, LIDAR.lower_fov, LIDAR.channels), counts)
        column_deg = 360 / LIDAR.columns
        between = np.abs((azimuth + 180) / column_deg - np.rint((azimuth + 180) / column_deg)) * column_deg
        worst_deg = max(float(between.max(initial=0.0)), float(np.abs(elevation - wanted).max(initial=0.0)))
        require(len(rows) > 0, "the LiDAR hits nothing")
        require(worst_deg < RAYS_ON_GRID_DEG, f"a ray is {worst_deg:.3f} degrees off the expected grid")
        return (
            f"{len(rows)} hits of {LIDAR.channels * LIDAR.columns} rays, at most {worst_deg:.4f} degrees off"
        )

    def _axes(self) -> str:
        """The other vehicle has to be to the right: at negative y in our frame."""
        own, other = (self._mirror.actors[name] for name in ("check", "check.right"))
        truth = self._data["sensor.lidar.ray_cast_semantic"]
        cloud, actors = self._lidar.cloud(self._data["sensor.lidar.ray_cast"], truth, own)
        ids = np.frombuffer(truth.raw_data, SEMANTIC)["id"]
        on_other = cloud[actors == other]
        require(len(on_other) > 0, f"no point has the number of the vehicle {ASIDE_M:g} m to the right")
        middle_m = float(np.mean(on_other["y"]))
        require(-ASIDE_M - 2 < middle_m < -ASIDE_M + 2, f"it is seen at y = {middle_m:.1f} m")
        own_share = np.count_nonzero(ids == own) / len(ids)
        return (
            f"{len(on_other)} points on it, at y = {middle_m:.1f} m; {own_share:.1%} of all on the own body"
        )

    def _intensity(self) -> str:
        rows = np.frombuffer(self._data["sensor.lidar.ray_cast"].raw_data, RAY_CAST)
        range_m = np.sqrt(sum(rows[axis].astype(float) ** 2 for axis in "xyz"))
        model = np.exp(-LIDAR.atmosphere_attenuation_rate * range_m)
        off = float(np.abs(rows["intensity"] - model).max(initial=0.0))
        truth = len(np.frombuffer(self._data["sensor.lidar.ray_cast_semantic"].raw_data, SEMANTIC))
        require(off < 0.01, f"it differs from exp(-a d) by {off:.3f}")
        require(
            abs(len(rows) - truth) <= 0.01 * truth, f"{len(rows)} points, but {truth} hits: some are lost"
        )
        return f"exp(-a d), and none of {truth} hits is lost"

    def _gnss(self) -> str:
        data = self._data[GNSS]
        position_m = GnssProjection(self._carla_map).position_m(data)
        require(position_m is not None, f"{data.latitude}, {data.longitude} is not where the map has it")
        assert position_m is not None
        off_m = float(np.linalg.norm(position_m - vector_of(data.transform.location)))
        return f"{data.latitude:.7f}, {data.longitude:.7f}: {1000 * off_m:.1f} mm from the truth"

    def _imu(self) -> str:
        force = specific_force_of(self._data[IMU])
        require(
            abs(force[2] - 9.81) < CALM_MPS2 and np.hypot(*force[:2]) < CALM_MPS2,
            f"at rest it reads {np.round(force, 2).tolist()} m/s²",
        )
        return f"at rest {force[2]:.2f} m/s² upwards"

    def _pictures(self) -> str:
        own, other = (self._mirror.actors[name] for name in ("check", "check.right"))
        return self._sight.pictures(self._data, own, other, self._show(1.0)[0].map_SE3_base)

    def _radar(self) -> str:
        """While the vehicle moves to the right."""
        for step in (1, 2):
            users = self._show(1.0, -ASIDE_MPS * STEP_S * step)
            frame = self._session.tick().frame
        data = self._feeds[RADAR].take(frame, self._settings.timeout_s)
        own, other = (boxes_of([self._sized(user)]) for user in users)
        return self._sight.hits(data, own, other, users[0].map_SE3_base, np.array([0.0, -ASIDE_MPS, 0.0]))

    def _end(self) -> str:
        self._opened.close()
        if not hasattr(self, "_world"):
            return "there was no connection"
        is_synchronous = self._world.get_settings().synchronous_mode
        require(not is_synchronous, "the server is still synchronous")
        return "yes, and everything is removed"

    def _show(self, ahead_m: float, left_m: float = 0.0) -> list[RoadUser]:
        """The two vehicles, the first one moved."""
        variant = self._variants["sedan.0"]
        users = [
            self._user("check", variant, (ahead_m, left_m)),
            self._user("check.right", variant, (0, -ASIDE_M)),
        ]
        self._mirror.update(users)
        return users

    def _user(self, name: str, variant: Variant, xy_m: tuple[float, float]) -> RoadUser:
        pose = self._place @ se3(np.eye(3), [*xy_m, 0.0])
        return RoadUser(name, replace(variant), pose, np.zeros(3))

    def _sized(self, user: RoadUser) -> RoadUser:
        return replace(user, variant=self._mirror.box(user.id).sized(user.variant))

    def _sensor_place(self, name: str, user: RoadUser) -> Float64:
        place: Float64 = (user.map_SE3_base @ self._mounts[name])[:3, 3]
        return place

    def _remove(self, feed: Feed) -> None:
        import carla

        feed.stop()
        self._client.apply_batch_sync([carla.command.DestroyActor(feed.actor)], False)
