"""The radio of a scenario in Artery: what it lacks, and the lines of its configuration."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.section import Radio

CHANNEL_SPACING_HZ, BAND_HZ = 5e6, 5e9
FIRST_CHANNEL, LAST_CHANNEL = 172, 184
"""Of ITS-G5A and its neighbours, which INET knows in its band of 5 GHz."""

NO_FADING_SHAPE = 1e6
"""Nakagami's m, with which a received power is within 0.02 dB of its mean."""

GENERAL = (
    "cmdenv-express-mode = true",
    "cmdenv-performance-display = false",
    "cmdenv-status-frequency = 1000000s",
    "**.scalar-recording = false",
    "**.vector-recording = false",
)


def seed_line(seed: int) -> str:
    """The seed of OMNeT++'s random numbers, from the drive's."""
    return f"seed-0-mt = {int(named_generator(seed, 'v2x', 'artery').integers(1, 2**31))}"


def unsupported(radio: Radio) -> Iterator[str]:
    """What Artery cannot simulate as asked, by its key."""
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


def radio_lines(radio: Radio) -> Iterator[str]:
    """The lines of omnetpp.ini that give each station's radio, and the medium, these settings."""
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
    yield from _path_loss_lines(radio)


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
