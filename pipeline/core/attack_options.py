"""The options of one attack that the command line and the scenario file share: default, help and bound."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.core import options
from advpipe.pipeline.core.options import option


@dataclass(frozen=True)
class AttackOptions:
    """The options of `advpipe attack`, from which `AttackSpec` of the scenario file takes its fields.

    The class is separate from `AttackSpec` so that `advpipe --help` does not load pydantic. type: the default
    attack needs no gradient and so works on any detector; in the scenario file, every attack must be named.
    """

    type: str = option(
        "detach", "detach, perturb, attach, cam-..., gnss-..., camera-..., radar-..., or module:Class."
    )
    recipe: str | None = option(
        None,
        "best, hide, robust, stealthy, transfer or paper (as published); black boxes: score-based, "
        "decision-based; random baselines: random, random-near, random-best (the strongest).",
    )
    victim: str | None = option(
        None,
        "Vehicle whose sensors are attacked (GPS, LiDAR, cameras, radars), or that false messages target.",
    )
    dcc_reacts: bool = option(
        False,
        "When a V2X attack loads the channel, the congestion control of the other stations drops CAMs; "
        "without this option they send what was recorded.",
    )
    credentials: str = option(
        "ticket",
        "What V2X attackers sign with, where a drive is signed: ticket (an insider), or as outsiders none, "
        "untrusted, expired or stolen (a certificate without its key).",
    )
    network: str = option(
        "embedded",
        "The radio that sends the messages of a V2X or GPS attack: embedded (ours, with the settings of the "
        "recording) or artery (docs/artery.md).",
    )
    from_s: float = option(0.0, "Start of the attack, in seconds since the start of the recording.")
    to_s: float | None = option(None, "End of the attack, in seconds since the start of the recording.")
    lidar: str | None = options.lidar_topic()
    frames: str = option("::", "Clouds to attack, start:stop:step; the adversarial bag holds only these.")
    detector: str = option(
        "small",
        "small, pointpillars, centerpoint, a .safetensors file, or module:Class; several joined by commas "
        "are an ensemble, attacked together.",
    )
    device: str = options.device()
    lidar_height_m: float | None = options.lidar_height_m()
    level: bool = options.level()
    scale_intensity: float = options.scale_intensity()
    debug: bool = option(
        True,
        "Add topics under /advpipe/debug with the touched points and false positions, for viewers; they give "
        "the attack away to whoever gets the bag.",
    )
    seed: int = option(0, "Seed of the attack's random draws.", least=0)
