"""The default traffic: which bodies drive how often.

Cars have the segments of a published fleet, that of Germany: passenger cars registered on 1 January 2015
(Kraftfahrt-Bundesamt, Bestand an Personenkraftwagen nach Segmenten), in percent:

    minis 6.6, small cars 19.9, compact class 26.4, middle class 16.3, upper middle and upper class 5.4,
    SUVs 3.4, off-road vehicles 3.8, sports cars 1.8, mini vans and large vans 9.1, utilities 3.5

Motor homes and others (3.8) are left out. How a segment divides into bodies (saloons and estates of the
middle class, estates with a roof box) and the shares of pick-ups, trucks and two-wheelers are our own
estimates.
"""

from __future__ import annotations

CARS = {
    "city_car": 6.6,
    "supermini": 19.9,
    "hatchback": 26.4,
    "sedan": 8.1,
    "estate": 7.4,
    "estate_roof_box": 0.8,
    "executive": 5.4,
    "small_suv": 3.4,
    "suv": 3.8,
    "coupe": 1.8,
    "mpv": 9.1,
    "compact_van": 3.5,
    "pickup": 0.5,
}
"""Bodies of the class car, and the share of each in percent of the fleet."""

OTHERS = {
    "van": 0.07,
    "minibus": 0.02,
    "box_truck": 0.03,
    "tipper": 0.01,
    "semi_trailer": 0.02,
    "bus": 0.02,
    "motorcycle": 0.03,
    "scooter": 0.02,
    "bicycle": 0.045,
    "cargo_bike": 0.008,
    "kick_scooter": 0.007,
}
"""Other bodies of vehicles, and the share of each among all vehicles."""

PEOPLE = {
    "pedestrian": 0.34,
    "pedestrian_backpack": 0.16,
    "pedestrian_suitcase": 0.06,
    "pedestrian_umbrella": 0.06,
    "pedestrian_pushchair": 0.07,
    "child": 0.1,
    "pedestrian_standing": 0.12,
    "pedestrian_sitting": 0.06,
    "pedestrian_bending": 0.03,
}
"""Bodies of people on foot, and the share of each among them; our own estimates."""

CAR_SHARES = {body: share / sum(CARS.values()) for body, share in CARS.items()}
"""Share of each car among cars."""


_CAR_SHARE = 1 - sum(OTHERS.values())

DEFAULT_MIX = {body: round(_CAR_SHARE * share, 4) for body, share in CAR_SHARES.items()} | OTHERS
"""Share of each body among vehicles; they sum to 1 but for rounding."""
