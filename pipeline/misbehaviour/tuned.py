"""Tuned parameters of both detectors, written by `benchmarks/misbehaviour.py --ship`."""

from __future__ import annotations

DRIVES = (
    "spider-21, 30 s",
    "grid-22, 30 s",
    "random-23, 30 s",
    "grid-24, 30 s (ours alone)",
    "town06-8, 30 s (ours alone, honest messages)",
)
"""Drives used for tuning, with their seeds; the benchmark tests on none of them."""

THRESHOLDS: dict[str, float] = {
    "range": 2334.0,
    "speed": 51.23,
    "position": 1.5,
    "wrong_way": 0.6,
    "freshness": 0.2,
    "position_speed": 4.449,
    "drift": 10.98,
    "heading": 5.305,
    "turn": 27.47,
    "acceleration": 25.22,
    "impulse": 6.258,
    "dynamics": 5.0,
    "overlap": 0.2,
    "appearance": 150.0,
    "kalman": 178.2,
}
"""Thresholds of our checks, by name; units as in `config.CHECKS`."""

CANDIDATES: dict[str, tuple[float, ...]] = {
    "range": (2334.0,),
    "speed": (51.23,),
    "position": (1.718, 1.5),
    "wrong_way": (1.053, 0.6),
    "freshness": (0.2,),
    "position_speed": (28.63, 9.359, 5.331, 4.449, 3.758),
    "drift": (10.98, 8.717, 7.788, 6.785, 5.687),
    "heading": (7.536, 5.305, 4.362, 3.012, 3.0),
    "turn": (27.47, 9.757, 7.23, 5.38, 3.278),
    "acceleration": (25.22, 9.08, 7.861, 6.319, 5.038),
    "impulse": (6.258, 4.632, 4.178, 3.714, 3.5),
    "dynamics": (36.0, 6.9, 5.645, 5.0),
    "overlap": (0.2,),
    "appearance": (150.0,),
    "kalman": (178.2, 91.15, 65.87, 51.46, 36.87),
}
"""What the search chose each threshold from, from high to low."""

PARDON_S: float = 30
ACCELERATION_PARDON_S: float = 3

CATCH_BOUNDED: dict[str, float] = {
    "max_range_m": 1000.0,
    "max_off_road_m": 0.5097,
    "max_speed_mps": 37.33,
    "max_acceleration_mps2": 4.825,
    "max_deceleration_mps2": 8.186,
    "max_heading_change_rad": 1.768,
    "max_intersection_s": 3.334,
    "max_time_s": 3.428,
    "heading_time_s": 3.814,
    "margin_up_m": 0.8414,
    "margin_down_m": 4.049,
    "off_road_speed_mps": 1.514,
}
"""Parameters of the baseline, by the names of `catch.CatchParameters`, with the bound on false positives."""

CATCH_F1: dict[str, float] = {
    "max_range_m": 946.8,
    "max_off_road_m": 0.1787,
    "max_speed_mps": 34.66,
    "max_acceleration_mps2": 3.3,
    "max_deceleration_mps2": 11.93,
    "max_heading_change_rad": 1.557,
    "max_intersection_s": 3.483,
    "max_time_s": 4.03,
    "heading_time_s": 5.0,
    "margin_up_m": 0.2839,
    "margin_down_m": 0.6737,
    "off_road_speed_mps": 0.1065,
}
"""The same, tuned for F1 without that bound."""
