"""Tuned parameters of both detectors, written by `benchmarks/misbehaviour.py --ship`."""

from __future__ import annotations

DRIVES = (
    "spider-21, 30 s",
    "grid-22, 30 s",
    "random-23, 30 s",
    "grid-24, 30 s (ours alone)",
)
"""Drives used for tuning, on networks drawn from these seeds; the benchmark tests on none of them."""

THRESHOLDS: dict[str, float] = {
    "range": 2346.0,
    "speed": 51.26,
    "position": 1.5,
    "wrong_way": 0.6,
    "freshness": 0.2,
    "position_speed": 14.31,
    "drift": 13.22,
    "heading": 5.031,
    "turn": 31.17,
    "acceleration": 53.89,
    "impulse": 5.782,
    "dynamics": 41.4,
    "overlap": 0.6611,
    "appearance": 150.0,
    "kalman": 560.6,
}
"""Thresholds of our checks, by name; units as in `config.CHECKS`."""

PARDON_S: float = 30

CATCH_BOUNDED: dict[str, float] = {
    "max_range_m": 876.3,
    "max_speed_mps": 38.44,
    "max_acceleration_mps2": 7.87,
    "max_deceleration_mps2": 7.718,
    "max_heading_change_rad": 1.37,
    "max_intersection_s": 1.243,
    "max_time_s": 4.822,
    "max_off_road_m": 1.957,
    "heading_time_s": 0.6341,
    "margin_up_m": 0.482,
    "margin_down_m": 1.354,
    "off_road_speed_mps": 0.8904,
}
"""Parameters of the baseline, by the names of `catch.CatchParameters`, with the bound on false positives."""

CATCH_F1: dict[str, float] = {
    "max_range_m": 876.3,
    "max_speed_mps": 38.44,
    "max_acceleration_mps2": 7.87,
    "max_deceleration_mps2": 7.718,
    "max_heading_change_rad": 1.37,
    "max_intersection_s": 1.243,
    "max_time_s": 4.822,
    "max_off_road_m": 1.957,
    "heading_time_s": 0.6341,
    "margin_up_m": 0.482,
    "margin_down_m": 1.354,
    "off_road_speed_mps": 0.8904,
}
"""The same, tuned for F1 without that bound."""
