"""What tuning found for both detectors, written by `benchmarks/misbehaviour.py --ship`."""

from __future__ import annotations

DRIVES = ("boulevard, seed 1, 20 s (ours alone; the baseline is as published)",)
"""What both were tuned on."""

THRESHOLDS: dict[str, float] = {
    "range": 2000.0,
    "speed": 60.0,
    "position": 1.5,
    "wrong_way": 0.63,
    "freshness": 0.2,
    "position_speed": 11.2,
    "drift": 6.4,
    "heading": 3.8,
    "turn": 11.8,
    "acceleration": 16.2,
    "impulse": 4.2,
    "dynamics": 6.0,
    "overlap": 0.4,
    "appearance": 150.0,
    "kalman": 143.0,
}
"""Of our checks, by name; units as in `config.CHECKS`."""

PARDON_S: float = 10.0

CATCH: dict[str, float] = {}
"""Parameters of the baseline, by the names of `catch.CatchParameters`."""
