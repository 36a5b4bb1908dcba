"""Artery's configuration, written from the scenario."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from advpipe.pipeline.artery.radio import GENERAL, radio_lines, seed_line, unsupported
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.section import CamRules, V2x

SERVICES = """<?xml version="1.0" encoding="UTF-8"?>
<services>
  <service type="artery.application.CaService" name="CA"><listener port="2001" /></service>
</services>
"""

DCC_ENTITY = {"none": "NoRateControlDccEntity", "reactive": "FsmDccEntity", "adaptive": "LimericDccEntity"}


def check_supported(scenario: Scenario) -> None:
    """Raise UsageError, one line with everything that it names, for what Artery cannot simulate as asked."""
    if scenario.traffic.source != "sumo":
        raise UsageError(
            f"v2x.network artery needs SUMO, which it steps, but traffic.source is {scenario.traffic.source}"
        )
    if found := [*_unsupported_messages(scenario.v2x), *unsupported(scenario.v2x.radio)]:
        raise UsageError(f"v2x.network artery cannot do {'; '.join(found)}; change it, or use embedded")


def _unsupported_messages(v2x: V2x) -> Iterator[str]:
    for key in ("cpm", "denm", "pseudonyms"):
        if getattr(v2x, key) is not None:
            yield f"v2x.{key}"
    if v2x.security != "none":
        yield f"v2x.security: {v2x.security}"
    if v2x.clock_error_s:
        yield "v2x.clock_error_s"
    if v2x.cam.low_dynamics_cams != CamRules().low_dynamics_cams:
        yield "v2x.cam.low_dynamics_cams"
    if v2x.cam.low_frequency_interval_s != CamRules().low_frequency_interval_s:
        yield "v2x.cam.low_frequency_interval_s"


def write_configuration(
    scenario: Scenario, folder: Path, *, sumo: tuple[str, int], order: int, port: int
) -> None:
    """Write omnetpp.ini and services.xml. sumo: host and port of the server; order: Artery's turn there.

    port: where advpipe listens for the module.
    """
    (folder / "services.xml").write_text(SERVICES, encoding="utf-8")
    v2x = scenario.v2x
    lines = [
        "[General]",
        "network = artery.inet.World",
        seed_line(scenario.simulation.seed),
        *GENERAL,
        "*.traci.core.version = -1",
        "*.traci.core.selfStopping = false",
        '*.traci.launcher.typename = "advpipe.PatientLauncher"',
        f'*.traci.launcher.hostname = "{sumo[0]}"',
        f"*.traci.launcher.port = {sumo[1]}",
        f"*.traci.launcher.clientId = {order}",
        '*.traci.nodes.typename = "advpipe.NodeManager"',
        f"*.traci.nodes.port = {port}",
        '*.node[*].middleware.services = xmldoc("services.xml")',
        "*.node[*].middleware.datetime = advpipe_date()",
        "*.node[*].vanetza[*].router.disableBeaconing = true",
        *_cam_lines(v2x.cam),
        f"*.node[*].mobility.antennaHeight = {v2x.radio.antenna_height_m!r}m",
        *radio_lines(v2x.radio),
    ]
    (folder / "omnetpp.ini").write_text("\n".join([*lines, ""]), encoding="utf-8")


def _cam_lines(cam: CamRules) -> Iterator[str]:
    service = "*.node[*].middleware.CA"
    yield f"{service}.minInterval = {cam.min_interval_s!r}s"
    yield f"{service}.maxInterval = {cam.max_interval_s!r}s"
    yield f"{service}.headingDelta = {cam.heading_deg!r}"
    yield f"{service}.positionDelta = {cam.position_m!r}m"
    yield f"{service}.speedDelta = {cam.speed_mps!r}mps"
    yield f"{service}.pathHistoryLength = {cam.path_points}"
    yield f"{service}.withDccRestriction = {'false' if cam.dcc == 'none' else 'true'}"
    yield f'*.node[*].vanetza[*].dcc.typename = "{DCC_ENTITY[cam.dcc]}"'
