"""Artery's configuration, written from the scenario."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.section import CamRules, Radio, V2x

CHANNEL_SPACING_HZ, BAND_HZ = 5e6, 5e9
FIRST_CHANNEL, LAST_CHANNEL = 172, 184
"""Of ITS-G5A and its neighbours, which INET knows in its band of 5 GHz."""

NO_FADING_SHAPE = 1e6
"""Nakagami's m, with which a received power is within 0.02 dB of its mean."""

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
    if found := [*_unsupported_messages(scenario.v2x), *_unsupported_radio(scenario.v2x.radio)]:
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


def _unsupported_radio(radio: Radio) -> Iterator[str]:
    if radio.bandwidth_mhz != 10:
        yield "v2x.radio.bandwidth_mhz other than 10"
    if _channel(radio) is None:
        yield (
            f"v2x.radio.frequency_hz {radio.frequency_hz:g}, which is not the centre of a channel from "
            f"{FIRST_CHANNEL} to {LAST_CHANNEL}"
        )
    if radio.shadowing is not None and radio.shadowing.correlation_distance_m is not None:
        yield "v2x.radio.shadowing.correlation_distance_m"
    for key in ("building_loss", "vehicle_loss"):
        if getattr(radio, key) != "none":
            yield f"v2x.radio.{key}"
    if not radio.interference:
        yield "v2x.radio.interference: false"
    if radio.processing_delay_max_s:
        yield "v2x.radio.processing_delay_max_s"


def write_configuration(
    scenario: Scenario, folder: Path, *, sumo: tuple[str, int], order: int, port: int
) -> None:
    """Write omnetpp.ini and services.xml. sumo: host and port of the server; order: Artery's turn there.

    port: where advpipe listens for the module.
    """
    (folder / "services.xml").write_text(SERVICES, encoding="utf-8")
    v2x, seed = scenario.v2x, scenario.simulation.seed
    mersenne_seed = int(named_generator(seed, "v2x", "artery").integers(1, 2**31))
    lines = [
        "[General]",
        "network = artery.inet.World",
        f"seed-0-mt = {mersenne_seed}",
        "cmdenv-express-mode = true",
        "cmdenv-performance-display = false",
        "cmdenv-status-frequency = 1000000s",
        "**.scalar-recording = false",
        "**.vector-recording = false",
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
        *_radio_lines(v2x.radio),
        *_path_loss_lines(v2x.radio),
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


def _radio_lines(radio: Radio) -> Iterator[str]:
    wlan = "*.node[*].wlan[*]"
    yield f"{wlan}.bitrate = {radio.bitrate_mbps!r}Mbps"
    yield f"{wlan}.radio.channelNumber = {_channel(radio)}"
    yield f"{wlan}.radio.carrierFrequency = {radio.frequency_hz / 1e9!r}GHz"
    yield f"{wlan}.radio.transmitter.power = {10 ** (radio.transmit_power_dbm / 10)!r}mW"
    yield f"{wlan}.radio.receiver.sensitivity = {radio.sensitivity_dbm!r}dBm"
    yield f"{wlan}.radio.receiver.energyDetection = {radio.carrier_sense_dbm!r}dBm"
    yield f"{wlan}.radio.receiver.snirThreshold = {radio.snir_threshold_db!r}dB"
    yield f"{wlan}.radio.receiver.captureThreshold = {radio.capture_threshold_db!r}dB"
    yield f"*.radioMedium.backgroundNoise.power = {radio.noise_dbm!r}dBm"
    yield f"*.node[*].mobility.antennaHeight = {radio.antenna_height_m!r}m"


def _path_loss_lines(radio: Radio) -> Iterator[str]:
    """Free space alone is INET's; every other combination is a case of Artery's Nakagami model."""
    if (radio.path_loss, radio.shadowing, radio.fading) == ("free_space", None, "none"):
        yield '*.radioMedium.pathLossType = "FreeSpacePathLoss"'
        return
    near, far = radio.near_exponent, radio.far_exponent
    if radio.path_loss == "free_space":
        near = far = 2.0
    shadowing = radio.shadowing
    near_db, far_db = (shadowing.near_stddev_db, shadowing.far_stddev_db) if shadowing else (0.0, 0.0)
    loss = "*.radioMedium.pathLoss"
    yield '*.radioMedium.pathLossType = "VanetNakagamiFading"'
    yield f"{loss}.criticalDistance = {radio.critical_distance_m!r}m"
    yield f"{loss}.gamma1 = {near!r}"
    yield f"{loss}.gamma2 = {far!r}"
    yield f"{loss}.sigma1 = {near_db!r}dB"
    yield f"{loss}.sigma2 = {far_db!r}dB"
    if radio.fading == "none":
        yield f'{loss}.shapes = xml("<shapes default=\\"{NO_FADING_SHAPE:g}\\" />")'


def _channel(radio: Radio) -> int | None:
    """The number of the channel with this centre; None if there is none."""
    number = (radio.frequency_hz - BAND_HZ) / CHANNEL_SPACING_HZ
    if number != round(number) or not FIRST_CHANNEL <= number <= LAST_CHANNEL:
        return None
    return int(number)
