"""The interface of radars to the rest of advpipe: scenario section, topics and panels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, wrap_angle
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.radar.section import MOST_RADAR_RAYS, RadarSensor
from advpipe.pipeline.sensors.sensor import Cadence, DriveSettings, Instant, MountedSensor, Panel, Reading
from advpipe.pipeline.sensors.world import Offer, RadarSurroundings

RETURN_BYTES = 20 + 24


class Radars(MountedSensor[RadarSensor]):
    """All radars of one vehicle."""

    title = "radar"
    section = RadarSensor
    needs = frozenset({"road users", "rays"})

    def __init__(self, vehicle: str, sections: Mapping[str, RadarSensor], drive: DriveSettings) -> None:
        from advpipe.pipeline.sensors.radar.radar import Radar

        self._vehicle, self._drive = vehicle, drive
        self._steps = {name: _steps(section, drive.step_s) for name, section in sections.items()}
        self._radars = {
            name: Radar(section, self._steps[name] * drive.step_s, drive.weather)
            for name, section in sections.items()
        }
        self._yaws: dict[str, tuple[int, dict[str, float]]] = {}
        self.mounts = {name: radar.base_SE3_radar for name, radar in self._radars.items()}

    def sense(self, instant: Instant) -> Reading:
        messages: list[StampedCdr] = []
        seen: set[str] = set()
        for name in self._radars:
            if instant.frame % self._steps[name] == 0:
                found, in_range = self._scan(name, instant)
                messages += found
                seen |= in_range
        return Reading(messages, road_users=sorted(seen))

    def _scan(self, name: str, instant: Instant) -> tuple[list[StampedCdr], set[str]]:
        from advpipe.pipeline.messages.radar import radar_cloud_to_cdr, scan_to_cdr

        radar, world = self._radars[name], instant.world
        users = world.road_users(radar.section.range)
        if isinstance(world, RadarSurroundings):
            returns = radar.returns_of_hits(world.radar_hits(name, radar.velocity_mps(instant.motion)))
        else:
            returns = self._returns(name, instant, users)
        frame_id, stamp_ns = VehicleTopics(self._vehicle).sensor_frame(name), instant.stamp_ns
        scan, points = self.topics(self._vehicle, name)
        messages = [
            (scan, scan_to_cdr(returns, stamp_ns, frame_id), stamp_ns),
            (points, radar_cloud_to_cdr(returns, radar.rcs_dbsm(returns), stamp_ns, frame_id), stamp_ns),
        ]
        return messages, set(users.ids)

    def _returns(self, name: str, instant: Instant, users: Boxes) -> RadarReturns:
        from advpipe.pipeline.core.seeding import named_generator
        from advpipe.pipeline.geometry.transforms import invert

        radar, motion = self._radars[name], instant.motion
        rng = named_generator(self._drive.seed, "radar", self._vehicle, name, instant.frame)
        map_SE3_radar = motion.map_SE3_base @ radar.base_SE3_radar
        boxes = users.transformed(invert(map_SE3_radar))
        aim = radar.aim(boxes, rng)
        rays = np.empty((len(aim.directions), 6), np.float32)
        rays[:, :3] = map_SE3_radar[:3, 3]
        rays[:, 3:] = aim.directions @ map_SE3_radar[:3, :3].T
        hits = instant.world.cast(rays, radar.section.range)
        turn_rate = self._turn_rates_radps(name, users, instant.stamp_ns)
        scatterers = radar.scatterers(aim, hits, boxes, turn_rate, rng)
        return radar.measure(scatterers, radar.velocity_mps(motion), rng)

    def _turn_rates_radps(self, name: str, users: Boxes, stamp_ns: int) -> Float64:
        """Turn rate (M,) of each road user since the last scan; 0 for a new one."""
        last_ns, last = self._yaws.get(name, (stamp_ns, {}))
        yaws = dict(zip(users.ids, users.geometry[:, 6].tolist(), strict=True))
        self._yaws[name] = stamp_ns, yaws
        if stamp_ns <= last_ns:
            return np.zeros(len(users))
        turned = wrap_angle([yaw - last.get(user, yaw) for user, yaw in yaws.items()])
        return np.asarray(turned / ((stamp_ns - last_ns) / 1e9))

    @classmethod
    def missing_from(cls, offers: frozenset[Offer]) -> list[Offer]:
        """A world's own radars replace rays."""
        return super().missing_from(offers | {"rays"} if "radar hits" in offers else offers)

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        own = VehicleTopics(vehicle)
        return own.radar_scan(name), own.radar_points(name)

    @classmethod
    def panels(cls, vehicle: str, name: str) -> Mapping[str, Panel]:
        return {VehicleTopics(vehicle).radar_points(name).name: RADAR_PANEL}

    @classmethod
    def check(cls, sections: Mapping[str, RadarSensor], step_s: float) -> None:
        for name, section in sections.items():
            steps = section.sensor_tick / step_s
            if section.sensor_tick and (round(steps) < 1 or abs(steps - round(steps)) > 1e-6):
                raise ValueError(
                    f"sensors.radars.{name}.sensor_tick {section.sensor_tick:g} s is not a multiple of "
                    f"simulation.step_s {step_s:g} s; change one of them"
                )
            rays = section.points_per_second * _steps(section, step_s) * step_s
            if rays > MOST_RADAR_RAYS:
                raise ValueError(
                    f"a scan of sensors.radars.{name} has {rays:,.0f} rays, over {MOST_RADAR_RAYS:,}; lower "
                    "points_per_second"
                )

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, RadarSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        found: dict[str, Cadence] = {}
        for name, section in sections.items():
            steps = _steps(section, step_s)
            found |= {each.name: Cadence(1 / step_s / steps, steps) for each in cls.topics(vehicle, name)}
        return found

    @classmethod
    def bytes_per_s(cls, section: RadarSensor) -> float:
        return section.max_returns * RETURN_BYTES / (section.sensor_tick or 0.1)


def _steps(section: RadarSensor, step_s: float) -> int:
    """Steps of the simulation from scan to scan."""
    return max(round(section.sensor_tick / step_s), 1)


RADAR_PANEL = Panel(
    foxglove={"colorMode": "colormap", "colorMap": "turbo", "colorField": "velocity", "pointSize": 8},
    rviz="PointCloud2",
    rviz_keys={
        "Style": "Boxes",
        "Size (m)": 0.3,
        "Color Transformer": "Intensity",
        "Channel Name": "velocity",
        "Autocompute Intensity Bounds": True,
        "Use rainbow": True,
    },
)
"""The panel of radar returns: their velocities as colours."""
