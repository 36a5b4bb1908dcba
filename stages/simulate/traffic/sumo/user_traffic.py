"""User-supplied traffic: route files and .sumocfg, checked before SUMO loads them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_network.file import check_xml, last_error, run_sumo
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.sumo.demand import check_demand, seconds
from advpipe.stages.simulate.traffic.sumo.routes import Routes
from advpipe.stages.simulate.traffic.sumo.vehicle_types import BODIES_OF_CLASS

ROUTE_FILE = "a SUMO route file (.rou.xml)"
ADDITIONAL_FILE = "a SUMO additional file (.add.xml)"
MOST_FILES = 100
LATEST_S = 1e9
"""Latest begin: SUMO counts milliseconds, and no real drive begins later."""

MAX_WAIT_S = 120.0
"""Longest wait for room on the network beyond the warm-up, as in `SumoTraffic`."""

RESERVED_NAMES = ("pedestrian", "parked")
"""Names of pedestrians and parked cars begin with these, as in `parked.7`."""

DEFAULT_TYPES = {"DEFAULT_VEHTYPE", "DEFAULT_TAXITYPE", "DEFAULT_BIKETYPE"}


@dataclass(frozen=True)
class UserTraffic:
    """SUMO's input besides its network; `is_user_supplied` if the user wrote it."""

    route_files: tuple[Path, ...] = ()
    additional_files: tuple[Path, ...] = ()
    begin_s: float = 0.0

    @property
    def is_user_supplied(self) -> bool:
        """Whether there are any files of the user."""
        return bool(self.route_files or self.additional_files)

    def options(self, types: Path) -> list[str]:
        """Command-line options of SUMO, with our own vehicle types before the user's files."""
        command = ["--additional-files", ",".join(map(str, (types, *self.additional_files)))]
        command += ["--begin", str(self.begin_s)]
        if self.route_files:  # 0: SUMO reads all routes at its start, and reports an invalid one there
            command += ["--route-files", ",".join(map(str, self.route_files)), "--route-steps", "0"]
        return command


def user_traffic(
    scenario: Scenario, network: RoadNetwork, routes: Routes, types: Path, moved: Collection[str] = ()
) -> UserTraffic:
    """The user's traffic of a scenario, if it names any; departures count from the warm-up's start.

    Only the route files, additional files and begin of a .sumocfg are used; the network is the scenario's.
    moved: ids in the table of trajectories.
    Raises AdvpipeError for a missing or invalid file, an unknown edge or type, roads that do not
    connect, a vehicle class without a body, and anything else that SUMO rejects.
    """
    if scenario.traffic.sumo_config is not None:
        own = _configured(Path(scenario.traffic.sumo_config))
    elif scenario.traffic.routes is not None:
        own = UserTraffic(route_files=(Path(scenario.traffic.routes),))
    else:
        return UserTraffic()
    key = "traffic.routes" if scenario.traffic.routes is not None else "traffic.sumo_config"
    roots = list(_roots(own, key))
    clock = scenario.simulation
    last_s = own.begin_s + clock.warmup_s + MAX_WAIT_S + clock.duration_s
    check_demand([root for _, root in roots], key, last_s)
    known = DEFAULT_TYPES | {str(root.get("id")) for root in ElementTree.parse(types).getroot()}
    for path, root in roots:
        known |= set(_types(root, f"{key}: {path}"))
    for path, root in roots:
        _check(root, f"{key}: {path}", scenario, routes, known, moved)
    _load_in_sumo(key, own.options(types), network)
    return own


def _roots(own: UserTraffic, key: str) -> Iterator[tuple[Path, ElementTree.Element]]:
    """Every file of the user, and the files that they include."""
    waiting = [(path, ROUTE_FILE) for path in own.route_files]
    waiting += [(path, ADDITIONAL_FILE) for path in own.additional_files]
    for count, (path, description) in enumerate(waiting, 1):
        if count > MOST_FILES:
            raise AdvpipeError(f"{key}: {path} is one of more than {MOST_FILES} files, or includes itself")
        root = check_xml(path, key, ("routes", "additional"), description)
        yield path, root
        waiting += [(path.parent / str(found.get("href")), description) for found in root.iter("include")]


def _configured(path: Path) -> UserTraffic:
    root = check_xml(path, "traffic.sumo_config", ("configuration", "sumoConfiguration"), "a .sumocfg file")

    def files(*names: str) -> tuple[Path, ...]:
        values = [found.get("value", "") for name in names for found in root.iter(name)]
        names_ = [part.strip() for value in values for part in value.split(",") if part.strip()]
        return tuple(path.parent / name for name in names_)

    route_files = files("route-files", "r")
    if not route_files:
        raise AdvpipeError(f"traffic.sumo_config: {path} names no route-files")
    begin = next((found.get("value", "0") for name in ("begin", "b") for found in root.iter(name)), "0")
    begin_s = seconds(begin, math.nan)
    if not 0 <= begin_s <= LATEST_S:
        raise AdvpipeError(
            f"traffic.sumo_config: {path}: begin {short_repr(begin)} is not in seconds, 0 to {LATEST_S:g}"
        )
    return UserTraffic(route_files, files("additional-files", "a"), begin_s)


def _types(root: ElementTree.Element, where: str) -> Iterator[str]:
    for found in root.iter("vType"):
        vclass = found.get("vClass", "passenger")
        if vclass not in BODIES_OF_CLASS:
            known = ", ".join(BODIES_OF_CLASS)
            raise AdvpipeError(
                f"{where}: vType {found.get('id')!r} has vClass {vclass!r}, for which there is no body; "
                f"known: {known}"
            )
        yield str(found.get("id"))
    for found in root.iter("vTypeDistribution"):
        yield str(found.get("id"))


def _check(
    root: ElementTree.Element,
    where: str,
    scenario: Scenario,
    routes: Routes,
    known: set[str],
    moved: Collection[str],
) -> None:
    for found in root.iter():
        name = f"{where}: {found.tag} {found.get('id', '')!r}"
        if found.tag == "route" and found.get("edges") is not None:
            routes.checked(str(found.get("edges")).split(), name)
        if found.tag in ("trip", "flow"):
            ends = [found.get("from"), *str(found.get("via", "")).split(), found.get("to")]
            for edge in filter(None, ends):
                routes.checked([edge], name)
        if found.tag in ("vehicle", "trip", "flow"):
            if found.get("type", "DEFAULT_VEHTYPE") not in known:
                raise AdvpipeError(f"{name}: no vType {found.get('type')!r} is defined")
            if found.get("id") in scenario.vehicles:
                raise AdvpipeError(f"{name} has the name of an instrumented vehicle; rename one of them")
            if found.get("id") in moved or (found.tag == "flow" and _may_create(str(found.get("id")), moved)):
                raise AdvpipeError(f"{name} has the name of one in trajectories.file; rename one of them")
            if str(found.get("id")).partition(".")[0] in RESERVED_NAMES:
                raise AdvpipeError(f"{name} has a reserved name; rename it")
        if found.tag in ("person", "personFlow", "container", "containerFlow"):
            raise AdvpipeError(
                f"{name}: only vehicles are supported; set the number of people in traffic.pedestrians"
            )


def _may_create(flow: str, names: Collection[str]) -> bool:
    """Whether a flow may create a vehicle, such as `flow.3`, with one of the names."""
    return any(name.rpartition(".")[0] == flow and name.rpartition(".")[2].isdigit() for name in names)


def _load_in_sumo(key: str, options: Sequence[str], network: RoadNetwork) -> None:
    """Let SUMO load everything in a separate process, whose error messages can be captured."""
    command = ["--net-file", str(network.sumo_file), *options]
    begin_s = float(options[options.index("--begin") + 1])
    command += ["--end", str(begin_s + 1.0), "--no-step-log", "--no-warnings"]
    done = run_sumo("sumo", command, key)
    if done.returncode != 0:
        raise AdvpipeError(f"{key}: SUMO rejects it: {last_error(done)}")
