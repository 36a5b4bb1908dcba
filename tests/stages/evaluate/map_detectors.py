"""Detectors that tell which maps they were trained on."""

from place_drive import PlaceDetector

MAP = "ab" * 32


class TrainedHere(PlaceDetector):
    training_maps_sha256 = ("cd" * 32, MAP)


class TrainedElsewhere(PlaceDetector):
    training_maps_sha256 = ("cd" * 32,)


class TrainedSomewhere(PlaceDetector):
    training_maps_sha256 = ("cd" * 32, None)
