"""Traffic by SUMO: vehicles that drive themselves, and the instrumented ones among them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from xml.sax.saxutils import quoteattr

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.simulate.network import Edge, RoadNetwork, endless_edges
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.world.bodies import Variant

SPAWN_DISTANCE_M = 150.0
"""Vehicles that fill up the traffic appear at least this far from every instrumented vehicle."""

INSERTION_LIMIT_S = 120.0


class Traffic:
    """The SUMO simulation of one scenario; a context manager, since only one can run in a process.

    Every vehicle follows a random walk over the network that outlasts the recording, so that none
    vanishes in sight unless its road ends. Lanes are divided laterally, so that a lane change is a
    drive across and not a jump.
    """

    def __init__(
        self, scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant], scratch: Path
    ) -> None:
        self._scenario = scenario
        self._network = network
        self._variants = variants
        self._scratch = scratch
        self._rng = named_generator(scenario.simulation.seed, "traffic")
        self._edges = network.drivable
        lengths_m = np.array([edge.length_m * len(edge.lanes) for edge in self._edges])
        self._shares = lengths_m / lengths_m.sum()
        self._endless = endless_edges(self._edges)
        self._added = 0

    def __enter__(self) -> Traffic:
        import libsumo

        types = self._scratch / "vehicle_types.add.xml"
        types.write_text(_vehicle_types(self._variants), encoding="utf-8")
        simulation = self._scenario.simulation
        command = ["sumo", "--net-file", str(self._network.sumo_file), "--additional-files", str(types)]
        command += ["--seed", str(simulation.seed % 2**31), "--step-length", str(simulation.step_s)]
        command += ["--lateral-resolution", "0.8", "--time-to-teleport", "-1", "--collision.action", "none"]
        command += ["--no-step-log", "--no-warnings", "--default.speeddev", "0.1", "--max-depart-delay", "60"]
        with _sumo_errors():
            libsumo.start(command)
        try:
            with _sumo_errors():
                for name, vehicle in self._scenario.vehicles.items():
                    self._add(name, f"{vehicle.body}.0", self._random_wide_edge())
                self._fill_up(near_is_fine=True)
                self._warm_up()
        except BaseException:
            libsumo.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        import libsumo

        libsumo.close()

    def step(self) -> None:
        """Advances SUMO by one step and replaces vehicles whose road has ended."""
        import libsumo

        with _sumo_errors():
            libsumo.simulationStep()
            self._fill_up(near_is_fine=False)

    def road_users(self) -> dict[str, RoadUser]:
        """Every vehicle that is on the road now, by id."""
        import libsumo

        vehicle = libsumo.vehicle
        users = {}
        for name in sorted(vehicle.getIDList()):
            variant = self._variants[vehicle.getTypeID(name)]
            front_m = np.array(vehicle.getPosition3D(name)) - self._network.offset_m
            yaw_rad = np.deg2rad(90.0 - vehicle.getAngle(name))
            pitch_rad = -np.deg2rad(vehicle.getSlope(name))
            pose = se3_from_yaw(front_m, yaw_rad, pitch_rad)
            pose[:3, 3] -= pose[:3, 0] * variant.length_m / 2  # SUMO's reference point is the front bumper
            users[name] = RoadUser(name, variant, pose, pose[:3, 0] * vehicle.getSpeed(name))
        return users

    def route_m(self, name: str) -> Float64:
        """The middle of the road along a vehicle's whole route (K, 3)."""
        import libsumo

        edges = [self._network.edges[edge] for edge in libsumo.vehicle.getRoute(name)]
        return np.concatenate([edge.lanes[0].centre_m for edge in edges])

    def _warm_up(self) -> None:
        import libsumo

        simulation = self._scenario.simulation
        waited_s = 0.0
        while waited_s < simulation.warmup_s or not set(self._scenario.vehicles) <= set(
            libsumo.vehicle.getIDList()
        ):
            if waited_s > simulation.warmup_s + INSERTION_LIMIT_S:
                raise AdvpipeError(
                    f"no room on the network for {', '.join(self._scenario.vehicles)} within "
                    f"{INSERTION_LIMIT_S:g} s; lower traffic.vehicles"
                )
            libsumo.simulationStep()
            waited_s += simulation.step_s
        self._fill_up(near_is_fine=True)

    def _fill_up(self, *, near_is_fine: bool) -> None:
        import libsumo

        present = libsumo.vehicle.getLoadedIDList()
        missing = self._scenario.traffic.vehicles + len(self._scenario.vehicles) - len(present)
        if missing <= 0:
            return
        carriers = [name for name in self._scenario.vehicles if name in present]
        positions = (
            [np.array(libsumo.vehicle.getPosition(name)) for name in carriers] if not near_is_fine else []
        )
        mix = self._scenario.traffic.mix
        shares = np.array(list(mix.values())) / sum(mix.values())
        for _ in range(missing):
            body = list(mix)[int(self._rng.choice(len(shares), p=shares))]
            names = [name for name in self._variants if name.startswith(f"{body}.")]
            variant = names[int(self._rng.integers(len(names)))]
            edge = self._random_edge()
            middle_m = (edge.lanes[0].centre_m.mean(axis=0) + self._network.offset_m)[:2]
            if all(
                np.linalg.norm(middle_m - place) > SPAWN_DISTANCE_M + edge.length_m / 2 for place in positions
            ):
                self._added += 1
                self._add(f"{body}.{self._added}", variant, edge)

    def _random_wide_edge(self) -> Edge:
        """One of the roads with the most lanes, where there is most to see, and no dead end."""
        lasting = np.array([edge.id in self._endless or not self._endless for edge in self._edges])
        lanes = np.array([len(edge.lanes) for edge in self._edges])
        shares = self._shares * lasting * (lanes == lanes[lasting].max())
        return self._edges[int(self._rng.choice(len(shares), p=shares / shares.sum()))]

    def _random_edge(self) -> Edge:
        return self._edges[int(self._rng.choice(len(self._edges), p=self._shares))]

    def _add(self, name: str, variant: str, start: Edge) -> None:
        import libsumo

        simulation = self._scenario.simulation
        fastest_mps = max(edge.speed_mps for edge in self._edges)
        enough_m = 1.2 * fastest_mps * (simulation.warmup_s + simulation.duration_s) + 500.0
        route = self._random_walk(start, enough_m)
        libsumo.route.add(f"route.{name}", route)
        libsumo.vehicle.add(
            name,
            f"route.{name}",
            typeID=variant,
            departLane="random",
            departPos="random_free",
            departSpeed="0",
        )
        if name in self._scenario.vehicles:
            last = self._network.edges[route[-1]]
            stop_m = max(last.length_m - 1.0, 0.5 * last.length_m)
            # It outlives its road.
            libsumo.vehicle.setStop(name, last.id, pos=stop_m, laneIndex=last.car_lane, duration=1e6)

    def _random_walk(self, start: Edge, length_m: float) -> list[str]:
        """Edges from `start` on until they are long enough or end; turns back only where it must."""
        route, walked_m = [start.id], start.length_m
        while walked_m < length_m:
            here = self._network.edges[route[-1]]
            lasting = [edge for edge in here.successors if edge in self._endless] or list(here.successors)
            onward = [edge for edge in lasting if not self._returns(here, self._network.edges[edge])]
            choices = onward or lasting
            if not choices:
                break
            route.append(choices[int(self._rng.integers(len(choices)))])
            walked_m += self._network.edges[route[-1]].length_m
        return route

    @staticmethod
    def _returns(here: Edge, there: Edge) -> bool:
        start, end = here.lanes[0].centre_m[0, :2], there.lanes[0].centre_m[-1, :2]
        return bool(np.linalg.norm(start - end) < 2 * here.width_m + 6.0)


@contextmanager
def _sumo_errors() -> Iterator[None]:
    """What SUMO refuses, in one line of ours."""
    import libsumo

    try:
        yield
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise AdvpipeError(f"SUMO cannot go on with this network or traffic: {error}") from None


def _vehicle_types(variants: dict[str, Variant]) -> str:
    """SUMO vehicle types, one for each variant."""
    lines = []
    for name, variant in variants.items():
        body = variant.body
        if body.label == "pedestrian":
            continue
        attributes = {
            "id": name,
            "vClass": "passenger",  # bodies differ in size and speed; who may use a lane is the road's matter
            "length": variant.length_m,
            "width": variant.width_m,
            "height": variant.height_m,
            "maxSpeed": body.max_speed_mps,
            "accel": body.acceleration_mps2,
            "latAlignment": "right" if body.label == "cyclist" else "center",
            "minGapLat": 0.4,
        }
        text = " ".join(f"{key}={quoteattr(str(value))}" for key, value in attributes.items())
        lines.append(f"  <vType {text}/>")
    return "<additional>\n" + "\n".join(lines) + "\n</additional>\n"
