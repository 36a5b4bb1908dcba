"""Estimates the steps and the disk space of a scenario before it is simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from advpipe.pipeline.scenario.models import Scenario

MOST_BYTES = 10e12
"""Largest recording before compression: a day of a 64-channel LiDAR takes 2 TB; 10 TB fill a large disk."""

MOST_STEPS = 20_000_000
"""Most steps of a drive: eleven days at 20 Hz, which take weeks to compute."""

STEP_BYTES = 4000
"""Bytes of the other messages of a vehicle in one step: odometry, transforms, ground truth."""


def check_size(scenario: Scenario) -> None:
    """Raise ValueError, with the estimate, if a drive would take too many steps or too much disk space."""
    clock = scenario.simulation
    steps = round((clock.warmup_s + clock.duration_s) / clock.step_s)
    if steps > MOST_STEPS:
        raise ValueError(
            f"the drive would take {steps:,} steps, over {MOST_STEPS:,}; "
            "lower simulation.duration_s or raise simulation.step_s"
        )
    if (size_bytes := estimated_bytes(scenario)) > MOST_BYTES:
        raise ValueError(
            f"the recording would take about {size_bytes / 1e12:,.0f} TB, over {MOST_BYTES / 1e12:g} TB; "
            "lower simulation.duration_s, points_per_second or the rates of sensors"
        )


def estimated_bytes(scenario: Scenario) -> float:
    """The estimated size in bytes of the recording before compression."""
    clock = scenario.simulation
    sensor_bytes_per_s = sum(
        sensor.bytes_per_s(section)
        for vehicle in scenario.vehicles
        for sensor, sections in scenario.sensors.carried_by(vehicle)
        for section in sections.values()
    )
    step_bytes_per_s = len(scenario.vehicles) * STEP_BYTES / clock.step_s
    return clock.duration_s * (sensor_bytes_per_s + step_bytes_per_s)
