"""The options of one attack that the command line and the scenario file share: default, help and bound."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.core import options
from advpipe.pipeline.core.options import option


@dataclass(frozen=True)
class AttackOptions:
    """What `advpipe attack` takes its options from, and `AttackSpec` of the scenario file its fields.

    It lies apart from `AttackSpec` so that `advpipe --help` need not wait for pydantic. type: by default
    the attack that needs no gradient and so works on any detector; the scenario file names each attack.
    """

    type: str = option("detach", "detach, perturb, attach, cam-..., gnss-..., or module:Class.")
    recipe: str | None = option(
        None,
        "best, robust or paper (as published); random baselines: random, random-near, random-best (the "
        "strongest).",
    )
    victim: str | None = option(None, "Vehicle whose GPS or LiDAR is attacked, or that false CAMs target.")
    dcc_reacts: bool = option(
        False,
        "When a V2X attack fills the channel, other stations' congestion control drops CAMs; "
        "otherwise they send what was recorded.",
    )
    from_s: float = option(0.0, "Start of the attack, in seconds of the recording.")
    to_s: float | None = option(None, "End of the attack, in seconds of the recording.")
    lidar: str | None = options.lidar_topic()
    frames: str = option("::", "Clouds to attack, start:stop:step; the adversarial bag holds only these.")
    detector: str = options.detector()
    device: str = options.device()
    seed: int = option(0, "Seed of the attack's random draws.", least=0)
