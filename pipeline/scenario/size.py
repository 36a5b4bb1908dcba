"""What a scenario's numbers come to together, estimated before anything starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from advpipe.pipeline.scenario.models import Scenario

MOST_BYTES = 10e12
"""Of a recording before compression: a day of a 64-channel LiDAR takes 2 TB, and 10 fill a large disk."""

MOST_STEPS = 20_000_000
"""Of a drive: eleven days at 20 Hz; computing them takes weeks."""

STEP_BYTES = 4000
"""Of one vehicle's other messages in a step: odometry, transforms, ground truth."""


def check_size(scenario: Scenario) -> None:
    """ValueError, with the estimate, where a drive would take more steps or disk than there is."""
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
    """Of the recording before compression, by its sensors and steps."""
    clock = scenario.simulation
    of_sensors_per_s = sum(
        kind.bytes_per_s(section)
        for vehicle in scenario.vehicles
        for kind, sections in scenario.sensors.carried_by(vehicle)
        for section in sections.values()
    )
    of_steps_per_s = len(scenario.vehicles) * STEP_BYTES / clock.step_s
    return clock.duration_s * (of_sensors_per_s + of_steps_per_s)
