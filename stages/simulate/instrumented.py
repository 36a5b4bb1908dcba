"""A vehicle that carries sensors: LiDARs that look around, and localisation on board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.measurements import InitialPose
from advpipe.pipeline.localisation.onboard import OnBoard, OnBoardStep
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.sensors.lidar.rig import Rig, View
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.world import World


@dataclass(frozen=True)
class Snapshot:
    """What one instrumented vehicle knows at one instant, and the truth.

    initial: with the first snapshot only, where its filter started. view: None between two turns.
    """

    vehicle: str
    initial: InitialPose | None
    onboard: OnBoardStep
    view: View | None


class Instrumented:
    """All sensors of one vehicle."""

    def __init__(self, scenario: Scenario, name: str) -> None:
        self.name = name
        self.rig = Rig(scenario, name)
        origin, clock = scenario.map.origin, scenario.simulation
        geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._onboard = OnBoard(name, scenario.sensors, geodesy, clock.step_s, clock.seed)
        self._started = False

    def sense(
        self, stamp_ns: int, frame: int, carrier: RoadUser, users: Sequence[RoadUser], world: World
    ) -> Snapshot:
        """Everything that it senses in one step, among all road users that move."""
        onboard = self._onboard.step(stamp_ns, carrier.map_SE3_base, carrier.velocity_mps)
        initial = None if self._started else self._onboard.initial
        self._started = True
        return Snapshot(
            self.name, initial, onboard, self.rig.look(world, users, carrier, onboard.truth, frame)
        )
